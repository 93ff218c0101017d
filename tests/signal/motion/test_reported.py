"""Motions told from velocity or position."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from opamc_cli.signal.motion import reported
from opamc_cli.signal.motion.reported import (
    _probe,
    find_joint_motions,
    fluctuation_frequency,
    hides_motions,
    motor_frequency,
    quiet_velocity,
    unwrapped,
    velocity_from_position,
)

FS_HZ = 1000.0


def profile(signs=(1, -1, 1), speed=0.5, ramp=200, cruise=400, rest=300):
    up = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    one = np.concatenate([up, np.ones(cruise), up[::-1]]) * speed
    pieces, truth, n = [np.zeros(rest)], [], rest
    for sign in signs:
        truth.append((n, n + one.size, sign))
        pieces += [sign * one, np.zeros(rest)]
        n += one.size + rest
    return np.concatenate(pieces), truth


def found(velocity):
    return find_joint_motions(velocity, FS_HZ, 0.1, 0.06)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_finds_moves_with_direction_and_speed(noise):
    velocity, truth = profile()
    velocity = velocity + noise * np.random.default_rng(0).standard_normal(velocity.size)
    motions = found(velocity)
    assert [m.direction for m in motions] == [s for _, _, s in truth]
    for motion, (start, stop, _) in zip(motions, truth, strict=True):
        assert abs(motion.start - start) < 40
        assert abs(motion.stop - stop) < 40
        assert motion.speed_rad_s == pytest.approx(0.5, rel=0.02)


def test_finds_the_same_moves_in_a_quantised_wrapped_position():
    velocity, truth = profile(speed=3.0)
    angle = np.cumsum(velocity) / FS_HZ
    position = (np.round(angle / 1e-4) * 1e-4 + np.pi) % (2 * np.pi) - np.pi
    derived = velocity_from_position(position, FS_HZ)
    assert np.abs(derived - velocity).max() < 0.06
    assert [m.direction for m in found(derived)] == [s for _, _, s in truth]


@pytest.mark.parametrize(("share", "hides"), [(0.0, False), (0.01, False), (0.015, True)])
def test_noise_hides_motions_where_four_deviations_are_a_twentieth_of_the_speed(share, hides):
    velocity, _ = profile(signs=(1, -1) * 5, cruise=2000, rest=2000)
    noise = 0.5 * share * np.random.default_rng(0).standard_normal(velocity.size)
    assert hides_motions(velocity + noise) is hides
    assert not hides_motions(np.zeros(9))
    assert not hides_motions(np.full(9, np.nan))
    assert not hides_motions(np.zeros(0))


def test_a_reversal_without_rest_is_two_motions():
    velocity, _ = profile(signs=(1, -1), rest=1)
    assert [m.direction for m in found(velocity)] == [1, -1]


def test_a_controllers_quiver_is_no_motion():
    assert found(1e-3 * np.random.default_rng(1).standard_normal(5000)) == []
    assert found(np.zeros(100)) == []
    assert found(np.zeros(0)) == []
    assert found(np.full(100, np.nan)) == []


@pytest.mark.parametrize("n", [0, 1, 2, 3, 5, 50])
def test_velocity_of_short_positions(n):
    velocity = velocity_from_position(0.002 * np.arange(n), FS_HZ)
    assert velocity.shape == (n,)
    if n >= 3:
        assert velocity == pytest.approx(2.0)


@pytest.mark.parametrize(("n", "window"), [(5, 5), (400, 21), (401, 401), (400, 399)])
def test_velocity_is_that_of_local_parabolas(n, window):
    place = np.cumsum(np.random.default_rng(n).normal(size=n)) * 1e-2
    expected = savgol_filter(place, window, 2, deriv=1, delta=1 / FS_HZ)
    velocity = velocity_from_position(place, FS_HZ, window / FS_HZ)
    np.testing.assert_allclose(velocity, expected, atol=1e-12 * np.abs(expected).max())


def test_what_stands_for_the_carrier():
    turn = 2 * np.pi
    assert motor_frequency(turn, 100, 5) == pytest.approx(500)
    assert motor_frequency(turn, 100, None) == pytest.approx(100)
    assert motor_frequency(turn, None, None) == pytest.approx(1)


def test_fluctuations_of_too_few_samples_are_as_fast_as_can_be_told():
    sine = np.sin(2 * np.pi * 5 * np.arange(FS_HZ) / FS_HZ)
    assert fluctuation_frequency(sine, FS_HZ) == pytest.approx(5, rel=0.05)
    for known in (np.zeros(0), sine[:9], np.where(np.arange(FS_HZ) < 9, sine, np.nan)):
        assert fluctuation_frequency(known, FS_HZ) == FS_HZ / 4


def steps(*parts):
    """Return stretches of constant speed, (speed, samples) each."""
    return np.concatenate([np.full(n, float(speed)) for speed, n in parts])


def spans(velocity, least_s=0.02, still_s=0.06):
    found = find_joint_motions(velocity, FS_HZ, least_s, still_s)
    return [(m.start, m.stop, m.direction) for m in found]


def test_a_motion_reaches_a_twentieth_and_lasts_above_a_fiftieth_of_the_largest_speed():
    velocity = steps(
        *((0, 2000), (0.021, 1000), (1, 2000), (0.019, 2000), (0.049, 2000), (-0.051, 2000))
    )
    assert spans(velocity) == [(2000, 5000, 1), (9000, 11000, -1)]
    (first, second) = find_joint_motions(velocity, FS_HZ, 0.02, 0.06)
    assert (first.speed_rad_s, second.speed_rad_s) == (1.0, pytest.approx(0.051))
    # a joint that never reaches a hundredth of a radian a second stands
    assert spans(0.0099 * velocity) == []
    assert len(spans(0.0101 * velocity)) == 2


def test_short_rests_are_bridged_between_motions_of_one_direction():
    for rest, n in ((59, 1), (60, 2)):
        assert len(spans(steps((1, 200), (0, rest), (1, 200)))) == n
        assert len(spans(steps((1, 200), (0, rest), (-1, 200)))) == 2
    joined = steps((1, 100), (0, 30), (1, 100), (0, 30), (1, 100))
    assert spans(joined) == [(0, 360, 1)]


def test_swings_that_settle_a_motion_are_none():
    moved = ((0, 3000), (1, 200))
    settling = ((0, 20), (-0.08, 48), (0, 20), (0.07, 40))  # 1.9 % and 1.4 % of the way
    found = spans(steps(*moved, *settling, (0, 100), (-1, 200)))
    assert found == [(3000, 3200, 1), (3428, 3628, -1)]
    # after a rest, or over a longer way, it is a motion
    assert len(spans(steps(*moved, (0, 60), (-0.08, 120)))) == 2
    assert len(spans(steps(*moved, (0, 20), (-0.08, 51)))) == 2


def test_short_motions_are_dropped():
    velocity = steps((1, 200), (0, 100), (1, 49), (0, 100), (1, 50))
    assert spans(velocity, least_s=0.05) == [(0, 200, 1), (449, 499, 1)]
    # those of fewer than ten samples at whatever rate
    velocity = steps((1, 200), (0, 100), (1, 9), (0, 100), (1, 10))
    assert spans(velocity, least_s=0.0) == [(0, 200, 1), (409, 419, 1)]


def test_noise_raises_both_thresholds():
    rng = np.random.default_rng(2)
    velocity = steps((0, 2000), (0.06, 500), (0, 2000), (1, 500), (0, 2000))
    loud = velocity + 0.02 * rng.standard_normal(velocity.size)
    assert [a // 100 for a, _, _ in spans(loud)] == [45]
    quiet = velocity + 0.002 * rng.standard_normal(velocity.size)
    assert [a // 100 for a, _, _ in spans(quiet)] == [20, 45]


def test_the_parabola_has_five_samples_at_least_and_a_twentieth_of_a_second():
    angle = np.zeros(400)
    angle[200] = 1.0
    for fs_hz, width in ((20.0, 5), (1000.0, 51), (1010.0, 51), (100.0, 5)):
        moved = np.flatnonzero(velocity_from_position(angle, fs_hz))
        # the middle of a parabola has no slope from its own sample
        assert (moved[0], moved[-1]) == (200 - width // 2, 200 + width // 2)


def test_missing_angles_are_bridged_and_turns_undone():
    angle = 3.0 * np.arange(400) / 1000
    wrapped = np.mod(angle + 6.0, 2 * np.pi)
    wrapped[[0, 50, 51, 399]] = np.nan
    velocity = velocity_from_position(wrapped, FS_HZ)
    assert velocity[26:370] == pytest.approx(3.0)
    assert np.isnan(velocity_from_position(np.full(9, np.nan), FS_HZ)).all()


def test_the_window_is_doubled_until_the_noise_is_below_standstill():
    rng = np.random.default_rng(5)
    angle = np.sin(np.arange(4000) / 1000)
    for noise, window_s in ((3e-3, 0.05), (1e-2, 0.1), (3e-2, 0.2), (0.1, 0.2)):
        noisy = angle + noise * rng.standard_normal(angle.size)
        expected = velocity_from_position(noisy, FS_HZ, window_s)
        np.testing.assert_array_equal(quiet_velocity(noisy, FS_HZ), expected)
    assert quiet_velocity(np.zeros(0), FS_HZ).size == 0


@pytest.mark.parametrize("n", [10, 63, 64, 65, 200])
def test_the_frequency_of_fluctuations_is_that_of_the_first_zero_of_their_autocorrelation(n):
    t = np.arange(n)
    x = np.sin(2 * np.pi * t / 40) + 0.3 * np.modf(t * 0.6180339887)[0] + 0.1 * t
    plain = x - np.polyval(np.polyfit(t, x, 1), t)
    lags = range(n // 2)
    below = [k for k in lags if plain[: n - k] @ plain[k:] <= 0]
    assert fluctuation_frequency(x, FS_HZ) == FS_HZ / (4 * (below[0] if below else n // 2))
    # what is missing between known samples is bridged
    x[3] = np.nan
    bridged = np.where(t == 3, (x[2] + x[4]) / 2, x)
    assert fluctuation_frequency(x, FS_HZ) == fluctuation_frequency(bridged, FS_HZ)


def test_the_speed_is_the_highest_but_a_hundredth_of_the_motion():
    velocity = np.concatenate([np.zeros(300), np.arange(200) ** 2 / 40_000, np.zeros(300)])
    (motion,) = found(velocity)
    # the largest on one side, the threshold's on the other: each sample counts
    assert motion.speed_rad_s == np.quantile(velocity[motion.start : motion.stop], 0.99)


def test_a_long_series_is_probed_in_four_places(monkeypatch):
    monkeypatch.setattr(reported, "PROBE", 40)
    places = [*range(10), *range(30, 40), *range(60, 70), *range(90, 100)]
    assert _probe(np.arange(100.0)).tolist() == places
    assert _probe(np.arange(40.0)).tolist() == list(range(40))


def test_jumps_by_a_whole_turn_are_undone_and_nothing_else():
    angle = np.cumsum(np.random.default_rng(0).uniform(-0.5, 0.5, 1000))
    angle[[0, 400, 401, 999]] = np.nan
    np.testing.assert_array_equal(unwrapped(angle), angle)
    wrapped = np.mod(angle - angle[1], 2 * np.pi) + angle[1]
    assert np.nanmax(np.abs(np.diff(wrapped))) > 6
    np.testing.assert_allclose(unwrapped(wrapped), angle, atol=1e-12)
    assert np.isnan(unwrapped(np.full(3, np.nan))).all()
