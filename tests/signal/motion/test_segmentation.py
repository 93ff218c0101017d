"""Motions found in generated currents against the moves that made them."""

import numpy as np
import pytest
from axis import errors_s, gather, segments_of
from carriers import Move, Torque, record

from opamc_cli.signal.motion import segmentation
from opamc_cli.signal.motion.boundaries import refine_boundaries
from opamc_cli.signal.motion.motion_signal import MotionFrames
from opamc_cli.signal.motion.rotation import Rotation
from opamc_cli.signal.motion.segmentation import (
    Evidence,
    MotionRule,
    clear_motion,
    find_motions,
    hysteresis,
    largest_frequency,
    standing_time,
)
from opamc_cli.signal.transform.analytic import clarke

HELD = Torque(hold=1.0)
NO_HOLDING = Torque(hold=0.0, swing=0.0, friction=0.3)


def moves(f_max_hz, **options):
    return [
        Move(f_max_hz, 1, **options),
        Move(f_max_hz, -1, **options),
        Move(0.6 * f_max_hz, -1, **options),
        Move(f_max_hz, 1, **options),
    ]


def noise_for(snr_db, moves, torque):
    clean = record(moves, torque=torque)
    moving = clean.frequency_hz != 0
    return float(clean.phases[:, moving].std()) * 10 ** (-snr_db / 20)


@pytest.mark.parametrize("snr_db", [20, 40])
@pytest.mark.parametrize("torque", [HELD, NO_HOLDING], ids=["held", "not held"])
@pytest.mark.parametrize("f_max_hz", [62.8, 157, 314])
def test_finds_every_motion_with_its_speed_and_direction(f_max_hz, torque, snr_db):
    wanted = moves(f_max_hz, ramp_s=0.2)
    errors = []
    for seed in range(3):
        noise = noise_for(snr_db, wanted, torque)
        recording = record(wanted, torque=torque, noise=noise, offset=0.03, seed=seed)
        spans, motions = segments_of(recording.phases)
        assert [m.direction for m in motions] == [m.direction for m in wanted]
        found_hz = np.array([m.f_max_hz for m in motions])
        assert found_hz == pytest.approx([m.f_max_hz for m in wanted], rel=0.03)
        errors.append(errors_s(spans, recording.intervals))
    off = np.abs(np.concatenate(errors))
    assert np.median(off, axis=0).max() < 0.02
    assert off.max() < 0.15


@pytest.mark.parametrize("smooth", [True, False], ids=["jerk limited", "trapezoidal"])
@pytest.mark.parametrize("ramp_s", [0.12, 0.4])
def test_boundaries_do_not_depend_on_the_shape_of_the_ramp(ramp_s, smooth):
    wanted = moves(157, ramp_s=ramp_s, rest_s=0.4)
    recording = record(wanted, noise=0.02, smooth=smooth)
    spans, _ = segments_of(recording.phases)
    assert np.abs(errors_s(spans, recording.intervals)).max() < 0.025


@pytest.mark.parametrize("at_a_time", [1, 7, 64])
def test_clear_frames_do_not_depend_on_how_many_are_looked_at_together(monkeypatch, at_a_time):
    rng = np.random.default_rng(0)
    turn, along, strength = rng.normal(size=(3, 200)).astype(np.float32)
    ridge_hz = rng.uniform(1, 60, 200).astype(np.float32)
    frames = MotionFrames(16, strength, ridge_hz)
    evidence = Evidence(frames, Rotation(turn, along), True, 100.0, 0.1, 1.0)
    rule = MotionRule(on=-1.0, off=-2.0, min_motion_s=0, min_still_s=0, max_dip_s=0)
    whole = clear_motion(evidence, rule)
    assert 0 < whole.sum() < whole.size
    monkeypatch.setattr(segmentation, "FRAMES_AT_A_TIME", at_a_time)
    np.testing.assert_array_equal(clear_motion(evidence, rule), whole)


