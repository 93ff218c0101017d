"""A current held against another joint's motion, another clock and another scale of the angle."""

import numpy as np
import pytest

from opamc_cli.signal.plausible.rigid import averaged, follows, lags, left, other_scale, parts

RATE = 200.0


def motion(seed):
    """Return a program of strokes that does not repeat, 60 s."""
    rng = np.random.default_rng(seed)
    stops = np.cumsum(rng.uniform(0.8, 1.6, 45))
    places = rng.uniform(-1.5, 1.5, 45)
    path = np.interp(np.arange(0, 60, 1 / RATE), stops, places)
    window = np.hanning(61)
    return np.convolve(np.pad(path, 30, mode="edge"), window / window.sum(), mode="valid")


def current(position, load=0.0):
    v = np.gradient(position) * RATE
    a = np.gradient(v) * RATE
    noise = np.random.default_rng(1).normal(0, 0.02, position.size)
    x = 0.3 * np.tanh(v / 0.02) + 0.1 * v + 0.02 * a + 2.0 * np.sin(position + 0.4)
    return x + load + noise


OWN, OTHER = motion(0), motion(1)


def later(values, shift_s):
    place = np.arange(values.size)
    return np.interp(place - np.asarray(shift_s) * RATE, place, values)


def test_what_is_left_is_the_noise_and_a_missing_number_is_passed_over():
    x = averaged(current(OWN), RATE)
    friction, inertia, gravity = parts(OWN, RATE)
    x[::7] = np.nan
    assert left(x, friction, inertia, gravity) < 0.01
    assert np.isnan(left(x[:100], friction[:100]))


def test_friction_is_of_a_joints_own_motion_alone():
    positions = {1: OWN, 2: OTHER, 3: motion(2)}
    assert follows(current(OTHER), positions, 1, RATE) == 2
    # A joint carries and moves others: gravity and inertia of theirs are no exchange.
    carried = 3.0 * np.cos(OTHER) + 0.05 * np.gradient(np.gradient(OTHER)) * RATE**2
    assert follows(current(OWN, carried), positions, 1, RATE) is None
    # That a joint stands and carries another is none, either.
    assert follows(carried, {1: np.zeros(OWN.size), 2: OTHER}, 1, RATE) is None


@pytest.mark.parametrize("drift", [0.002, -0.003, 0.01])
def test_clocks_of_two_rates_drift_apart(drift):
    told = lags(current(OWN), later(OWN, drift * np.arange(OWN.size) / RATE), RATE)
    assert told is not None
    assert (told[-1] - told[0]) / drift == pytest.approx(0.75 * 60, rel=0.15)


def test_a_late_motion_is_told_and_a_drives_own_delay_is_left_to_the_model():
    for late in (0.2, -0.4, 1.0):
        told = lags(current(OWN), later(OWN, late), RATE)
        assert told == pytest.approx([late] * 4, abs=0.01)
    assert lags(current(OWN), later(OWN, 0.03), RATE) is None
    assert lags(current(OWN), OWN, RATE) is None


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_dry_friction_holds_at_rest_hides_no_clock(seed):
    """It may be any torque: of a measured-looking staircase one clock was called two."""
    rng, n, rest_s = np.random.default_rng(seed), 24, 6.0
    time = np.arange(0, n * rest_s, 1 / RATE)
    moves = (np.arange(n) * rest_s)[:, None] + [-0.4, 0.0]
    places = rng.uniform(-1.5, 1.5, n)
    path = np.interp(time, moves.ravel()[1:], np.repeat(places, 2)[:-1])
    window = np.hanning(41)
    path = np.convolve(np.pad(path, 20, mode="edge"), window / window.sum(), mode="valid")
    v = np.gradient(path) * RATE
    x = np.tanh(v / 0.02) + 0.1 * v + 0.02 * np.gradient(v) * RATE + 0.3 * np.sin(path + 0.4)
    x += (np.abs(v) < 1e-3) * rng.uniform(-1, 1, n)[(time / rest_s).astype(int)]
    x += rng.normal(0, 0.02, path.size)
    np.testing.assert_allclose(lags(x, later(path, 0.6), RATE), 0.6, atol=0.03)
    assert lags(x, path, RATE) is None


def test_noise_alone_has_no_delay_no_scale_and_no_joint():
    noise = np.random.default_rng(0).normal(size=OWN.size)
    assert lags(noise, OWN, RATE) is None
    assert other_scale(noise, OWN, RATE) is None
    assert follows(noise, {1: OWN, 2: OTHER}, 1, RATE) is None


@pytest.mark.parametrize("times", [180 / np.pi, 0.5 / np.pi, 1 / 100])
def test_gravity_tells_the_scale_of_an_angle(times):
    found = other_scale(current(OWN), times * OWN, RATE)
    assert found is not None
    assert found * times == pytest.approx(1.0, rel=0.2)


def test_an_angle_in_rad_has_no_other_scale_also_without_gravity_or_with_a_constant():
    assert other_scale(current(OWN), OWN, RATE) is None
    assert other_scale(current(OWN, 1.0 + 0.5 * OWN), OWN, RATE) is None
    assert other_scale(current(OWN) - 2.0 * np.sin(OWN + 0.4), OWN, RATE) is None
