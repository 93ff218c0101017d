"""Spread, tail and splice, each against what it should be by definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import digamma
from scipy.stats import norm
from scipy.stats import t as student_t

from opamc_cli.decision.significance.spread import (
    Spread,
    moderated_spread,
    spliced_p_value,
    spread_among_siblings,
    tail_of_influences,
    upper_tail,
)


@settings(max_examples=100)
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


def test_one_odd_sibling_takes_the_siblings_word_and_does_not_move_the_spread_its_own_way():
    usual, odd, alone = (
        spread_among_siblings(0.01, siblings, 5, Spread(0.3, 8.0))
        for siblings in ([0.01, 0.011, 0.009, 0.012], [0.01, 0.011, 0.009, 0.012, 100.0], [])
    )
    assert usual.scale < odd.scale < alone.scale
    assert alone.dof < odd.dof < usual.dof


def test_siblings_are_worth_no_more_than_they_are_alike():
    """Six joints whose spreads differ tenfold, three sessions each, as at a twentieth of speed."""
    rng = np.random.default_rng(0)
    unlike = rng.permuted(np.tile([0.1, 0.1, 0.1, 0.3, 1.0, 1.0], (2000, 1)), axis=1)
    for true, least, most in ((np.full_like(unlike, 0.3), 8, 10), (unlike, 0, 1)):
        variances = (true[..., np.newaxis] * rng.normal(size=(*true.shape, 3))).var(axis=2, ddof=1)
        found = [spread_among_siblings(v[0], v[1:], 2, Spread(0.6, 4.0)) for v in variances]
        assert least < np.median([one.dof for one in found]) - 2 - 4 <= most


def test_more_siblings_draw_a_joint_nearer_to_their_spread():
    own = [
        spread_among_siblings(0.01, [4.0] * count, 5, Spread(0.3, 8.0)) for count in (0, 1, 5, 500)
    ]
    scales = [spread.scale for spread in own]
    assert scales == sorted(scales)
    assert [spread.dof for spread in own] == sorted(spread.dof for spread in own)
    # so many siblings leave nothing to what is usual elsewhere, and next to nothing to its own
    assert scales[-1] == pytest.approx(2.0, rel=0.1)


def test_the_tail_widens_with_fewer_degrees_of_freedom():
    assert upper_tail(3.0, Spread(1.0, 3.0)) > 4 * upper_tail(3.0, Spread(1.0, 100.0))
    assert upper_tail(0.0, Spread(1.0, 3.0)) == 0.5


def test_a_spread_among_siblings_is_the_mean_of_log_variances_by_their_freedom():
    """Its own, what the siblings' median says, and what is expected."""

    def unbiased(variance, dof):
        return np.log(variance) - (digamma(dof / 2) - np.log(dof / 2))

    freedom = np.array([2.0, 2.0 * 3, 8.0])
    logs = np.array([unbiased(0.02, 2.0), unbiased(0.03, 2.0), 2 * np.log(0.5)])
    found = spread_among_siblings(0.02, [0.01, 0.04, np.nan, 0.03], 2, Spread(0.5, 8.0))
    assert found.scale == pytest.approx(np.exp((freedom @ logs) / freedom.sum() / 2))
    assert found.dof == pytest.approx(freedom.sum())


def test_the_tail_is_student_s():
    for distance, scale, dof in ((0.3, 1.0, 3.0), (2.0, 0.5, 7.5), (-1.0, 2.0, 40.0)):
        expected = student_t.sf(distance / scale, dof)
        assert upper_tail(distance, Spread(scale, dof)) == pytest.approx(expected, rel=1e-12)


def test_a_splice_shares_its_step_as_the_tail_does():
    spread = Spread(0.8, 5.0)
    reference = [-1.0, 0.2, 1.5, 0.9]
    tails = {value: student_t.sf(value / 0.8, 5.0) for value in (*reference, 0.5, 3.0, -2.0)}
    # two of four are larger; the step between them and the next is shared out
    share = (tails[0.5] - tails[0.9]) / (tails[0.2] - tails[0.9])
    assert spliced_p_value(reference, 0.5, spread) == pytest.approx((2 + share) / 5)
    assert spliced_p_value(reference, 3.0, spread) == pytest.approx(tails[3.0] / tails[1.5] / 5)
    share = (tails[-2.0] - tails[-1.0]) / (1 - tails[-1.0])
    assert spliced_p_value(reference, -2.0, spread) == pytest.approx((4 + share) / 5)
    # a rank that is known beforehand, at a value that no reference has
    assert spliced_p_value(reference, 0.5, spread, n_above=0) == pytest.approx(
        min(tails[0.5] / tails[1.5], 1) / 5
    )


def test_a_splice_shares_steps_below_the_mean_by_their_own_spread():
    spread, narrow = Spread(1.0, 3.0), Spread(0.5, np.inf)
    reference = [-0.4, 0.2, 0.9]
    tails = {value: norm.sf(value / 0.5) for value in (-0.4, -0.1, -0.6)}
    share = (tails[-0.6] - tails[-0.4]) / (1 - tails[-0.4])
    assert spliced_p_value(reference, -0.6, spread, below=narrow) == pytest.approx((3 + share) / 4)
    upper = student_t.sf(0.2, 3.0)
    share = (tails[-0.1] - upper) / (tails[-0.4] - upper)
    assert spliced_p_value(reference, -0.1, spread, below=narrow) == pytest.approx((2 + share) / 4)
    for far in (0.5, 2.0):
        both = (spliced_p_value(reference, far, spread, below=one) for one in (narrow, None))
        assert next(both) == next(both)


def test_the_tail_of_influences_is_that_of_their_ratio_of_squares():
    for ratio, dof in ((0.3, 2), (9.0, 4), (400.0, 6)):
        # of one influence: of a Student t whose square it is
        expected = 2 * student_t.sf(np.sqrt(ratio), dof)
        assert tail_of_influences(np.log(ratio), 1, dof) == pytest.approx(expected)
    assert tail_of_influences(np.inf, 1, 3) < 1e-60
    rng = np.random.default_rng(3)
    target = (rng.normal(size=(200_000, 3)) ** 2).mean(axis=1)
    healthy = (rng.normal(size=(200_000, 12)) ** 2).mean(axis=1)
    assert tail_of_influences(np.log(4.0), 3, 12) == pytest.approx(
        np.mean(target / healthy > 4), rel=0.03
    )
