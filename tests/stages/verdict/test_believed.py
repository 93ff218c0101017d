"""What a harmless cause may excuse."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from opamc_cli.config.models import ScoreConfig
from opamc_cli.stages.verdict.decision import Decided
from opamc_cli.stages.verdict.state import (
    among_siblings,
    believed,
    of_friction,
    own_friction,
    with_cause,
)

GREASE = {"effect": "thermal_viscous", "harmless": True, "origin": "environment"}
PAYLOAD = {"effect": "payload_change", "harmless": True, "origin": "load"}
NOISE = {"effect": "sensor_noise", "harmless": False, "origin": "measurement"}
HUM = {"effect": "mains_hum", "harmless": True, "origin": "measurement"}
AT_REST = {"evidence": {"times_at_rest": 3.0}}
CRACK = {"spectrum": 4e-110, "profile": 3e-5, "amplitude": 7e-4}
"""Of a flexspline, on a night 8 degrees warmer."""


@pytest.mark.parametrize(
    ("witnesses", "cause", "kept"),
    [
        ({"profile": 0.001, "spectrum": 0.2}, GREASE, True),
        ({"profile": 1e-10, "amplitude": 1e-10, "spectrum": 1e-12}, GREASE, True),
        ({"profile": 0.009, "spectrum": 0.02}, GREASE, True),
        (CRACK, GREASE, False),
        (CRACK, PAYLOAD, True),
        (CRACK, {"effect": "coulomb", "harmless": False, "origin": "joint"}, True),
        ({"profile": 0.03, "spectrum": 1e-30}, GREASE, False),
        ({"profile": 0.03}, {"effect": "ripple", "harmless": False}, True),
        ({"patterns": 0.001}, GREASE, True),
        ({"profile": 0.03}, None, False),
        ({"profile": 0.03, "spectrum": 1e-30}, NOISE | AT_REST, True),
        ({"profile": 3e-3, "spectrum": 1e-91}, NOISE | AT_REST, True),
        # a line at 50 Hz moves no course; that of phases alone, with no standstill, may be a gear's
        ({"profile": 0.2, "spectrum": 1e-160}, HUM | AT_REST, True),
        ({"profile": 1e-4, "spectrum": 1e-5}, HUM | AT_REST, True),
        ({"profile": 0.2, "spectrum": 1e-160}, HUM, False),
        # more friction beside it
        ({"profile": 1e-8, "spectrum": 1e-12}, NOISE | AT_REST, False),
    ],
)
def test_a_harmless_cause_needs_a_course_that_has_changed(witnesses, cause, kept):
    judgement = SimpleNamespace(witnesses=witnesses)
    assert (believed(judgement, cause, ScoreConfig()) is not None) is kept


@dataclass
class Judged:
    state: str
    health_index: float = 0.6
    p_adjusted: float = 0.6
    effect: float = 0.2
    p_alone: float = 0.6
    p_value: float = 0.6
    method: str = "sessions"


def among(axis, cause, others, warmer_c=None):
    """Return what is named among joints of which each has a health index, or a state."""
    judged = {axis: Judged("changed", 40.0, 0.0)}
    for other, one in others.items():
        judged[other] = Judged(one) if isinstance(one, str) else Judged("healthy", one)
    found = among_siblings(axis, cause, judged, warmer_c or dict.fromkeys(judged))
    return found, with_cause(judged[axis], found, ScoreConfig()).state


@pytest.mark.parametrize(
    ("axis", "others", "ties", "named"),
    [
        (2, {1: 0.1, 3: 0.6}, ["spring", "current_scale"], "current_scale"),
        (2, {1: 0.1, 3: 3.9}, ["current_scale"], "payload_change"),
        (2, {1: 0.1, 3: "changed"}, ["current_scale"], "payload_change"),
        (2, {1: 0.1, 3: "insufficient-data"}, ["current_scale"], "payload_change"),
        (3, {1: 0.1, 2: 0.6}, ["current_scale"], "payload_change"),  # the last may lift it alone
        (3, {1: 0.1}, ["spring"], "payload_change"),
        # a stiff hose
        (4, {3: -0.2, 5: -0.2, 6: 0.8}, ["spring"], "spring"),
        (4, {3: -0.2, 5: -0.2, 6: 2.8}, ["spring"], "payload_change"),
        (6, {4: -0.2, 5: -0.2}, ["spring"], "spring"),
        (2, {1: 0.1, 3: 0.6}, ["offset"], "payload_change"),
    ],
)
def test_a_payload_that_no_other_joint_feels_is_what_looks_like_it(axis, others, ties, named):
    """Weakened magnets of a shoulder were a harmless payload, each night."""
    cause = PAYLOAD | {"ties": ties, "why": [], "explained": 0.98, "evidence": {}}
    found, state = among(axis, cause, others)
    assert found["effect"] == named
    assert state == ("changed" if named == "payload_change" else "fault")
    if named == "payload_change":
        assert found == cause
    else:
        assert found["ties"] == ["payload_change", *(tie for tie in ties if tie != named)]
        assert found["why"][0].startswith("Another payload is unlikely")


@pytest.mark.parametrize(
    ("own", "siblings", "others", "change", "named"),
    [
        # a dead sensor, or one that is not there
        (-26.2, [0.0, 0.0], [0.1, 1.4], 0.3, "viscous"),
        (-26.2, [0.0, None], [0.1, 1.4], 0.3, "viscous"),
        (None, [None, None], [-0.2, 0.6], 0.4, "viscous"),
        # the joint at fault shakes one of three; the hall moves two
        (None, [None, None, None], [0.1, 0.9, 3.5], 0.35, "viscous"),
        (None, [None, None, None], [0.1, 2.2, 3.5], 0.35, "thermal_viscous"),
        # the hall is colder, though it moves one joint alone
        (-9.0, [-8.0, -9.5], [0.1, 1.4], 0.3, "thermal_viscous"),
        (-9.0, [0.0, -9.5], [0.1, 1.4], 0.3, "thermal_viscous"),
        # nobody but the joint itself tells
        (-9.0, [None, None], [0.1, 1.4], 0.3, "thermal_viscous"),
        # the others have moved, too; there is but one other; the joint has run in
        (-26.2, [0.0, 0.0], [0.1, 2.4], 0.3, "thermal_viscous"),
        (None, [None, None], [-0.2, 2.1], 0.4, "thermal_viscous"),
        (None, [None], [-0.2], 0.4, "thermal_viscous"),
        (None, [None, None], [-0.2, 0.6], -0.2, "thermal_viscous"),
        (None, [None, None], [-0.2, 0.6], None, "thermal_viscous"),
    ],
)
def test_a_temperature_that_moves_one_joint_alone_is_its_friction(
    own, siblings, others, change, named
):
    """Worn grease beside a dead sensor was colder by 26 degrees, not a fault."""
    cause = GREASE | {"parameters": {} if own is None else {"warmer_c": own}, "explained": 0.9}
    cause |= {"ties": ["viscous"], "why": []}
    cause |= {"evidence": {} if change is None else {"relative_change": change}}
    warmer_c = {4: own} | dict(enumerate(siblings, 1))
    found, state = among(4, cause, dict(enumerate(others, 1)), warmer_c)
    assert found["effect"] == named
    assert state == ("fault" if named == "viscous" else "changed")
    if named == "viscous":
        assert found["origin"] == "joint"
        assert found["ties"] == ["thermal_viscous"]
        assert f"has grown by {change:.0%}" in found["interpretation"]
        assert ("sensor" in found["interpretation"]) == (own is not None)


@pytest.mark.parametrize(
    ("grown", "more", "state"),
    [
        (0.19, {}, "changed"),
        (0.08, {}, "healthy"),
        (-0.26, {}, "healthy"),
        (None, {}, "healthy"),
        (0.26, {"explained": 0.4}, "healthy"),
        (0.26, {"p_value": 0.004}, "healthy"),  # of three joints
        (0.26, {"effect": "viscous"}, "healthy"),  # a cold hall's
        (0.26, {"effect": "ripple", "p_value": None}, "healthy"),
        (None, {"effect": "position_drag"}, "changed"),
        (None, {"effect": "position_drag", "of_all": 0.02}, "healthy"),  # of phases, which guess
        (0.26, {"effect": "thermal_viscous", "origin": "environment"}, "healthy"),
    ],
)
def test_dry_friction_matters_though_the_distance_is_a_healthy_joint_s(grown, more, state):
    """30 % more of it lay 1.4 times as far as a healthy night: a course is 32 other numbers."""
    evidence = {} if grown is None else {"relative_change": grown}
    cause = {"effect": "coulomb", "origin": "joint", "explained": 0.9, "evidence": evidence}
    cause = cause | {"p_value": 1e-4} | more
    one = Judged("healthy", 1.4, 0.06, more.get("of_all", 0.11), p_value=0.02)
    found = with_cause(one, cause, ScoreConfig(), 3)
    assert found.state == state
    assert found.p_adjusted == pytest.approx(3e-4 if state == "changed" else 0.06)


def test_a_healthy_joint_is_asked_for_a_cause_where_one_of_ten_lies_as_far_out():
    judged = {1: Judged("healthy", p_value=0.09), 2: Judged("healthy", p_value=0.11)}
    judged |= {3: Judged("fault"), 4: Judged("insufficient-data", p_value=float("nan"))}
    assert Decided(None, {}, judged).differing() == [1, 3]


@pytest.mark.parametrize(
    ("friction", "own"),
    [
        ({1: -0.22, 2: 0.15, 3: -0.15}, {2}),  # 40 % more in a warmer hall
        (
            {1: 0.13, 2: 0.23, 3: 0.18, 4: 0.26, 5: -0.13, 6: 0.18},
            {5},
        ),  # a preload lost in the cold
        ({1: 0.68, 2: 0.16, 3: 0.37, 4: 0.16}, {1}),
        ({1: -0.17, 2: -0.19, 3: -0.37, 4: -0.12}, set()),  # warmer alone
        ({1: 0.02, 2: 0.01, 3: 0.0, 4: 0.15, 5: 0.02, 6: -0.04}, set()),  # another tool
        ({1: 0.01, 2: 0.01, 3: 0.0, 4: -0.01, 5: 0.64, 6: 0.0}, set()),  # more payload
        ({1: 0.1, 2: 0.6}, set()),  # of two nobody knows which
    ],
)
def test_friction_that_no_condition_moves_so_is_a_joint_s_own(friction, own):
    assert own_friction(friction, 0.3).keys() == own


def test_a_joint_s_own_friction_is_a_fault_of_it():
    cause = of_friction(0.15, -0.18, 1e-6)
    assert with_cause(Judged("fault", 5.0, 0.0), cause, ScoreConfig()).state == "fault"
    assert "grown by 15%, that of the others has fallen by 18%" in cause["interpretation"]
