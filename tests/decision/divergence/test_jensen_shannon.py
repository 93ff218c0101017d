"""Divergences against scipy, against simulation, and at the edges."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.distance import jensenshannon

from opamc_cli.decision.divergence.jensen_shannon import (
    chance_divergence,
    chance_inflation,
    divergence_by_cell,
    divergences_from_pool,
    effect_size,
    jensen_shannon,
    leave_cycle_out_divergences,
)

counts = arrays(np.int64, 24, elements=st.integers(0, 50)).filter(lambda c: c.sum() > 0)


@settings(max_examples=200)
@given(counts, counts, st.sampled_from([2.0, math.e, 10.0]))
def test_jensen_shannon_is_scipys_distance_squared(p, q, base):
    ours = jensen_shannon(p, q, base)
    assert ours == pytest.approx(jensenshannon(p, q, base) ** 2, abs=1e-12)
    assert ours == jensen_shannon(q, p, base)
    assert 0.0 <= ours <= math.log(2) / math.log(base) + 1e-15


def test_equal_rows_give_exactly_zero_and_disjoint_ones_exactly_one():
    row = np.array([3, 0, 7, 1])
    assert jensen_shannon(row, 5 * row) == 0.0
    assert jensen_shannon([1, 2, 0, 0], [0, 0, 4, 4]) == pytest.approx(1.0, abs=1e-15)


def test_a_row_without_counts_is_nan_not_zero():
    with np.errstate(all="raise"):
        assert np.isnan(jensen_shannon([0, 0], [1, 2]))
        assert np.isnan(jensen_shannon([1, 2], [0, 0]))


def test_rows_are_worked_out_independently():
    rng = np.random.default_rng(0)
    p, q = rng.integers(0, 9, (7, 120)), rng.integers(0, 9, 120)
    together = jensen_shannon(p, q)
    assert together.shape == (7,)
    np.testing.assert_array_equal(together, [jensen_shannon(row, q) for row in p])
    np.testing.assert_allclose(divergence_by_cell(p, q).sum(axis=1), together)
    assert (divergence_by_cell(p, q) >= 0).all()


def test_tiny_differences_are_not_lost_to_rounding():
    p = np.array([0.25 + 1e-9, 0.25 - 1e-9, 0.25, 0.25])
    q = np.full(4, 0.25)
    # second order: (1/8)·Σ(p-q)²/m, in nats
    assert jensen_shannon(p, q, math.e) == pytest.approx(2 * 1e-18 / (8 * 0.25), rel=1e-6)


def test_the_pool_leaves_out_the_whole_cycle_of_a_segment():
    rows = np.array([[5, 1, 0], [4, 2, 1], [1, 1, 9], [2, 0, 7]])
    cycles = np.array([0, 0, 1, 2])
    expected = [
        jensen_shannon(rows[0], rows[2] + rows[3]),
        jensen_shannon(rows[1], rows[2] + rows[3]),
        jensen_shannon(rows[2], rows[0] + rows[1] + rows[3]),
        jensen_shannon(rows[3], rows[0] + rows[1] + rows[2]),
    ]
    np.testing.assert_allclose(leave_cycle_out_divergences(rows, cycles), expected)


def test_a_single_cycle_has_no_pool():
    assert np.isnan(leave_cycle_out_divergences([[1, 2], [2, 1]], [4, 4])).all()


def test_target_segments_meet_the_whole_pool():
    pool, target = np.array([[5, 1], [3, 3]]), np.array([[1, 8], [2, 2]])
    np.testing.assert_allclose(divergences_from_pool(target, pool), jensen_shannon(target, [8, 4]))


@pytest.mark.parametrize("n", [30, 130, 500, 5000])
@pytest.mark.parametrize("even", [True, False])
def test_chance_term_agrees_with_simulation(n, even):
    rng = np.random.default_rng(1)
    pmf = np.full(120, 1 / 120) if even else rng.dirichlet(np.full(120, 0.5))
    drawn = jensen_shannon(rng.multinomial(n, pmf, 400), rng.multinomial(4 * n, pmf, 400))
    assert chance_divergence(pmf, n, 4 * n) == pytest.approx(drawn.mean(), rel=0.1)


def test_the_chance_term_is_in_the_unit_of_its_base():
    pmf = np.full(24, 1 / 24)
    bits, nats = (chance_divergence(pmf, 100, 400, base) for base in (2.0, math.e))
    assert bits * math.log(2) == pytest.approx(nats, rel=1e-12)


def test_excess_is_fair_to_targets_of_another_length():
    # Patterns that come in runs of eight, as overlapping windows do: eight times fewer are
    # independent. A target four times shorter than the baseline must not look changed.
    rng = np.random.default_rng(2)
    pmf = rng.dirichlet(np.full(24, 3.0))
    baseline = 8 * rng.multinomial(400, pmf, 400)
    short = 8 * rng.multinomial(100, pmf, 400)
    cycles = np.arange(400)
    jsd = leave_cycle_out_divergences(baseline, cycles)
    pool = baseline.sum(axis=0)
    phi = chance_inflation(jsd, pool, 3200, pool.sum() - 3200)
    assert phi == pytest.approx(8.0, rel=0.1)
    raw = divergences_from_pool(short, baseline)
    assert raw.mean() > 3 * jsd.mean()
    excess = raw - chance_divergence(pool, 800 / phi, pool.sum() / phi)
    assert abs(excess.mean()) < 0.06 * raw.mean()


@pytest.mark.parametrize("n_segments", [2, 20, 60])
@pytest.mark.parametrize("repeats", [1, 7, 300])
def test_the_inflation_makes_chance_the_mean_that_was_seen(n_segments, repeats):
    rng = np.random.default_rng([n_segments, repeats])
    for concentration in (0.05, 0.5, 3.0):
        pmf = rng.dirichlet(np.full(24, concentration))
        sizes = 1 + rng.integers(20, 400, n_segments) // repeats
        rows = repeats * np.array([rng.multinomial(n, pmf) for n in sizes])
        pool, n = rows.sum(axis=0), rows.sum(axis=1)
        seen = jensen_shannon(rows, pool - rows)
        phi = chance_inflation(seen, pool, n, pool.sum() - n)
        chance = chance_divergence(pool, n / phi, (pool.sum() - n) / phi)
        # sizes that differ little are one another's stand-in
        within = 1e-5 if n_segments <= 32 else 0.02
        assert phi == 1e-3 or phi == n.max() or chance.mean() == pytest.approx(seen.mean(), within)


def test_the_inflation_ends_where_no_number_of_patterns_does():
    pool, n, rest = np.full(24, 100.0), np.full(5, 240.0), np.full(5, 960.0)
    assert chance_inflation(np.zeros(5), pool, n, rest) == 1e-3
    assert chance_inflation(np.full(5, 1e-9), pool, n, rest) == 1e-3
    assert chance_inflation(np.ones(5), pool, n, rest) == 240.0
    assert np.isnan(chance_inflation(np.full(5, np.nan), pool, n, rest))
    assert np.isnan(chance_inflation(np.ones(5), pool, n, np.zeros(5)))


def test_effect_size_is_the_relative_change_of_probabilities():
    q = np.full(100, 0.01)
    p = q * (1 + 0.1 * np.where(np.arange(100) % 2, 1, -1))
    assert effect_size(jensen_shannon(p, q)) == pytest.approx(0.1, rel=0.02)
    assert effect_size(-0.5) == 0.0
