"""What is said of a joint's nights, from the nights alone."""

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.stages.nightly.alarms import settle_robot


def said(*states):
    """Return what is said of a joint whose nights had these states."""
    series = [
        {
            "robot": "r1",
            "program": "",
            "axis": 2,
            "night": f"2026-03-{day:02d}",
            "state": state,
            "baseline": "b",
            "harmless": 0,
            "distance": 0.0,
            "common": 0.0,
            "effect": 0.0,
            "cause": None,
            "reason": "no motion",
        }
        for day, state in enumerate(states, start=1)
    ]
    return [one.text for one in settle_robot("r1", series, (), (), AlarmConfig(), 0.4, 6).events]


def test_a_joint_that_was_judged_again_is_not_said_to_be_unjudged_since():
    lost, judged = "insufficient-data", "healthy"
    assert said(judged, lost, lost) == ["axis 2: not judged since 2026-03-02: no motion"]
    assert said(lost, judged) == ["axis 2: not judged 2026-03-01: no motion"]
    assert said(lost, lost, judged, lost) == [
        "axis 2: not judged from 2026-03-01 to 2026-03-02: no motion",
        "axis 2: not judged since 2026-03-04: no motion",
    ]
