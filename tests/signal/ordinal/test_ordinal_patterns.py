"""Ordinal counts against sorting each window, one by one."""

from itertools import pairwise
from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from opamc_cli.signal.ordinal.patterns import (
    n_windows,
    ordinal_codes,
    ordinal_counts,
    pattern_of_code,
    time_delay,
)

THESIS_SERIES = np.array(
    [1.41, 0.85, -0.11, -1.35, 1.77, 0.92, -1.92, 0.23, 1.77, -1.26, -0.79, 1.33, 0.14]
)  # thesis 2.4


def sorted_windows(x, order, tau):
    """The obvious way: a stable sort of each window; None where it holds a NaN."""
    patterns = []
    for t in range(len(x) - (order - 1) * tau):
        window = x[t : t + (order - 1) * tau + 1 : tau]
        if np.isnan(window).any():
            patterns.append(None)
        else:
            patterns.append(tuple(int(i) + 1 for i in np.argsort(window, kind="stable")))
    return patterns


def counts_by_sorting(x, order, tau):
    counts = dict.fromkeys((pattern_of_code(c, order) for c in range(factorial(order))), 0)
    for pattern in sorted_windows(x, order, tau):
        if pattern is not None:
            counts[pattern] += 1
    return counts


awkward_values = st.one_of(
    st.sampled_from([0.0, -0.0, 1.0, 2.0, np.inf, -np.inf]),  # ties and infinities
    st.floats(-2, 2, width=32),
)
with_gaps = st.one_of(awkward_values, st.just(float("nan")))


@st.composite
def series(draw, values):
    dtype = draw(st.sampled_from([np.float32, np.float64]))
    n = draw(st.integers(0, 60))
    return draw(arrays(dtype, n, elements=values))


@settings(max_examples=120)
@given(series(awkward_values), st.integers(1, 9))
def test_counts_equal_sorting(x, tau):
    counts = ordinal_counts(x, range(3, 8), tau)
    for order in range(3, 8):
        expected = counts_by_sorting(x, order, tau)
        found = {pattern_of_code(c, order): int(n) for c, n in enumerate(counts[order]) if n}
        assert found == {p: n for p, n in expected.items() if n}


@settings(max_examples=120)
@given(series(with_gaps), st.integers(1, 6), st.integers(2, 7))
def test_patterns_that_touch_nan_are_left_out(x, tau, order):
    patterns = sorted_windows(x, order, tau)
    codes = ordinal_codes(x, order, tau)
    assert [pattern_of_code(int(c), order) if c >= 0 else None for c in codes] == patterns

    counts = ordinal_counts(x, [order], tau)[order]
    n_masked = n_windows(x.size, order, tau) - counts.sum()
    assert n_masked == sum(p is None for p in patterns)
    assert np.array_equal(counts, np.bincount(codes[codes >= 0], minlength=factorial(order)))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    ("n", "tau"), [(8192 * 3 + 17, 1), (50_001, 7), (9000, 400), (30_000, 3000)]
)
def test_blocks_join_without_seams(n, tau, dtype):
    x = np.random.default_rng(n).standard_normal(n).astype(dtype)
    x[::5] = np.round(x[::5], 1)  # some ties
    counts = ordinal_counts(x, [3, 5, 7], tau)
    for order in (3, 5, 7):
        codes = ordinal_codes(x, order, tau)
        assert np.array_equal(counts[order], np.bincount(codes, minlength=factorial(order)))


def test_counts_do_not_change_their_input_nor_need_contiguous_memory():
    x = np.random.default_rng(1).standard_normal(2001)
    before = x.copy()
    strided = ordinal_counts(x[::2], [4], 3)[4]
    assert np.array_equal(strided, ordinal_counts(x[::2].copy(), [4], 3)[4])
    assert np.array_equal(x, before)


def test_integers_are_accepted():
    x = np.array([3, 1, 2, 2, 5, 0])
    assert np.array_equal(ordinal_counts(x, [3], 1)[3], ordinal_counts(x.astype(float), [3], 1)[3])


def test_a_constant_has_one_pattern_the_time_order():
    counts = ordinal_counts(np.full(50, 2.5, dtype=np.float32), [5], 2)[5]
    assert pattern_of_code(int(np.argmax(counts)), 5) == (1, 2, 3, 4, 5)
    assert counts.max() == counts.sum() == 50 - 4 * 2


@pytest.mark.parametrize("n", range(14))
def test_too_short_gives_zeros(n):
    counts = ordinal_counts(np.arange(n, dtype=float), [3, 7], 2)
    assert counts[3].sum() == max(0, n - 4)
    assert counts[7].sum() == max(0, n - 12)
    assert counts[3].dtype == np.int64


def test_the_thesis_example():
    """Section 2.4: order 5, delay 2, third window; of 13 samples five windows, not three."""
    codes = ordinal_codes(THESIS_SERIES, 5, 2)
    assert codes.size == 5
    assert pattern_of_code(int(codes[2]), 5) == (3, 5, 1, 2, 4)


@pytest.mark.parametrize("order", range(2, 8))
def test_codes_and_patterns_are_one_to_one(order):
    patterns = [pattern_of_code(c, order) for c in range(factorial(order))]
    assert len(set(patterns)) == factorial(order)
    for code, pattern in list(enumerate(patterns))[:: max(1, factorial(order) // 50)]:
        window = np.empty(order)
        for value, position in enumerate(pattern):
            window[position - 1] = value
        assert ordinal_codes(window, order, 1)[0] == code
        assert all(window[a - 1] < window[b - 1] for a, b in pairwise(pattern))


@pytest.mark.parametrize(
    ("f_max_hz", "gamma", "expected"),
    [(68, 1, 8), (157, 1, 3), (314, 1, 2), (68, 2, 15), (157, 2, 7), (314, 2, 3)],
)
def test_time_delay_of_the_thesis_speeds(f_max_hz, gamma, expected):
    """Equation (4-2) itself; the values printed in Table 5-2 do not follow from it."""
    assert time_delay(2048, f_max_hz, 5, gamma) == expected


def test_time_delay_halves_round_up_and_never_reach_zero():
    assert time_delay(100, 10, 5, 1) == 3  # 2.5
    assert time_delay(60, 10, 5, 1) == 2  # 1.5
    assert time_delay(100, 1000, 5, 1) == 1


@pytest.mark.parametrize("f_max_hz", [0.0, -1.0, np.nan, np.inf])
def test_time_delay_refuses_a_carrier_that_is_none(f_max_hz):
    with pytest.raises(ValueError, match="f_max_hz"):
        time_delay(2048, f_max_hz, 5)


def test_out_of_range_arguments_are_refused():
    x = np.zeros(10)
    with pytest.raises(ValueError, match="order"):
        ordinal_counts(x, [8], 1)
    with pytest.raises(ValueError, match="tau"):
        ordinal_counts(x, [3], 0)
    with pytest.raises(ValueError, match="dimension"):
        ordinal_counts(x.reshape(2, 5), [3], 1)
    with pytest.raises(ValueError, match="code"):
        pattern_of_code(6, 3)
