"""The short-time spectrum against one frame at a time, and at its edges."""

import numpy as np
import pytest

from opamc_cli.signal.transform.short_time import FLOOR_A2, short_time_log_power


@pytest.mark.parametrize("n", [4, 33, 100, 1000, 1001])
@pytest.mark.parametrize(("n_frames", "n_bins"), [(1, 4), (16, 16), (5, 3)])
def test_each_frame_is_the_tapered_periodogram_of_its_samples(n, n_frames, n_bins):
    x = np.random.default_rng(n).normal(size=n)
    result = short_time_log_power(x, n_frames, n_bins)
    frames = len(result)
    assert 1 <= frames <= n_frames
    length = 2 * n // (frames + 1)
    for k, row in enumerate(result):
        start = round(k * (n - length) / max(frames - 1, 1))
        part = x[start : start + length]
        taper = np.hanning(length)
        for b, value in enumerate(row):
            turn = np.exp(-2j * np.pi * (b + 1) * np.arange(length) / length)
            amplitude = 2 * abs(np.sum((part - part.mean()) * taper * turn)) / taper.sum()
            assert value == pytest.approx(np.log(amplitude**2 + FLOOR_A2), abs=1e-4)


def test_a_sine_of_one_ampere_has_a_log_power_of_zero():
    x = np.sin(2 * np.pi * 8 * np.arange(400) / 400)
    assert short_time_log_power(x, 1, 16)[0, 7] == pytest.approx(0.0, abs=1e-4)


def test_gaps_stay_gaps_and_silence_is_finite():
    x = np.ones(1000)
    assert np.isfinite(short_time_log_power(x, 8, 8)).all()
    x[10] = np.nan
    frames = np.isnan(short_time_log_power(x, 8, 8)).all(axis=1)
    assert frames[0]
    assert not frames[2:].any()
    assert short_time_log_power(x[:3], 8, 8).size == 0
