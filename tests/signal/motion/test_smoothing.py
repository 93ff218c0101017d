import numpy as np
import pytest
from scipy.signal import savgol_filter
from simulator import simulate

from opamc_cli.signal.motion.smoothing import (
    LONG_WINDOW,
    SHORTEST_WINDOW,
    averaged,
    averaging_kernel,
    block_mean,
    bridged_path,
    derivatives,
    filled,
    measurement_noise,
    smoothing_window,
    taken_noise_gain,
    unstepped,
)

TWO = ((0, 7), (7, 12))


def slow_derivative(path, rate, window, order):
    half = window // 2
    values = np.full(path.size, np.nan)
    times = np.arange(-half, half + 1) / rate
    for i in range(half, path.size - half):
        fitted = np.polynomial.polynomial.polyfit(
            times, path[i - half : i + half + 1], min(3, window - 1)
        )
        values[i] = fitted[order] * (1, 1, 2)[order]
    return values


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("window", [3, 5, 9, 21])
def test_derivative_is_that_of_a_cubic_fitted_around_each_sample(order, window):
    path = np.cumsum(np.random.default_rng(1).normal(size=80))
    slow = slow_derivative(path, 100.0, window, order)
    fast = derivatives(path, 100.0, window, order)
    inside = np.isfinite(slow)
    np.testing.assert_allclose(fast[inside], slow[inside], rtol=1e-6, atol=1e-6)
    ends = savgol_filter(path, window, min(3, window - 1), deriv=order, delta=0.01, mode="interp")
    np.testing.assert_allclose(fast, ends, rtol=1e-9, atol=1e-9 * np.abs(ends).max())


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("size", [LONG_WINDOW, LONG_WINDOW + 2, 1000])
def test_a_long_window_gives_what_sums_over_it_give(order, size):
    # Far from zero, and not of a size that transforms like.
    path = 1e3 + np.cumsum(np.random.default_rng(3).normal(size=size))
    sums = savgol_filter(path, LONG_WINDOW, 3, deriv=order, delta=0.01, mode="interp")
    fast = derivatives(path, 100.0, LONG_WINDOW, order)
    np.testing.assert_allclose(fast, sums, rtol=1e-9, atol=1e-9 * np.abs(sums).max())


@pytest.mark.parametrize("window", [3, 7, 13, 51])
def test_second_derivative_is_the_average_of_the_plain_one(window):
    path = np.cumsum(np.cumsum(np.random.default_rng(2).normal(size=400)))
    plain = np.zeros_like(path)
    plain[1:-1] = np.diff(path, 2)
    smooth = averaged(plain, ((0, 400),), averaging_kernel(window, 2))
    inside = slice(window, -window)
    np.testing.assert_allclose(smooth[inside], derivatives(path, 1.0, window, 2)[inside])


def test_noise_of_a_quantised_ramp_is_about_the_quantum():
    path = np.round(np.linspace(0, 1, 5000) ** 1.7 / 1e-3) * 1e-3
    assert 1e-4 < measurement_noise(path) < 2e-3


def test_clean_paths_get_the_shortest_window_and_noisy_ones_a_longer():
    t = np.arange(5000) / 1000
    clean = np.sin(3 * t)
    noisy = clean + np.random.default_rng(0).normal(size=t.size) * 1e-5
    assert smoothing_window(clean, 1000.0) == 3
    assert smoothing_window(noisy, 1000.0) > 21


def slow_stroke(noise_rad):
    """Nearly all of it at one speed; ramps of 0.1 s of which a window of 0.2 s leaves nothing."""
    t = np.arange(12_000) / 250.0
    ramps = np.clip(np.minimum(t, t[-1] - t) / 0.1, 0, 1)
    path = 0.05 * np.cumsum(ramps) / 250.0
    return path + np.random.default_rng(3).normal(size=t.size) * noise_rad


def test_a_slow_stroke_gets_a_window_in_which_its_ramps_are_left():
    longest = int(0.2 * 250.0) | 1
    assert smoothing_window(slow_stroke(1e-5), 250.0) < 0.6 * longest
    # Noise that hides the ramps themselves asks for all that is allowed.
    assert smoothing_window(slow_stroke(1e-4), 250.0) == longest


def test_noise_of_a_quantised_path_at_high_rate_is_not_the_rounding_of_the_computer():
    # A hundred samples per step of the encoder: most fourth differences are rounding alone.
    path = np.round(np.linspace(0.3, 0.4, 20_000) / 5e-4) * 5e-4
    assert measurement_noise(path) > 1e-5
    assert measurement_noise(np.linspace(0.3, 0.4, 20_000)) == 0.0


