"""What a harmless cause may excuse."""

from types import SimpleNamespace

import pytest

from opamc_cli.config.models import ScoreConfig
from opamc_cli.stages.verdict.verdict import believed

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
