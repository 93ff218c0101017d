"""Products over ranges, against a sum over samples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.signal.transform.products import NARROW, products_over

WIDTHS = st.sampled_from([0, 1, 2, 3, 5, NARROW, NARROW + 1])


def by_samples(ranges, left, right):
    every = left[:, :, None] * right[:, None, :]
    sums = [every[start:stop].sum(axis=0) for start, stop in ranges]
    return np.array(sums).reshape(len(ranges), left.shape[1], right.shape[1])


def laid(values, kind):
    """Each signal contiguous, each sample, or a part of longer signals."""
    if kind == "samples":
        return np.ascontiguousarray(values)
    longer = np.concatenate([values, np.full((3, values.shape[1]), np.nan)])
    return np.asfortranarray(longer)[: len(values)] if kind == "part" else np.asfortranarray(values)


@settings(max_examples=60)
@given(st.integers(0, 9999), WIDTHS, WIDTHS, *[st.sampled_from(["signals", "samples", "part"])] * 2)
def test_products_are_sums_over_the_samples_of_a_range(seed, k, m, first, second):
    rng = np.random.default_rng(seed)
    left, right = (rng.normal(size=(60, width)) * 10.0 ** rng.integers(-6, 7) for width in (k, m))
    edges = np.sort(rng.integers(0, 61, (4, 2)), axis=1)
    ranges = np.concatenate([edges, [[0, 60], [7, 7], [8, 9]]])
    found = products_over(ranges, laid(left, first), laid(right, second))
    size = np.abs(left).max(initial=0) * np.abs(right).max(initial=0)
    assert found == pytest.approx(by_samples(ranges, left, right), rel=1e-12, abs=1e-13 * size)


def test_of_no_range_there_are_no_products():
    none = np.zeros((0, 2), dtype=np.int64)
    assert products_over(none, np.ones((5, 2)), np.ones((5, 3))).shape == (0, 2, 3)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_seen_in_its_own_products_alone(value):
    left = np.ones((6, 3))
    left[4, 2] = value
    left = np.asfortranarray(left)
    found = products_over(np.array([[0, 3], [3, 6]]), left, left)
    assert np.isfinite(found[0]).all()
    assert np.isfinite(found[1, :2, :2]).all()
    assert not np.isfinite(found[1, 2]).any()
