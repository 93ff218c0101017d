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
