"""Lags against the definition, lag by lag."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from opamc_cli.signal.align import align


def coefficients_by_definition(x, y):
    x, y = x - x.mean(), y - y.mean()
    shorter = min(x.size, y.size)
    found = {}
    for lag in range(-(x.size - 1), y.size):
        i = np.arange(max(0, -lag), min(x.size, y.size - lag))
        power = np.sqrt(np.sum(x[i] ** 2) * np.sum(y[i + lag] ** 2))
        if i.size >= np.ceil(0.5 * shorter) and power > 1e-9 * np.sqrt(np.sum(x**2) * np.sum(y**2)):
            found[lag] = np.sum(x[i] * y[i + lag]) / power
    return found


values = st.integers(-3, 3).map(float)


@settings(max_examples=200, deadline=None)
@given(
    arrays(np.float64, st.integers(1, 30), elements=values),
    arrays(np.float64, st.integers(1, 30), elements=values),
)
def test_equals_the_definition(x, y):
    expected = coefficients_by_definition(x, y)
    found = align(x, y)
    if x.std() == 0 or y.std() == 0:
        assert (found.lag, found.correlation) == (0, 0.0)
    else:
        largest = max(expected.values())
        assert found.correlation == pytest.approx(np.clip(largest, -1, 1), abs=1e-6)
        best = [lag for lag, c in expected.items() if c > largest - 1e-9]
        assert found.lag == min(best, key=lambda lag: (abs(lag), lag))


@pytest.mark.parametrize("lag", [-300, -1, 0, 7, 450])
@pytest.mark.parametrize("extra", [0, 333])
def test_finds_a_known_lag_between_segments_of_different_length(lag, extra):
    rng = np.random.default_rng(abs(lag))
    motion = np.convolve(rng.standard_normal(4000), np.ones(50) / 50, mode="same")
    reference = motion[1000:2500]
    segment = motion[1000 - lag : 2500 - lag + extra] + 0.01 * rng.standard_normal(1500 + extra)
    found = align(reference.astype(np.float32), segment.astype(np.float32))
    assert found.lag == lag
    assert found.correlation > 0.95


def test_a_bound_on_the_lag_is_kept():
    x = np.sin(np.arange(200) / 5) * np.hanning(200)
    y = np.roll(x, 40)
    assert align(x, y).lag == 40
    assert abs(align(x, y, max_lag=10).lag) <= 10
    assert align(x, y, max_lag=0).lag == 0


def test_current_vectors_align_whatever_their_electrical_angle():
    t = np.arange(1000)
    z = np.hanning(1000) * np.exp(1j * (t / 20 + (t / 200) ** 2))
    found = align(z[100:900], z[60:860] * np.exp(1.3j))
    assert found.lag == 40
    assert found.correlation > 0.99


def test_missing_samples_do_not_decide():
    x = np.sin(np.arange(300) / 9) * np.hanning(300)
    y = np.roll(x, 12)
    y[50:60] = np.nan
    assert align(x, y).lag == 12


@pytest.mark.parametrize("n", [0, 1, 2])
def test_nothing_to_compare_is_lag_zero(n):
    assert align(np.zeros(n), np.ones(5)).lag == 0
    assert align(np.ones(5), np.zeros(n)).correlation == 0