@pytest.mark.parametrize("derivative", [1, 2])
def test_noise_of_what_a_window_takes_twice_is_that_of_noise_put_through_it(derivative):
    noise = np.random.default_rng(4).normal(size=40_000)
    values = derivatives(noise, 100.0, 21, derivative)
    taken = values - averaged(values, ((0, noise.size),), averaging_kernel(21, derivative))
    expected = taken_noise_gain(100.0, 21, derivative)
    np.testing.assert_allclose(np.std(taken[50:-50]), expected, rtol=0.03)


def test_steps_of_a_coarse_temperature_are_bridged():
    true = 25 + 8 * (1 - np.exp(-np.arange(20_000) / 6000))
    logged = np.round(true / 0.5) * 0.5
    assert np.max(np.abs(logged - true)) > 0.24
    # Beyond the last step nobody knows.
    inside = slice(500, np.flatnonzero(np.diff(logged))[-1])
    assert np.max(np.abs(unstepped(logged) - true)[inside]) < 0.05
    noisy = np.random.default_rng(0).normal(size=100)
    assert unstepped(noisy) is noisy


def test_a_motion_that_is_measured_without_fault_has_no_noise():
    # Corners of the acceleration, four in every move, are no noise, and a slow rate has few samples
    # beside them.
    made = simulate(22324, (), rate=100.0, kind="trapezoid")
    assert measurement_noise(made.position) < 1e-8
    assert smoothing_window(made.position, 100.0) == SHORTEST_WINDOW


def test_a_block_is_its_samples_mean_and_a_rest_is_dropped():
    values = np.arange(12.0)
    assert block_mean(values, TWO, 3).tolist() == [1.0, 4.0, 8.0]
    both = block_mean(np.stack([values, -values], axis=1), TWO, 3)
    assert both.tolist() == [[1.0, -1.0], [4.0, -4.0], [8.0, -8.0]]
    assert block_mean(values, TWO, 1) is values


def test_a_moving_average_does_not_reach_into_another_recording():
    values = np.r_[np.zeros(7), np.full(5, 9.0)]
    assert averaged(values, TWO, np.ones(3) / 3) == pytest.approx(values)
    impulse = np.zeros(12)
    impulse[3] = 3.0
    assert averaged(impulse, TWO, np.ones(3) / 3)[:7] == pytest.approx([0, 0, 1, 1, 1, 0, 0])


def test_gaps_are_bridged_by_straight_lines_and_ends_keep_their_value():
    values = np.array([np.nan, 1.0, np.nan, np.inf, 4.0, np.nan])
    np.testing.assert_array_equal(filled(values), [1, 1, 2, 3, 4, 4])
    assert np.isnan(filled(np.full(3, np.nan))).all()


@pytest.mark.parametrize("rate_hz", [100.0, 2000.0])
@pytest.mark.parametrize("first_s", [0.0, 0.15, 0.5, 0.85])
def test_a_gap_in_a_path_is_bridged_without_a_blow(rate_hz, first_s):
    t = np.clip(np.arange(-1, 2.5, 1 / rate_hz), 0, 1)
    path = t**3 * (10 - 15 * t + 6 * t**2)
    first = round((1 + first_s) * rate_hz)
    gap = slice(first, first + round(0.2 * rate_hz))
    lacking = path.copy()
    lacking[gap] = np.nan
    found = bridged_path(lacking, rate_hz)
    known = np.isfinite(lacking)
    np.testing.assert_array_equal(found[known], path[known])
    assert np.abs(found - path).max() < np.abs(filled(lacking) - path).max()
    blow = np.abs(np.diff(found, 2)).max() * rate_hz**2
    assert blow < 3.5 * np.abs(np.diff(path, 2)).max() * rate_hz**2
    assert blow < 0.5 * np.abs(np.diff(filled(lacking), 2)).max() * rate_hz**2


def test_gaps_of_one_sample_and_at_the_ends_are_bridged_too():
    path = np.arange(50.0) ** 2
    lacking = path.copy()
    lacking[[0, 20, 49]] = np.nan
    found = bridged_path(lacking, 100.0)
    assert found[20] == pytest.approx(400.0)
    assert (found[0], found[49]) == (1.0, 48.0**2)
    assert np.isnan(bridged_path(np.full(3, np.nan), 100.0)).all()
