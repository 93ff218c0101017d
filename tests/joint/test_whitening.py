import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from opamc_cli.joint.whitening import (
    LOOK_BACK,
    NoiseModel,
    autoregression,
    implied_covariance,
    settled,
    whitening_with_gaps,
)


def gappy(rng, size, run, gap):
    valid = np.ones(size, dtype=bool)
    start = 0
    while start < size:
        start += int(rng.integers(1, run))
        length = int(rng.integers(1, gap))
        valid[start : start + length] = False
        start += length
    return valid


def slow_innovation(values, valid, row, first, order, covariance):
    """Difference from the conditional mean of a Gaussian process, in units of the full filter's."""
    past = [k for k in range(max(row - LOOK_BACK, first), row) if valid[k]][-order:]
    everything = toeplitz(covariance)
    among = everything[np.ix_([row - k for k in past], [row - k for k in past])]
    beside = np.array([covariance[row - k] for k in past])
    weights = np.linalg.lstsq(among, beside, rcond=None)[0] if past else np.zeros(0)
    spread = np.sqrt(covariance[0] - weights @ beside)
    return (values[row] - weights @ values[past]) / spread


@pytest.mark.parametrize("pole", [0.5, 0.97])
def test_each_sample_is_predicted_from_the_valid_ones_before_it(pole):
    rng = np.random.default_rng(4)
    values = lfilter([1], [1, -pole], rng.normal(size=4000)) + 0.3 * rng.normal(size=4000)
    valid = gappy(rng, values.size, 40, 30)
    bounds = ((0, 1500), (1500, 4000))
    taps = autoregression(values, valid)
    wanted = valid & (np.arange(valid.size) % 3 == 0)
    whitening = whitening_with_gaps(NoiseModel(taps), valid, bounds, wanted)
    white, rows = whitening(values), whitening.rows
    assert np.count_nonzero(wanted) >= rows.size > 0.7 * np.count_nonzero(wanted)
    covariance = implied_covariance(taps, LOOK_BACK)
    for place in range(0, rows.size, 7):
        row = int(rows[place])
        slow = slow_innovation(
            values, valid, row, 0 if row < 1500 else 1500, taps.size - 1, covariance
        )
        assert white[place] == pytest.approx(slow, rel=1e-6, abs=1e-9)


def test_what_follows_a_gap_is_as_white_as_the_rest():
    rng = np.random.default_rng(5)
    values = lfilter([1], [1, -0.95], rng.normal(size=60_000)) + rng.normal(size=60_000)
    valid = gappy(rng, values.size, 50, 12)
    taps = autoregression(values, valid)
    whitening = whitening_with_gaps(NoiseModel(taps), valid, ((0, values.size),), valid)
    white, rows = whitening(values), whitening.rows
    whole = settled(valid, ((0, values.size),), taps.size - 1)[rows]
    assert 0.2 < np.mean(whole) < 0.9
    assert np.std(white[~whole]) == pytest.approx(np.std(white[whole]), rel=0.03)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.02


def test_implied_covariance_is_that_of_the_process():
    covariance = implied_covariance(np.array([1.0, -0.9]), 30)
    np.testing.assert_allclose(covariance, 0.9 ** np.arange(31) / (1 - 0.81), rtol=1e-9)


def test_without_taps_nothing_changes():
    values = np.random.default_rng(6).normal(size=(50, 2))
    valid = np.arange(50) % 7 != 3
    whitening = whitening_with_gaps(NoiseModel(np.ones(1)), valid, ((0, 50),), valid)
    np.testing.assert_array_equal(whitening(values), values[valid])


def test_averages_over_few_pairs_still_make_a_filter():
    rng = np.random.default_rng(7)
    values = np.sin(0.3 * np.arange(600)) + 0.01 * rng.normal(size=600)
    valid = gappy(rng, values.size, 14, 6)
    taps = autoregression(values, valid)
    covariance = implied_covariance(taps, 40)
    assert np.linalg.eigvalsh(toeplitz(covariance))[0] > 0


@pytest.mark.parametrize("order", ["C", "F"])
def test_columns_are_whitened_one_by_one_whatever_their_layout(order):
    rng = np.random.default_rng(6)
    columns = np.asarray(rng.normal(size=(900, 3)), order=order)
    valid = gappy(rng, 900, 60, 20)
    taps = autoregression(lfilter([1], [1, -0.8], rng.normal(size=900)), valid)
    whitening = whitening_with_gaps(NoiseModel(taps), valid, ((0, 400), (400, 900)), valid)
    full = np.convolve(columns[:, 1], taps)[:900][whitening.rows]
    full[whitening.late] = whitening.filters @ columns[:, 1]
    white = whitening(columns)
    assert white.shape == (whitening.rows.size, 3)
    np.testing.assert_allclose(white[:, 1], full, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(white[:, 1], whitening(columns[:, 1]))
    nothing = whitening_with_gaps(NoiseModel(taps), valid, ((0, 900),), np.zeros(900, dtype=bool))
    assert nothing(columns).shape == (0, 3)