def test_a_dip_while_braking_is_one_motion():
    torque = Torque(hold=0.0, swing=0.0, friction=0.5, viscous=0.0, inertia=1.5)
    wanted = [Move(157, ramp_s=0.3), Move(157, -1, ramp_s=0.3)]
    recording = record(wanted, torque=torque, noise=0.03)
    z = clarke(*recording.phases)
    braking = slice(recording.intervals[0][1] - 600, recording.intervals[0][1])
    assert np.abs(z[braking]).min() < 0.05  # the current does pass zero
    assert len(segments_of(recording.phases)[0]) == 2


def test_a_cruise_without_current_is_bridged():
    # Gravity pulls as hard as friction brakes: no current at constant speed.
    torque = Torque(hold=-0.5, swing=0.0, friction=0.4, viscous=0.1, ripple=0.0)
    recording = record([Move(157), Move(157)], torque=torque, noise=0.02)
    spans, _ = segments_of(recording.phases)
    assert len(spans) == 2
    assert np.abs(errors_s(spans, recording.intervals)).max() < 0.03


def test_a_short_rest_between_equal_motions_divides_them():
    recording = record([Move(157, rest_s=0.2)] * 3, noise=0.02)
    assert len(segments_of(recording.phases)[0]) == 3


def test_a_reversal_without_rest_divides_two_motions():
    recording = record([Move(157, 1, rest_s=0.0), Move(157, -1)], noise=0.02)
    spans, motions = segments_of(recording.phases)
    assert [m.direction for m in motions] == [1, -1]
    assert np.abs(errors_s(spans, recording.intervals)).max() < 0.12


@pytest.mark.parametrize("hold", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(5))
def test_noise_at_standstill_is_no_motion(hold, seed):
    rng = np.random.default_rng(seed)
    phases = hold * np.array([[1.0], [-0.4], [-0.6]]) + 0.1 * rng.standard_normal((3, 60_000))
    assert find_motions(gather(clarke(*phases.astype(np.float32))), MotionRule()) == []


def test_a_changing_torque_at_standstill_is_no_motion():
    n = 20_000
    torque = np.sin(2 * np.pi * 0.7 * np.arange(n) / 2048)  # changes its sign
    phases = torque * np.array([[1.0], [-0.3], [-0.7]])
    phases += 0.02 * np.random.default_rng(1).standard_normal((3, n))
    assert find_motions(gather(clarke(*phases.astype(np.float32))), MotionRule()) == []


def test_a_single_phase_has_no_direction_but_the_same_motions():
    recording = record(moves(157), noise=0.02)
    from opamc_cli.signal.motion.noise import noise_level
    from opamc_cli.signal.transform.analytic import AnalyticStream

    stream = AnalyticStream(2048.0, 8.0)
    z = np.concatenate([stream.push(recording.phases[0]), stream.finish()])
    motions = find_motions(gather(z, has_direction=False), MotionRule())
    assert [m.direction for m in motions] == [0] * 4
    off = []
    for i, (motion, truth) in enumerate(zip(motions, recording.intervals, strict=True)):
        before = (motions[i - 1].last * 16 + motion.first * 16) // 2 if i else 0
        after = (motions[i + 1].first * 16 + motion.last * 16) // 2 if i < 3 else z.size
        current = recording.phases[0][before:after]
        start, stop = refine_boundaries(
            current,
            motion.first * 16 - before,
            motion.last * 16 - before,
            2048.0,
            noise_level(current),
        )
        off += [start + before - truth[0], stop + before - truth[1]]
    assert np.median(np.abs(off)) / 2048 < 0.02


class TestHysteresis:
    def test_needs_the_upper_threshold_and_keeps_to_the_lower(self):
        strength = np.array([0, 0.4, 0.6, 0.4, 0.1, 0.4, 0.4, 0.0, 0.5])
        assert hysteresis(strength, 0.5, 0.3) == [(1, 4), (8, 9)]

    def test_of_nothing_is_nothing(self):
        assert hysteresis(np.zeros(0), 0.5, 0.3) == []

    def test_nan_is_below_every_threshold(self):
        assert hysteresis(np.array([1, np.nan, 1.0]), 0.5, 0.3) == [(0, 1), (2, 3)]

    def test_may_reach_both_ends(self):
        assert hysteresis(np.ones(3), 0.5, 0.3) == [(0, 3)]


