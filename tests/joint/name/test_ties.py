"""Explanations that tie, and the recording that tells them apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.joint.name.ties import ADVICE, separating_experiment, ties_of

ERROR = np.array([1.0, 2.0, 3.0, 2.0])


def other(name, error, why_not=None):
    return SimpleNamespace(
        chain=SimpleNamespace(deviation=error),
        why_not=why_not,
        term=SimpleNamespace(effect=SimpleNamespace(name=name)),
    )


def ties(*others):
    return ties_of(SimpleNamespace(deviation=ERROR), "coulomb", others)


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


def test_the_effect_itself_what_may_not_be_added_and_what_was_told_before_are_no_ties():
    assert ties() == ()
    found = ties(
        other("coulomb", ERROR),
        other("ripple", ERROR, "its sign, or its size, is not physical"),
        other("viscous", ERROR),
        other("viscous", ERROR),
    )
    assert found == ("viscous",)


@pytest.mark.parametrize(
    ("name", "tied", "says"),
    [
        ("coulomb", ("stribeck",), "at more speeds, from a fiftieth"),
        ("viscous", ("warmup",), "already warm"),
        ("viscous", ("coulomb",), "at more speeds, from a fiftieth"),
        ("ripple", ("sensor_gain",), "all three phase currents"),
        ("ripple", ("mains_hum",), "at another speed"),
        ("elasticity", ("inertia",), "other accelerations"),
        ("spring", ("coulomb", "gravity"), "more of the travel, through every place"),
        # Neither knows the other: no single quantity tells them apart.
        ("spring", ("viscous",), "more of the travel, at more speeds"),
        ("a user's", ("viscous",), "more of the travel, at more speeds"),
    ],
)
def test_an_experiment_belongs_to_what_ties(name, tied, says):
    assert says in separating_experiment(name, tied)


def test_where_nothing_ties_no_experiment_is_asked_for():
    assert separating_experiment("coulomb", ()) is None


@pytest.mark.parametrize(("members", "advice"), ADVICE)
def test_any_two_of_a_group_have_an_advice_of_a_group(members, advice):
    for name in members:
        for tie in members - {name}:
            given = separating_experiment(name, (tie,))
            assert given == next(text for group, text in ADVICE if {name, tie} <= group)
