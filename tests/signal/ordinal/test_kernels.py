"""The compiled loops against the definition of the Lehmer code, window by window."""

from math import factorial

import numpy as np
import pytest

from opamc_cli.signal.ordinal.kernels import BLOCK, count_codes, encode


def lehmer(window):
    """Each value's count of smaller later ones, as digits of falling base."""
    code = 0
    for i, value in enumerate(window):
        code = code * (len(window) - i) + sum(value > later for later in window[i + 1 :])
    return code


def windows(x, order, tau):
    return [x[t : t + (order - 1) * tau + 1 : tau] for t in range(x.size - (order - 1) * tau)]


@pytest.mark.parametrize("order", range(2, 8))
@pytest.mark.parametrize("tau", [1, 3])
def test_codes_and_counts_are_the_definition_s(order, tau):
    x = np.random.default_rng(order).integers(0, 5, 90).astype(np.float32)  # many ties
    expected = [lehmer(window) for window in windows(x, order, tau)]
    codes = np.empty(len(expected), dtype=np.int16)
    encode(x, np.zeros(x.size, dtype=bool), order, tau, codes)
    assert codes.tolist() == expected
    counts = count_codes(x, order, tau)
    assert counts.tolist() == np.bincount(expected, minlength=factorial(order)).tolist()


def test_a_window_that_touches_a_missing_sample_has_no_code():
    x = np.random.default_rng(0).standard_normal(40)
    missing = np.zeros(40, dtype=bool)
    missing[[7, 20]] = True
    codes = np.empty(40 - 2 * 3, dtype=np.int16)
    encode(x, missing, 3, 3, codes)
    touched = [window.any() for window in windows(missing, 3, 3)]
    assert (codes == -1).tolist() == touched
    expected = [lehmer(window) for window in windows(x, 3, 3)]
    assert all(c == e for c, e, t in zip(codes, expected, touched, strict=True) if not t)


@pytest.mark.parametrize("order", [5, 6])
@pytest.mark.parametrize("extra", [0, 1, 3, 5])
def test_no_pattern_is_lost_or_counted_twice_between_blocks(order, extra):
    """Order 5 is counted in bytes, 6 in words; blocks of patterns end anywhere."""
    tau = 2
    x = np.random.default_rng(extra).standard_normal(2 * BLOCK + (order - 1) * tau + extra)
    codes = np.empty(2 * BLOCK + extra, dtype=np.int16)
    encode(x, np.zeros(x.size, dtype=bool), order, tau, codes)
    expected = np.bincount(codes, minlength=factorial(order))
    np.testing.assert_array_equal(count_codes(x, order, tau), expected)