def test_a_single_frame_does_not_make_the_largest_frequency():
    ridge = np.full(50, 100.0)
    ridge[[7, 20, 21]] = 400.0
    assert largest_frequency(ridge) == 100.0
    assert largest_frequency(np.zeros(0)) == 0.0
    assert largest_frequency(np.array([5.0, 7.0])) == 6.0


def test_a_lone_frame_of_noise_behind_a_motion_is_not_its_end():
    """The frame agrees with the vector by chance, at a frequency the motion never had."""
    n, step, fs_hz = 60, 16, 2048.0
    strength = np.r_[np.full(40, 0.9), np.full(n - 40, 0.35)].astype(np.float32)
    strength[52] = 0.57
    ridge_hz = np.full(n, 300.0, dtype=np.float32)
    ridge_hz[40:] = 20.0
    ridge_hz[52] = 580.0
    turned = 2 * np.pi * ridge_hz / fs_hz
    turned[51:54] = 2 * np.pi * 580.0 / fs_hz
    size = np.r_[np.full(40, 100.0), np.full(n - 40, 0.1)]
    rotation = Rotation(
        (size * np.sin(turned)).astype(np.float32), (size * np.cos(turned)).astype(np.float32)
    )
    evidence = Evidence(MotionFrames(step, strength, ridge_hz), rotation, True, fs_hz, 0.01, 5.0)
    (motion,) = find_motions(evidence, MotionRule())
    assert (motion.first, motion.last) == (0, 40)
    assert motion.f_last_hz == 300.0


TORQUES = {
    "held": Torque(hold=1.0),
    "not held": NO_HOLDING,
    "dip": Torque(hold=0.0, swing=0.0, friction=0.5, viscous=0.0, inertia=1.5),
    "cruise": Torque(hold=-0.5, swing=0.0, friction=0.4, viscous=0.1, ripple=0.0),
}
FOUND = {
    ("held", 62.8): [
        (1228, 2868, 90, 166, 1, 62.86, 43.54, 1),
        (3891, 5526, 255, 331, -1, 62.86, 47.41, 7),
        (5598, 7231, 366, 436, -1, 37.71, 31.96, 0),
        (8254, 9894, 529, 605, 1, 62.86, 43.91, 1),
        (10303, 11943, 658, 733, 1, 62.86, 44.07, 0),
    ],
    ("held", 314.0): [
        (1228, 2868, 86, 170, 1, 314.22, 105.78, 1),
        (3891, 5529, 253, 337, -1, 314.22, 96.24, 0),
        (5594, 7231, 359, 442, -1, 188.49, 75.35, 6),
        (8254, 9894, 525, 609, 1, 314.22, 108.14, 1),
        (10303, 11943, 653, 737, 1, 314.22, 109.18, 2),
    ],
    ("not held", 62.8): [
        (1236, 2860, 90, 166, 1, 62.86, 40.12, 0),
        (3899, 7269, 257, 441, -1, 62.86, 16.31, 0),
        (8262, 9882, 529, 605, 1, 62.86, 40.20, 0),
        (10311, 11961, 658, 734, 1, 62.86, 38.14, 0),
    ],
    ("not held", 314.0): [
        (1236, 2845, 86, 172, 1, 314.22, 75.83, 0),
        (3899, 7207, 252, 444, -1, 314.22, 49.67, 0),
        (8262, 9898, 525, 610, 1, 314.22, 90.78, 0),
        (10311, 11920, 653, 739, 1, 314.22, 76.63, 0),
    ],
    ("dip", 62.8): [
        (1234, 2862, 90, 165, 1, 63.37, 44.40, 1),
        (3897, 7271, 257, 441, -1, 62.91, 17.84, 0),
        (8260, 9884, 529, 604, 1, 63.02, 45.00, 1),
        (10309, 11931, 658, 732, 1, 63.23, 44.68, 0),
    ],
    ("dip", 314.0): [
        (1234, 2850, 86, 173, 1, 314.22, 53.63, 0),
        (3897, 7211, 252, 444, -1, 314.22, 55.30, 0),
        (8260, 9900, 525, 610, 1, 314.22, 90.87, 0),
        (10309, 11963, 653, 739, 1, 314.22, 78.61, 0),
    ],
    ("cruise", 62.8): [
        (1228, 2868, 90, 165, 1, 59.53, 46.32, 2),
        (3891, 5521, 257, 331, -1, 62.86, 53.17, 4),
        (5640, 7231, 365, 437, -1, 37.71, 31.01, 0),
        (8254, 9894, 529, 604, 1, 59.49, 46.63, 2),
        (10303, 11943, 658, 732, 1, 60.44, 46.82, 1),
    ],
    ("cruise", 314.0): [
        (1228, 2868, 86, 171, 1, 312.23, 89.33, 0),
        (3891, 5526, 252, 336, -1, 314.22, 100.23, 1),
        (5621, 7231, 360, 441, -1, 188.49, 87.29, 1),
        (8254, 9894, 525, 610, 1, 311.89, 91.33, 0),
        (10303, 11943, 653, 738, 1, 311.72, 92.24, 1),
    ],
}
"""By torque and largest frequency, of each motion: start and stop in samples, frames, direction,
largest and last frequency in Hz, and frames to where it first was as high as at last."""


