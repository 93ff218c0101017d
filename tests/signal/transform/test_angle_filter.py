"""The Kalman smoother of an angle."""

import numpy as np
import pytest

from opamc_cli.signal.transform.angle_filter import (
    NOISE_SHARE,
    acceleration_noise,
    clean_bandwidth,
    smoothed_angle,
    smoothing_kernel,
    widest_bandwidth,
)


def test_noise_of_the_acceleration_is_that_of_a_smoothed_white_angle():
    rate, size = 1000.0, 200_000
    angle = 0.01 * np.random.default_rng(2).normal(size=size)
    every, none = np.ones(size, dtype=bool), np.zeros(size, dtype=bool)
    for bandwidth in (10.0, 30.0):
        _, _, acceleration = smoothed_angle(angle, every, np.zeros(size), none, rate, bandwidth)
        found = float(np.std(acceleration[2000:-2000]))
        assert found == pytest.approx(acceleration_noise(0.01, rate, bandwidth), rel=0.05)


def test_the_bandwidth_is_the_widest_that_is_clean():
    rate, noise = 1000.0, 0.01
    assert widest_bandwidth(rate) == 30.0
    assert widest_bandwidth(200.0) == 10.0
    at_widest = acceleration_noise(noise, rate, 30.0) / NOISE_SHARE
    assert clean_bandwidth(noise, at_widest * 1.001, rate) == 30.0
    assert clean_bandwidth(noise, 0.0, rate) == 6.0
    assert clean_bandwidth(noise, 0.0, 100.0) == 5.0
    slower = clean_bandwidth(noise, at_widest / 4, rate)
    assert 6.0 < slower < 30.0
    assert acceleration_noise(noise, rate, slower) == pytest.approx(NOISE_SHARE * at_widest / 4)


def test_the_smoother_is_a_moving_average_by_its_kernel():
    rate, bandwidth = 500.0, 12.0
    kernel = smoothing_kernel(rate, bandwidth)
    assert kernel.size % 2 == 1
    assert kernel.sum() == pytest.approx(1.0)
    at = np.exp(-2j * np.pi * bandwidth / rate * (np.arange(kernel.size) - kernel.size // 2))
    assert abs(kernel @ at) == pytest.approx(0.5, abs=0.01)
    path = 0.1 * np.random.default_rng(1).normal(size=3000)
    every, none = np.ones(path.size, dtype=bool), np.zeros(path.size, dtype=bool)
    angle, speed, _ = smoothed_angle(path, every, 0 * path, none, rate, bandwidth, turn_rad=0.0)
    inside = slice(kernel.size, -kernel.size)
    rest = (angle - np.convolve(path, kernel, "same"))[inside]
    assert np.std(rest) < 0.02 * np.std(angle[inside])
    rest = (np.gradient(angle) * rate - speed)[inside]
    assert np.std(rest) < 0.02 * np.std(speed[inside])


def test_gaps_are_passed_with_the_acceleration_that_was_known():
    rate = 1000.0
    t = np.arange(2000) / rate
    path = 3 + 20 * t + 15 * t**2
    strong = np.abs(t - 1) > 0.02
    measured = np.where(strong, path, 99.0)
    none = np.zeros(t.size, dtype=bool)
    angle, speed, _ = smoothed_angle(measured, strong, 20 + 30 * t, strong, rate, 20.0)
    gap = ~strong
    turns = np.round((angle - path)[gap] / np.pi) * np.pi
    assert np.abs(angle[gap] - path[gap] - turns).max() < 0.02
    assert np.abs(speed - 20 - 30 * t)[gap].max() < 0.5
    # Where the angle may have changed by any amount, what comes after does not bind what was.
    jumped = measured + np.where(t > 1, 1.0, 0.0)
    free = none.copy()
    free[1000] = True
    angle, *_ = smoothed_angle(
        jumped, strong, 20 + 30 * t, strong, rate, 20.0, free=free, turn_rad=0.0
    )
    step = np.median((angle - path)[t > 1.1]) - np.median((angle - path)[t < 0.9])
    assert step == pytest.approx(1.0, abs=0.01)
