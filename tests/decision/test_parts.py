"""Spread, splice, permutation, Holm: each against what it should be by definition."""

from itertools import product
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.decision.significance.multiplicity import holm
from opamc_cli.decision.significance.permutation import relabelled_p_value, relabellings
from opamc_cli.decision.significance.spread import (
    Spread,
    moderated_spread,
    spliced_p_value,
    spread_among_siblings,
    upper_tail,
)
from opamc_cli.decision.witnesses.patterns import pooled_divergence
from tests.decision.fleet import Fleet, cells


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=7), st.floats(0.001, 0.2))
def test_holm_rejects_what_its_step_down_definition_rejects(p, level):
    adjusted = holm(p)
    order = np.argsort(p, kind="stable")
    rejected = set()
    for place, index in enumerate(order):
        if p[index] * (len(p) - place) > level:
            break
        rejected.add(int(index))
    assert {i for i, a in enumerate(adjusted) if a <= level} == rejected


def test_holm_passes_over_joints_without_a_verdict():
    np.testing.assert_allclose(holm([0.01, np.nan, 0.04]), [0.02, np.nan, 0.04])


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


@settings(deadline=None, max_examples=100)
@given(st.lists(st.floats(-3, 3), min_size=1, max_size=9), st.floats(-5, 5))
def test_a_spliced_p_value_lies_in_its_rank_step(reference, observed):
    p = spliced_p_value(reference, observed, Spread(1.0, 4.0))
    above = sum(value >= observed for value in reference)
    assert above / (len(reference) + 1) <= p <= (above + 1) / (len(reference) + 1)


def test_a_moderated_spread_lies_between_sample_and_prior():
    blended = moderated_spread(4.0, 6.0, Spread(1.0, 3.0))
    assert 1.0 < blended.scale < 2.5
    assert blended.dof == 9.0
    assert moderated_spread(float("nan"), 0.0, Spread(1.0, 3.0)) == Spread(1.0, 3.0)


def test_a_moderated_spread_is_right_in_the_middle_over_many_samples():
    variances = np.random.default_rng(0).normal(0.0, 0.1, size=(4000, 6)).var(axis=1, ddof=1)
    logs = [np.log(moderated_spread(v, 5.0, Spread(1.0, 1e-9)).scale) for v in variances]
    assert np.exp(np.mean(logs)) == pytest.approx(0.1, rel=0.02)


def test_one_odd_sibling_does_not_move_the_spread():
    usual = spread_among_siblings(0.01, [0.01, 0.011, 0.009, 0.012, 0.01], 5)
    odd = spread_among_siblings(0.01, [0.01, 0.011, 0.009, 0.012, 100.0], 5)
    assert odd.scale == pytest.approx(usual.scale, rel=0.1)
    assert spread_among_siblings(0.01, [], 5).dof < usual.dof


def test_more_siblings_draw_a_joint_nearer_to_their_spread():
    own = [spread_among_siblings(0.01, [4.0] * count, 5) for count in (0, 1, 5, 500)]
    scales = [spread.scale for spread in own]
    assert scales == sorted(scales)
    assert [spread.dof for spread in own] == sorted(spread.dof for spread in own)
    # so many siblings leave nothing to what is usual elsewhere, and next to nothing to its own
    assert scales[-1] == pytest.approx(2.0, rel=0.1)


def test_the_tail_widens_with_fewer_degrees_of_freedom():
    assert upper_tail(3.0, Spread(1.0, 3.0)) > 4 * upper_tail(3.0, Spread(1.0, 100.0))
    assert upper_tail(0.0, Spread(1.0, 3.0)) == 0.5


def test_pools_of_relabelled_sessions_are_compared_one_by_one():
    own = cells(Fleet(n_baseline=3, n_target=2), 0)[1]
    labels = relabellings(3, 2)
    together = pooled_divergence(own, labels)
    alone = [pooled_divergence(own, row[np.newaxis])[0] for row in labels]
    np.testing.assert_allclose(together, alone)