@pytest.mark.parametrize(("torque", "f_max_hz"), FOUND)
def test_motions_of_recordings_without_noise_to_the_frame(torque, f_max_hz):
    wanted = [
        Move(f_max_hz),
        Move(f_max_hz, -1, rest_s=0.03),
        Move(0.6 * f_max_hz, -1),
        Move(f_max_hz, rest_s=0.2),
        Move(f_max_hz),
    ]
    spans, motions = segments_of(record(wanted, torque=TORQUES[torque]).phases)
    found = FOUND[torque, f_max_hz]
    assert len(motions) == len(found)
    for span, motion, (start, stop, first, last, *others) in zip(
        spans, motions, found, strict=True
    ):
        assert span == pytest.approx((start, stop), abs=2)
        assert (motion.first, motion.last) == (first, last)
        assert (motion.direction, motion.n_to_f_last) == (others[0], others[3])
        assert (motion.f_max_hz, motion.f_last_hz) == pytest.approx(others[1:3], rel=2e-3)


FRAME_S, STEP = 0.01, 16
FS_HZ = STEP / FRAME_S


def frames_of(*parts, has_direction=True):
    """Make evidence of stretches: (frames, motion signal, frequency, size of the current)."""
    n, values = [part[0] for part in parts], np.array([part[1:] for part in parts])
    strength, hz, size = np.repeat(values, n, axis=0).T.astype(np.float32)
    turned = 2 * np.pi * hz / FS_HZ
    frames = MotionFrames(STEP, strength, np.abs(hz))
    rotation = Rotation(size * np.sin(turned), size * np.cos(turned))
    return Evidence(frames, rotation, has_direction, FS_HZ, 0.01, 5.0)


MOVES = (0.9, 100.0, 1.0)
BACK = (0.9, -100.0, 1.0)
NOTHING = (0.0, 100.0, 0.0)
STANDS = (0.0, 0.0, 0.05)


def found_in(*parts, **options):
    motions = find_motions(
        frames_of((20, *NOTHING), *parts, (20, *NOTHING), **options), MotionRule()
    )
    return [(m.first - 20, m.last - 20, m.direction) for m in motions]


def test_three_clear_frames_are_a_motion():
    """How long it really lasts is told by its boundaries, not by its wavelets."""
    assert found_in((2, *MOVES)) == []
    assert found_in((3, *MOVES)) == [(0, 3, 1)]
    assert found_in((10, *MOVES)) == [(0, 10, 1)]
    assert found_in((10, *BACK)) == [(0, 10, -1)]
    assert found_in((10, *BACK), has_direction=False) == [(0, 10, 0)]
    # it reaches 0.5, from its first frame to its last
    assert found_in((30, 0.49, 100, 1), (10, 0.5, 100, 1), (9, 0.49, 100, 1)) == [(30, 40, 1)]
    assert found_in((30, 0.49, 100, 1)) == []


