"""Explanations that tie."""

from types import SimpleNamespace

import numpy as np

from opamc_cli.joint.name.search import LEAST_SHARE
from opamc_cli.joint.name.settle import ties_of

ERROR = np.array([1.0, 2.0, 3.0, 2.0])


def other(name, error, why_not=None, score=1.0):
    return SimpleNamespace(
        chain=SimpleNamespace(deviation=error, score=score),
        why_not=why_not,
        term=SimpleNamespace(effect=SimpleNamespace(name=name)),
    )


def ties(*others):
    return ties_of(SimpleNamespace(deviation=ERROR, score=0.0), "coulomb", others)


def test_what_leaves_no_surely_larger_error_ties():
    worse = ERROR + np.array([1.0, 1.1, 0.9, 1.0])
    doubtful = ERROR + np.array([1.0, -0.9, 1.0, -0.5])
    found = ties(
        other("viscous", ERROR),
        other("spring", worse),
        other("stribeck", doubtful),
        other("offset", ERROR - 1.0),
    )
    assert found == ("viscous", "stribeck", "offset")


def test_two_standard_errors_are_the_limit():
    # Steps of 1 and -1 around the mean have a standard error of sqrt(16/3) in sum.
    steps, limit = np.array([1.0, -1.0, 1.0, -1.0]), 2 * np.sqrt(16 / 3) / 4
    near, far = (ERROR + steps + share * limit for share in (0.99, 1.01))
    assert ties(other("viscous", near), other("spring", far)) == ("viscous",)


def test_what_is_worse_for_sure_but_by_no_more_than_anybody_cares_about_ties():
    """A delay's errors go with those of the elasticity that stood for it: 6 % were t = 4."""
    surely = ERROR + np.array([0.1, 0.11, 0.09, 0.1])
    found = ties(
        other("time_delay", surely, score=0.99 * LEAST_SHARE),
        other("spring", surely, score=1.01 * LEAST_SHARE),
    )
    assert found == ("time_delay",)


def test_the_effect_itself_what_may_not_be_added_and_what_was_told_before_are_no_ties():
    assert ties() == ()
    found = ties(
        other("coulomb", ERROR),
        other("ripple", ERROR, "its sign, or its size, is not physical"),
        other("viscous", ERROR),
        other("viscous", ERROR),
    )
    assert found == ("viscous",)
