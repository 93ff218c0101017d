"""The cause of a change in the shipped samples: phases alone, axis 3 has a ground flexspline."""

from pathlib import Path

import pytest

from opamc_cli.config.models import JointConfig
from opamc_cli.stages.verdict import cause
from opamc_cli.storage.runs import Run, find_runs
from opamc_cli.storage.sources import RunSource

SAMPLES = Path(__file__).parents[3] / "data" / "samples"
KNOWN = JointConfig(gear_ratio=100, pole_pairs=5)


def sources(side):
    found = []
    for name, path in find_runs([SAMPLES / side]):
        with Run(path, name) as run:
            found.append(RunSource(name, path, "", run.n_samples, run.info))
    return found


def test_a_ground_flexspline_is_a_ripple_near_its_passage():
    found = cause.explain(3, sources("normal"), sources("fault"), KNOWN)
    assert found["effect"] == "ripple"
    assert found["parameters"]["order"] == pytest.approx(2.02)
    assert "inspect the flexspline" in found["interpretation"]
    assert found["share"] > 0.6
    assert found["p_value"] < 1e-4
    assert not found["harmless"]
    # Measured at 2.02 and not put there: the line of the healthy gear lies at 2.
    assert found["evidence"]["measured_order"] == pytest.approx(2.018, abs=0.006)
    # The longest stroke is 2.2 rad, 35 turns of the motor; less of it carries a current. Order 2 is
    # not excluded.
    assert found["evidence"]["order_resolution"] > 1 / 35
    assert found["evidence"]["order_resolution"] > found["evidence"]["measured_order"] - 2
    assert any("kinematic error" in tie for tie in found["ties"])
    said = " ".join(found["why"])
    assert "8 sessions against 3" in said
    assert "cannot tell it from" in said


def test_without_the_joint_s_constants_the_order_is_electrical_and_read_with_a_condition():
    found = cause.explain(3, sources("normal"), sources("fault"), JointConfig())
    assert found["effect"] == "ripple"
    assert found["parameters"]["order"] == pytest.approx(0.404, abs=0.002)
    assert "if it has 5 pole pairs" in found["interpretation"]


@pytest.mark.parametrize("axis", [1, 2])
def test_joints_that_nothing_happened_to_have_no_cause(axis):
    assert cause.explain(axis, sources("normal"), sources("fault"), KNOWN) is None


@pytest.mark.parametrize("axis", [1, 2, 3])
def test_healthy_sessions_against_healthy_ones_have_no_cause(axis):
    normal = sources("normal")
    assert cause.explain(axis, normal[::2], normal[1::2], KNOWN) is None
