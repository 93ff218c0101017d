import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opamc_cli.signal.align import MIN_OVERLAP, ROUNDING, align


def slow_align(x, y, max_lag):
    """Try every lag with the likelihood that the overlap gains, written out."""
    best = 0.0, 0, 0, 0.0
    for lag in range(-max_lag, max_lag + 1):
        first, last = max(0, -lag), min(len(x), len(y) - lag)
        if last <= first or last - first < MIN_OVERLAP * min(len(x), len(y)):
            continue
        a, b = x[first:last], y[first + lag : last + lag]
        a, b = a - a.mean(), b - b.mean()
        if a @ a > 1e-9 * np.sum((x - x.mean()) ** 2) and b @ b > 1e-9 * np.sum(
            (y - y.mean()) ** 2
        ):
            r = (a @ b) / np.sqrt((a @ a) * (b @ b))
            gain = -(last - first) * np.log(max(1 - r * r, ROUNDING)) if r > 0 else 0.0
            best = max(best, (gain, -abs(lag), -lag, r))
    return -best[2], best[3]


@given(
    seed=st.integers(0, 99),
    n=st.integers(1, 60),
    m=st.integers(1, 60),
    max_lag=st.integers(0, 40),
)
def test_agrees_with_trying_every_lag(seed, n, m, max_lag):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=n), rng.normal(size=m)
    fast = align(x, y, max_lag)
    lag, correlation = slow_align(x, y, max_lag)
    if min(n, m) > 4:  # with two samples every lag correlates by exactly 1 or -1
        assert fast.correlation == pytest.approx(correlation, abs=1e-9)
        assert fast.lag == lag


def test_half_of_a_motion_does_not_fit_better_than_the_whole():
    way = np.arange(100) / 100
    wave = np.abs(np.sin(2 * np.pi * way))  # both halves alike but for their height
    one, other = (wave * np.where(way < 0.5, *heights) for heights in ((0.7, 0.4), (0.65, 0.45)))
    noise = np.random.default_rng(1).normal(0, 0.01, 100)
    assert abs(align(one, other + noise, 50).lag) <= 1


@pytest.mark.parametrize("shift", [-17, -1, 0, 5, 23])
def test_finds_a_known_shift_in_segments_of_different_length(shift):
    rng = np.random.default_rng(3)
    signal = np.cumsum(rng.normal(size=600))
    reference = signal[100:400]
    segment = signal[100 - shift : 430]
    found = align(reference, segment, 50)
    assert found.lag == shift
    assert found.correlation == pytest.approx(1.0)


def test_a_constant_segment_has_no_lag():
    found = align(np.sin(np.arange(50.0)), np.ones(40), 10)
    assert (found.lag, found.correlation) == (0, 0.0)


def test_equal_peaks_take_the_smallest_lag():
    wave = np.tile([1.0, -1.0, 0.0, 0.0], 20)
    assert align(wave, wave, 8).lag == 0
