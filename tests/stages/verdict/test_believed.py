"""What a harmless cause may excuse."""

from dataclasses import dataclass
from types import SimpleNamespace

import pytest

from opamc_cli.config.models import ScoreConfig
from opamc_cli.stages.verdict.verdict import among_siblings, believed, with_cause

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
    p_adjusted: float = 0.6
    effect: float = 0.2


@pytest.mark.parametrize(
    ("axis", "others", "ties", "named"),
    [
        (2, {1: "healthy", 3: "healthy"}, ["spring", "current_scale"], "current_scale"),
        (2, {1: "healthy", 3: "changed"}, ["current_scale"], "payload_change"),
        (2, {1: "healthy", 3: "insufficient-data"}, ["current_scale"], "payload_change"),
        (3, {1: "healthy", 2: "healthy"}, ["current_scale"], "payload_change"),  # the last
        (2, {1: "healthy", 3: "healthy"}, ["spring"], "payload_change"),
    ],
)
def test_a_payload_that_no_joint_further_out_feels_is_another_scale(axis, others, ties, named):
    """Weakened magnets of a shoulder were a harmless payload, each night."""
    judged = {axis: Judged("changed", 0.0)} | {other: Judged(s) for other, s in others.items()}
    cause = PAYLOAD | {"effect": "payload_change", "ties": ties, "why": [], "explained": 0.98}
    found = among_siblings(axis, cause, judged, ScoreConfig())
    assert found["effect"] == named
    state = with_cause(judged[axis], found, ScoreConfig()).state
    assert state == ("changed" if named == "payload_change" else "fault")
    if named == "current_scale":
        assert found["ties"] == ["payload_change", "spring"]
        judged[3] = Judged("healthy", 0.001)  # excused: it differs, too
        assert among_siblings(axis, cause, judged, ScoreConfig()) == cause
