"""The panel's own arithmetic, and its two-mass joint."""

from functools import partial

import numpy as np
import pytest
from panel import cobot, messy, run, table, two_mass, two_mass_cases
from panel.case import RIGID, Case, Wanted
from sources import servo_joint


def test_a_name_is_right_where_it_or_its_tie_is_and_wrong_where_neither_is():
    row = {"hidden": "stribeck", "right": ["stribeck"], "present": ("elasticity",)}
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


@pytest.mark.parametrize("effect", ["", "spring", "hysteresis", "payload_change"])
def test_an_industrial_drive_comes_back_and_hides_what_was_asked_for(effect):
    size = 5.0 if effect else 0.0
    made = servo_joint.record(8, effect, size, "cyclic", 250.0)
    assert made.size == pytest.approx(size, rel=0.35)
    assert effect not in made.declared
    # The drive follows: it comes back to where it began.
    assert abs(made.position[-1] - made.position[0]) < 0.01 * np.ptp(made.position)
    assert made.current.shape == made.position.shape == made.temperature.shape


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


@pytest.mark.long
def test_messy_joints_move_from_rest_to_rest_without_jumps():
    made = {case.name: case for case in messy.cases(2, Wanted())}
    assert len(made) == messy.JOINTS
    for case in list(made.values())[: len(messy.STROKES)]:
        (logged,) = case.make()
        steps = np.diff(logged.position)
        assert np.abs(np.diff(steps)).max() * logged.rate_hz**2 < 60.0 + 4e-4 * logged.rate_hz**2
        assert np.isfinite(logged.current).all()
        assert logged.current.shape == logged.position.shape


def test_errors_are_summed_where_nobody_knows_a_name():
    results = [{"a": {"after": 1.0}, "b": {"after": 2.0}}, {"a": {"after": 5.0}, "b": {}}]
    rows = [{"source": "messy", "hidden": None, "results": each} for each in results]
    rows.append({"source": "smooth", "hidden": "", "results": results[0]})
    assert table.totals(rows, ["a", "b"]) == (
        "Sealed errors summed over 1 of 2 rows of messy, A: a 1.000, b 2.000."
    )


@pytest.mark.long
def test_a_cobots_recording_is_the_same_each_time_and_holds_what_is_hidden():
    made = {case.name: case for case in cobot.cases(7, Wanted())}
    (pit,), (again,), (none,) = (made[f"{name} 7"].make() for name in ("pit", "pit", "none"))
    assert np.array_equal(pit.current, again.current)
    assert np.array_equal(pit.position, again.position)
    assert np.isfinite(pit.current).all()
    assert pit.current.shape == pit.position.shape
    assert np.ptp(pit.position) > 0.3
    # The drive holds the path, whatever rubs; the current pays for it, at one place.
    assert np.abs(pit.position - none.position).max() < 0.02
    differs = np.abs(pit.current - none.current)
    assert np.median(differs) < 0.05 < 0.2 < differs.max()
