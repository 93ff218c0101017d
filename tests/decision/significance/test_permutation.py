"""Labellings of sessions and what they say of the observed one."""

from itertools import product
from math import comb

import numpy as np
import pytest

from opamc_cli.decision.significance.permutation import relabelled_p_value, relabellings
from opamc_cli.decision.significance.spread import moderated_spread, spliced_p_value


@pytest.mark.parametrize(("n_baseline", "n_target"), list(product([1, 2, 3, 4], [1, 2, 3])))
def test_every_labelling_occurs_once_with_the_observed_first(n_baseline, n_target):
    rows = relabellings(n_baseline, n_target)
    n = n_baseline + n_target
    expected = comb(n, n_target) // (2 if n_baseline == n_target else 1)
    assert len(np.unique(rows, axis=0)) == len(rows) == expected
    assert rows[0].tolist() == [False] * n_baseline + [True] * n_target
    assert (rows.sum(axis=1) == n_target).all()


def test_too_many_labellings_are_drawn_by_seed():
    first, again, other = (relabellings(15, 10, 200, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    assert (first.sum(axis=1) == 10).all()
    assert len(first) <= 200


def test_a_p_value_in_the_middle_of_the_labellings_is_their_share():
    values = np.array([5.0, 1, 2, 3, 4, 6, 7, 8, 9, 10])
    assert 0.5 <= relabelled_p_value(values, 6) <= 0.6


def test_a_p_value_beyond_the_labellings_falls_on_continuously():
    rng = np.random.default_rng(0)
    others = np.exp(rng.normal(size=99))
    top = others.max()
    p = [relabelled_p_value(np.array([top * f, *others]), 10) for f in (1.0001, 2.0, 5.0, 50.0)]
    assert p[0] == pytest.approx(0.01, rel=0.02)
    assert (np.diff(p) < 0).all()
    assert p[-1] > 0


def test_a_p_value_is_the_splice_of_the_others_logs():
    values = np.array([3.0, 1.0, 2.0, 0.5, 4.0])
    logs = np.log(values[1:])
    spread = moderated_spread(float(logs.var(ddof=1)), 4 - 1)
    expected = spliced_p_value(logs - logs.mean(), float(np.log(3.0) - logs.mean()), spread)
    assert relabelled_p_value(values, 7) == pytest.approx(expected, rel=1e-12)
    # one other labelling has no scatter
    assert relabelled_p_value(values[:2], 7) == 1.0
    assert relabelled_p_value(np.array([1.0, 1.0, 1.0]), 3) > 1 / 3


def test_two_labellings_that_happen_to_agree_are_not_sure_of_their_scatter():
    """Two healthy sessions against two, all alike: one in a hundred may have a p of a hundredth."""
    rng = np.random.default_rng(11)
    p = [relabelled_p_value(np.exp(rng.normal(0.0, 0.3, 3)), 4) for _ in range(2000)]
    # 20 are expected; 35 by chance once in a thousand
    assert np.sum(np.array(p) <= 0.01) <= 34


def test_as_many_labellings_as_are_allowed_are_all_of_them():
    assert len(relabellings(5, 2, limit=21)) == 21
    drawn = relabellings(5, 2, limit=20)
    assert len(drawn) <= 20
    assert (drawn[1:] != drawn[0]).any(axis=1).all()