@pytest.mark.parametrize(
    ("gap", "n"),
    [
        ([(5, *STANDS)], 1),  # shorter than 0.06 s
        ([(6, *STANDS)], 2),
        # two seconds in which nothing is known, within which it stands for less than 0.06 s
        ([(200, *NOTHING)], 1),
        ([(201, *NOTHING)], 2),
        ([(100, *NOTHING), (5, *STANDS)], 1),
        ([(100, *NOTHING), (6, *STANDS)], 2),
        # a current within the noise, and one that turns, prove nothing
        ([(100, 0.0, 0.0, 16 * 2 * 0.03**2 * 0.99)], 1),
        ([(100, 0.0, 0.0, 16 * 2 * 0.03**2 * 1.01)], 2),
        ([(100, 0.0, 4.9, 1.0)], 2),
        ([(100, 0.0, 5.1, 1.0)], 1),
        # slower than 0.7 of the largest frequency where the gap begins or ends
        ([(9, 0.9, 71.0, 1.0), (50, *NOTHING), (9, 0.9, 71.0, 1.0)], 1),
        ([(9, 0.9, 69.0, 1.0), (50, *NOTHING)], 2),
        ([(50, *NOTHING), (9, 0.9, 69.0, 1.0)], 2),
    ],
)
def test_gaps_within_a_motion(gap, n):
    assert len(found_in((30, *MOVES), *gap, (30, *MOVES))) == n
    length = 60 + sum(part[0] for part in gap)
    if n == 1:
        assert found_in((30, *MOVES), *gap, (30, *MOVES)) == [(0, length, 1)]
    # the other direction is another motion, however short the gap
    assert len(found_in((30, *MOVES), *gap, (30, *BACK))) == 2


def test_a_lobe_is_cut_where_the_vector_turns_about():
    # the two frames that see both senses are of neither
    assert found_in((30, *MOVES), (40, *BACK)) == [(0, 29, 1), (31, 70, -1)]
    assert found_in((30, *MOVES), (40, *BACK), (30, *MOVES)) == [
        *((0, 29, 1), (31, 69, -1), (71, 100, 1))
    ]
    # a few frames are no motion of their own
    assert found_in((30, *MOVES), (4, *BACK), (30, *MOVES)) == [(0, 64, 1)]
    assert found_in((30, *MOVES), (40, *BACK), has_direction=False) == [(0, 70, 0)]


def test_frames_are_clear_where_ridge_and_vector_agree_within_a_fifth():
    evidence = frames_of((50, *MOVES))
    for factor, clear in ((1.19, True), (1.21, False), (1 / 1.19, True), (1 / 1.21, False)):
        frames = MotionFrames(STEP, evidence.frames.strength, evidence.frames.ridge_hz * factor)
        other = Evidence(frames, evidence.rotation, True, FS_HZ, 0.01, 5.0)
        assert clear_motion(other, MotionRule()).tolist() == [clear] * 50
    assert clear_motion(evidence, MotionRule(on=0.9)).all()
    assert not clear_motion(evidence, MotionRule(on=0.91)).any()


def test_frequencies_of_a_motion():
    ramp = [(3, 0.9, hz, 1.0) for hz in (20, 40, 60, 80, 100)]
    evidence = frames_of(*ramp, (20, 0.9, 100.0, 1.0), (3, 0.9, 63.0, 1.0))
    (motion,) = find_motions(evidence, MotionRule())
    assert motion.f_max_hz == pytest.approx(100.0)
    assert motion.f_last_hz == pytest.approx(63.0)
    # as fast as at last, but for a twentieth, in the seventh frame
    assert motion.n_to_f_last == 6
    # the ridge is trusted for the largest frequency where the signal is large
    weak = frames_of((20, 0.9, 100.0, 1.0), (20, 0.71, 300.0, 1.0))
    strong = frames_of((20, 0.9, 100.0, 1.0), (20, 0.73, 300.0, 1.0))
    assert [find_motions(one, MotionRule())[0].f_max_hz for one in (weak, strong)] == [100, 300]
    assert standing_time(frames_of((7, *STANDS), (3, *MOVES)), 0, 10) == pytest.approx(0.07)
