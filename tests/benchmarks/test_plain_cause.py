"""The plain rival of the cause's search is no straw man: it names what is large."""

from dataclasses import replace

import numpy as np
import pytest
from cause.change_pairs import joint_pair
from cause.plain_cause import Plain, plain_cause


@pytest.mark.parametrize(
    ("change", "position", "effect"),
    [
        ("coulomb", True, "coulomb"),
        ("payload", False, "payload_change"),
        ("colder", True, "thermal_viscous"),
        ("offset", True, "offset"),
        ("scale", True, "current_scale"),
        ("nothing", True, None),
    ],
)
def test_names_a_coefficient_that_moved(change, position, effect):
    pair = joint_pair(change, 57110, position)
    assert plain_cause(pair.baseline, pair.target, pair.joint).effect == effect


@pytest.mark.parametrize("position", [True, False])
def test_names_a_worn_tooth_by_its_order(position):
    pair = joint_pair("tooth", 57111, position)
    said = plain_cause(pair.baseline, pair.target, pair.joint)
    assert said.effect == "ripple"
    assert "flexspline" in said.text
    assert said.order == pytest.approx(2.0, abs=0.1)


def test_says_nothing_of_joints_that_stand_still():
    pair = joint_pair("coulomb", 57110, True)
    still = [replace(one, position_rad=np.zeros(one.size)) for one in pair.baseline]
    assert plain_cause(still, pair.target, pair.joint) == Plain(None)
