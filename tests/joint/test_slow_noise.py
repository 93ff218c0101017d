"""A slow noise under a fast one is found, and taken out of what it predicts."""

import numpy as np
import pytest
from scipy.linalg import solve_triangular
from scipy.signal import lfilter

from opamc_cli.joint.slow_noise import noise_model
from opamc_cli.joint.tracking import SlowPart, Tracking
from opamc_cli.joint.whitening import NoiseModel, autoregression, whitening_with_gaps

PERIOD, CYCLES = 3000, 6


def drawn(rng, size, time, share):
    pole = np.exp(-1 / time)
    slow = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.normal(size=size + 5000))[5000:]
    return np.sqrt(share) * slow + np.sqrt(1 - share) * rng.normal(size=size)


def differences(noise):
    size = noise.size - PERIOD
    halved = np.zeros(noise.size)
    halved[:size] = (noise[:size] - noise[PERIOD:]) / np.sqrt(2)
    valid = np.arange(noise.size) < size
    return halved, valid, [slice(k, k + PERIOD) for k in range(0, size, PERIOD)]


def level_power(model, noise):
    """Power of the whitened noise's averages over 300 samples, as a multiple of white noise's."""
    valid = np.arange(noise.size) % 500 > 20
    white = whitening_with_gaps(model, valid, ((0, noise.size),), valid)(noise)
    means = white[: white.size // 300 * 300].reshape(-1, 300).mean(axis=1)
    return 300 * float(np.mean(means**2)) / float(np.mean(white**2))


@pytest.mark.parametrize(("time", "share"), [(150, 0.1), (100, 0.3)])
def test_slow_noise_that_an_autoregression_misses_is_whitened(time, share):
    rng = np.random.default_rng(1)
    noise = drawn(rng, PERIOD * CYCLES, time, share)
    place = 2 * np.pi * np.arange(noise.size) / PERIOD
    columns = np.stack([np.sin(place), np.cos(place), np.sign(np.sin(place))], axis=1)
    halved, valid, pairs = differences(noise)
    model = noise_model(halved, valid, pairs, columns)
    fresh = drawn(rng, 40 * PERIOD, time, share)
    assert model.slow is not None
    assert 0.6 < level_power(model, fresh) < 1.7
    assert level_power(NoiseModel(autoregression(halved, valid)), fresh) > 2.0


def test_a_payload_that_changes_is_no_slow_noise():
    rng = np.random.default_rng(2)
    noise = 0.3 * rng.normal(size=PERIOD * CYCLES)
    place = 2 * np.pi * np.arange(noise.size) / PERIOD
    columns = np.stack([np.sin(place), np.cos(place)], axis=1)
    noise += np.where(np.arange(noise.size) > 2.4 * PERIOD, 0.3 * np.sin(place + 0.5), 0.0)
    model = noise_model(*differences(noise), columns)
    assert level_power(model, rng.normal(size=40 * PERIOD)) == pytest.approx(1.0, abs=0.2)


def test_tracking_predicts_as_the_whole_covariance_does():
    rng = np.random.default_rng(3)
    rows = np.flatnonzero(rng.random(160) < 0.6)
    response = rng.uniform(0.2, 1.5, rows.size)
    slow = SlowPart(0.95, 0.8)
    steps = np.diff(rows, prepend=rows[0])
    distance = np.abs(rows[:, None] - rows[None, :])
    covariance = np.eye(rows.size)
    covariance += slow.power * slow.pole**distance * np.outer(response, response)
    values = rng.normal(size=(rows.size, 2))
    expected = solve_triangular(np.linalg.cholesky(covariance), values, lower=True)
    taken = np.array(values, order="F")
    Tracking.of(slow, steps, response).take_out(taken)
    np.testing.assert_allclose(taken, expected, rtol=1e-9, atol=1e-9)
