"""The panel's own arithmetic, and its two-mass joint."""

from functools import partial

import numpy as np
import pytest
from panel import run, table, two_mass, two_mass_cases
from panel.case import RIGID, Case, Wanted


def test_a_name_is_right_where_it_or_its_tie_is_and_wrong_where_neither_is():
    row = {"hidden": "stribeck", "present": ("elasticity",)}
    steps = [
        {"name": "sublinear_friction", "ties": ["stribeck"]},
        {"name": "elasticity", "ties": []},
        {"name": "ripple", "ties": ["mains_hum"]},
    ]
    assert run.judged(row, {"added": steps}) == {"named": True, "wrong": ["ripple"]}
    assert run.judged(row, {"added": steps[1:]}) == {"named": False, "wrong": ["ripple"]}
    assert run.judged(row | {"hidden": None}, {"added": steps}) == {}


@pytest.mark.parametrize("effect", ["ripple", "stribeck", "time_delay"])
def test_an_effect_has_the_size_that_was_asked_for(effect):
    errors = []
    for size in (0.0, 5.0):
        made = two_mass.record(effect if size else "", size, 7, "cyclic", 500.0)
        errors.append(two_mass.unexplained(made[1], None) / made[2])
    # What the rigid model leaves of a joint that lacks nothing stays below the noise.
    assert 1.0 < errors[0] < 1.3
    assert np.sqrt(errors[1] ** 2 - errors[0] ** 2) == pytest.approx(5.0, rel=0.35)


def test_rows_are_run_and_what_fails_is_told():
    (case,) = (
        c for c in two_mass_cases.cases(3, Wanted(sizes=(5.0,))) if c.hidden == "quadratic_friction"
    )
    row, late = (next(run.rows([case], ["plain"], limit_s=limit_s)) for limit_s in (60.0, 0.0))
    assert row["results"]["plain"]["named"]
    assert row["results"]["plain"]["after"] < 0.5 * row["results"]["plain"]["before"]
    assert late["results"]["plain"]["error"] == "time limit"
    assert "quadratic_friction" in table.line(row, ["plain"])
    assert "| 1 | 1 |" in table.summary([late], ["plain"])


def _impossible() -> list:
    msg = "no such joint"
    raise ValueError(msg)


def test_a_case_that_cannot_be_made_is_left_out(capsys):
    case = Case("x", "y", "cyclic", "position", RIGID, "", partial(_impossible))
    assert list(run.rows([case], ["plain"])) == []
    assert "no such joint" in capsys.readouterr().out
