import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from opamc_cli.joint.noise.whitening import autocovariance, autoregression, settled, whitened


def gappy(rng, size, run, gap):
    valid = np.ones(size, dtype=bool)
    start = 0
    while start < size:
        start += int(rng.integers(1, run))
        length = int(rng.integers(1, gap))
        valid[start : start + length] = False
        start += length
    return valid


def test_autocovariance_is_the_average_over_the_pairs_that_are_there():
    rng = np.random.default_rng(3)
    noise, valid = rng.normal(size=300), gappy(rng, 300, 20, 9)
    covariance, counts = autocovariance(noise, valid, 12)
    for lag in range(13):
        both = valid[: noise.size - lag] & valid[lag:]
        products = (noise[: noise.size - lag] * noise[lag:])[both]
        assert counts[lag] == both.sum()
        assert covariance[lag] == pytest.approx(products.mean(), abs=1e-12)


@pytest.mark.parametrize("pole", [0.5, 0.95])
def test_coloured_noise_with_gaps_becomes_white(pole):
    rng = np.random.default_rng(5)
    values = lfilter([1], [1, -pole], rng.normal(size=60_000)) + 0.5 * rng.normal(size=60_000)
    valid = gappy(rng, values.size, 400, 30)
    bounds = ((0, 20_000), (20_000, 60_000))
    taps = autoregression(values, valid)
    usable = settled(valid, bounds, taps.size - 1)
    white = whitened(values, taps)
    both = usable[1:] & usable[:-1]
    assert abs(np.corrcoef(white[1:][both], white[:-1][both])[0, 1]) < 0.02
    assert abs(np.corrcoef(values[1:][both], values[:-1][both])[0, 1]) > 0.3


def test_settled_samples_have_all_their_predecessors_in_the_same_recording():
    rng = np.random.default_rng(1)
    valid, bounds, past = gappy(rng, 400, 30, 5), ((0, 150), (150, 153), (153, 400)), 4
    found = settled(valid, bounds, past)
    for start, stop in bounds:
        for i in range(start, stop):
            assert found[i] == (i - past >= start and bool(valid[i - past : i + 1].all()))


def test_averages_over_few_pairs_still_make_a_filter_that_does_not_explode():
    rng = np.random.default_rng(7)
    values = np.sin(0.3 * np.arange(600)) + 0.01 * rng.normal(size=600)
    taps = autoregression(values, gappy(rng, values.size, 14, 6))
    # The process that the taps describe has a covariance only if their inverse is stable.
    response = lfilter([1.0], taps, np.eye(1, 4000)[0])
    covariance = np.correlate(response, response, "full")[response.size - 1 :][:40]
    assert np.abs(response[-100:]).max() < np.abs(response).max()
    assert np.linalg.eigvalsh(toeplitz(covariance))[0] > 0


@pytest.mark.parametrize("order", ["C", "F"])
def test_columns_are_whitened_one_by_one_whatever_their_layout(order):
    rng = np.random.default_rng(6)
    columns = np.asarray(rng.normal(size=(900, 3)), order=order)
    taps = np.array([1.0, -0.8, 0.1])
    white = whitened(columns, taps)
    for k in range(3):
        np.testing.assert_allclose(white[:, k], lfilter(taps, [1.0], columns[:, k]), atol=1e-12)
    assert whitened(columns, np.ones(1)) is columns
