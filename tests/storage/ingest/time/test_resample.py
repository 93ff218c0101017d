"""Uneven samples on a grid, compared with a slow rule."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.storage.ingest.time.resample import resample


def resampled_slowly(times, values, grid, period, max_gap, cubic):
    """One grid point after the other, by the rules of the docstring."""
    out = []
    for g in grid:
        i = max(k for k in range(len(times) - 1) if times[k] <= g or k == 0)
        step = times[i + 1] - times[i]
        if g - times[i] <= 1e-3 * period:
            out.append(values[i])
        elif times[i + 1] - g <= 1e-3 * period:
            out.append(values[i + 1])
        elif step > max_gap:
            out.append(np.nan)
        else:
            line = values[i] + (values[i + 1] - values[i]) * (g - times[i]) / step
            four = range(i - 1, i + 3)
            smooth = cubic and i >= 1 and i + 2 < len(times)
            if smooth:
                steps = np.diff([times[k] for k in four])
                smooth = all(0.5 * period <= s <= 1.5 * period for s in steps)
                smooth = smooth and all(np.isfinite(values[k]) for k in four)
            if smooth:
                fit = np.polyfit([times[k] - g for k in four], [values[k] for k in four], 3)
                line = fit[-1]
            out.append(line)
    return np.array(out)


@settings(max_examples=150)
@given(
    steps=st.lists(st.floats(0.05, 4.0), min_size=3, max_size=40),
    cuts=st.lists(st.integers(1, 40), max_size=6),
    cubic=st.booleans(),
    missing=st.sets(st.integers(0, 40), max_size=3),
    seed=st.integers(0, 99),
)
def test_resampling_in_any_blocks_is_the_slow_rule(steps, cuts, cubic, missing, seed):
    times = np.concatenate([[0.0], np.cumsum(steps)])
    values = np.random.default_rng(seed).normal(size=len(times))
    values[[k for k in missing if k < len(values)]] = np.nan
    n = int(times[-1] + 1e-6) + 1
    edges = sorted({0, len(times), *(c for c in cuts if c < len(times))})
    blocks = [(times[a:b], {"x": values[a:b]}) for a, b in pairwise(edges)]
    fast = [block["x"] for block in resample(iter(blocks), 0.0, 1.0, n, 2.5, cubic)]
    slow = resampled_slowly(times, values, np.arange(n), 1.0, 2.5, cubic)
    np.testing.assert_allclose(np.concatenate(fast), slow, atol=1e-9)


def test_cubic_keeps_a_carrier_that_linear_interpolation_damps():
    rng = np.random.default_rng(3)
    times = np.arange(4000) / 2048 + rng.uniform(-0.2, 0.2, 4000) / 2048
    carrier = 2 * np.pi * 200
    grid = times[0] + np.arange(3990) / 2048
    worst = {}
    for cubic in (True, False):
        blocks = iter([(times, {"x": np.cos(carrier * times)})])
        found = [b["x"] for b in resample(blocks, times[0], 2048.0, 3990, 1.0, cubic)]
        worst[cubic] = np.abs(np.concatenate(found) - np.cos(carrier * grid))[5:-5].max()
    assert worst[True] < 0.02
    assert worst[False] > 3 * worst[True]


def test_nothing_is_invented_across_a_gap():
    times = np.r_[np.arange(10.0), 20 + np.arange(10.0)]
    blocks = resample(iter([(times, {"x": times})]), 0.0, 1.0, 30, 2.5)
    values = np.concatenate([block["x"] for block in blocks])
    assert np.isnan(values[10:20]).all()
    np.testing.assert_allclose(values[np.r_[:10, 20:30]], np.r_[:10, 20:30])


def on_grid(times, values, *grid, **options):
    blocks = resample(iter([(times, {"x": values})]), *grid, **options)
    return np.concatenate([block["x"] for block in blocks])


def test_a_sample_next_to_a_grid_point_is_taken_as_it_is():
    times = np.array([0.0, 1.0009, 1.9991, 3.0011, 5.9989, 7.0009, 9.9991, 11.0])
    values = np.array([0.0, 10.0, 20.0, 30.0, 60.0, 70.0, 100.0, 110.0])
    for rate in (1.0, 50.0):
        found = on_grid(times / rate, values, 0.0, rate, 11, 2.5 / rate, cubic=False)
        # beside a gap, too: at 7 and 10, but not at 6, which is a little further off
        assert found[[0, 1, 2, 7, 10]].tolist() == [0, 10, 20, 70, 100]
        assert found[3] == pytest.approx(30, abs=0.02)
        assert found[3] != 30
        assert np.flatnonzero(np.isnan(found)).tolist() == [4, 5, 8, 9]


def test_the_cubic_is_used_between_half_and_one_and_a_half_periods():
    for step, cubic in ((0.51, True), (0.49, False), (1.49, True), (1.51, False)):
        times = 0.05 + np.cumsum([0.0, 1.0, 1.0, 1.0, step, 1.0, 1.0, 1.0])
        found = on_grid(times / 50, times**3, 3.0 / 50, 50.0, 2, 9.0 / 50)
        # the step in question is one of the three between the four nearest samples
        assert np.isclose(found, [27, 64], rtol=1e-9).tolist() == [cubic] * 2
