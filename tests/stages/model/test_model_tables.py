"""Words of loop.json: the recording that tells explanations apart."""

import pytest

from opamc_cli.errors import UsageError
from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.stages.model.model import close_files
from opamc_cli.stages.model.tables import ADVICE, MEANINGS, separating_experiment


@pytest.mark.parametrize(
    ("name", "tied", "says"),
    [
        ("coulomb", ("stribeck",), "at more speeds, from a fiftieth"),
        ("viscous", ("warmup",), "already warm"),
        ("viscous", ("coulomb",), "at more speeds, from a fiftieth"),
        ("ripple", ("sensor_gain",), "all three phases"),
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


def test_a_function_of_the_measured_acceleration_is_no_response_for_certain():
    # what shakes the joint is in its acceleration, too: a belt's tone was called a response
    said = MEANINGS[unnamed_library()["unnamed_response"].name]
    assert "its answer or its cause; no effect of the library" in said


@pytest.mark.parametrize("name", MEANINGS)
def test_a_meaning_belongs_to_a_function_that_there_is(name):
    assert name in unnamed_library()


@pytest.mark.parametrize("name", ["model.yaml", "model_axis2.yaml"])
def test_a_close_replaces_the_model_of_a_close_alone(tmp_path, name):
    (tmp_path / name).write_text("joint: {}\nclosed:\n  unit: A\n", encoding="utf-8")
    assert name in close_files(tmp_path)
    (tmp_path / name).write_text("joint: {}  # closed: no\n", encoding="utf-8")
    with pytest.raises(UsageError, match="is no model of a close"):
        close_files(tmp_path)
