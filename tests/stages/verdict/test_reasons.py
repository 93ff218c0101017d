"""What a maintainer is told of a joint, where that is not the terminal's to test."""

import math
from dataclasses import replace

import pytest

from opamc_cli.config.models import ScoreConfig
from opamc_cli.decision.judge import Bundle, judge
from opamc_cli.stages.verdict.decision import Decided
from opamc_cli.stages.verdict.wording.reasons import reasons
from tests.decision import known_fleet
from tests.decision.fleet import Fleet, cells


def test_a_joint_that_unusual_conditions_excuse_is_told_so():
    """Never for a fault, which lies far along by itself."""
    own = cells(Fleet(n_axes=1), 0)[1]
    judged = judge({1: Bundle(own)})[1]
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in own
    ]
    said = {}
    for state, unusual in (("healthy", 0.2), ("healthy", 2.0), ("fault", 2.0)):
        one = replace(judged, state=state, unusual_log_ratio=unusual)
        text = " ".join(reasons(one, Bundle(own), entries, {"baseline": [], "target": []}))
        said[state, unusual] = "Conditions were unusual" in text
        sides = {"baseline": [], "target": []}
        sought = " ".join(reasons(one, Bundle(own), entries, sides, in_vain=True))
        assert ("A cause was sought: no effect" in sought) == (state == "fault")
        assert "A cause was sought" not in text
    assert said == {("healthy", 0.2): False, ("healthy", 2.0): True, ("fault", 2.0): False}


@pytest.mark.parametrize(
    ("state", "p_alone", "allowed", "said"),
    [("healthy", 0.2, 1.0, True), ("healthy", 1e-4, 1.0, False), ("fault", 0.2, 1.0, False),
     ("healthy", 0.2, 0.03, False)],  # 1 times as far
)  # fmt: skip
def test_a_joint_that_the_weather_of_its_siblings_excuses_is_told_so(state, p_alone, allowed, said):
    bundle = known_fleet.bundle(4, 6, 1, (), 0.0)
    judged = judge({4: bundle})[4]
    one = replace(
        judged, state=state, p_adjusted=1e-3, p_alone=p_alone, common_log_ratio=0.1,
        allowed_log_ratio=allowed,
    )  # fmt: skip
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in bundle.cells
    ]
    text = " ".join(reasons(one, bundle, entries, {"baseline": [], "target": []}))
    assert ("may lie 2.7 times as far out" in text) is said
    assert ("as far out, and is not called changed" in text) is said


@pytest.mark.parametrize(
    ("cause", "siblings", "common", "said"),
    [
        ({}, 2, 0.0, True),
        ({}, 1, 0.0, False),  # of one nothing in common is known
        ({}, 5, 1.0, False),
        ({"parameters": {"warmer_c": 9.0}}, 2, 0.0, False),
        ({"origin": "load"}, 2, 0.0, False),
    ],
)
def test_warmth_of_one_joint_alone_is_said(cause, siblings, common, said):
    own = cells(Fleet(n_axes=1), 0)[1]
    one = replace(judge({1: Bundle(own)})[1], state="changed", common_log_ratio=common)
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in own
    ]
    grease = {"effect": "thermal_viscous", "origin": "environment", "harmless": True} | cause
    sides = {"baseline": [], "target": []}
    text = " ".join(reasons(one, Bundle(own), entries, sides, grease, siblings=siblings))
    assert ("warms or cools this joint alone" in text) is said


def test_a_witness_that_could_not_be_heard_is_said():
    own = cells(Fleet(n_axes=1), 0)[1]
    whole = judge({1: Bundle(own)})[1]
    part = replace(whole, witnesses={**whole.witnesses, "spectrum": math.nan})
    unknown = replace(part, p_value=math.nan)
    notes = Decided(None, {}, {1: whole, 2: part, 3: unknown}).notes()
    assert len(notes) == 1
    assert notes[0].startswith("axis 2: judged without its spectrum:")


def test_what_one_baseline_session_cannot_tell_is_said():
    bundle = known_fleet.bundle(4, 1, 1, (), 0.0)
    judged = judge({4: bundle})[4]
    (said,) = reasons(judged, bundle, [], {"baseline": [], "target": []})
    assert said.startswith("Its current differs by 30% from 1 baseline session")
    assert "neither healthy nor changed" in said


def test_what_one_baseline_session_would_have_missed_is_said():
    judged = known_fleet.judged("one session")
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in known_fleet.bundle(1, 1, 1, (), 0.0).cells
    ]
    said = {}
    for axis in (1, 2):
        bundle = known_fleet.bundle(axis, 1, 1, (), 0.0)
        text = " ".join(reasons(judged[axis], bundle, entries, {"baseline": [], "target": []}))
        least = f"{judged[axis].least_effect:.0%}"
        said[axis] = f"changed by less than {least} would not have been called changed" in text
    assert said == {1: True, 2: False}


def test_that_one_baseline_session_is_blind_to_faults_is_a_line_of_its_own():
    judged = known_fleet.judged("one session")
    one = replace(judged[1], state="healthy", least_effect=0.91)
    axes = {1: one, 2: replace(one, state="fault"), 3: replace(one, least_effect=0.35), 4: one,
            5: replace(one, least_effect=0.2), 6: replace(one, least_effect=math.nan)}  # fmt: skip
    (said,) = Decided(None, {}, axes).blind(ScoreConfig())
    assert said.startswith("axes 1, 3, 4: with one baseline session patterns that changed by less ")
    assert "than 35% to 91% would not have been called changed, and 30% is a fault" in said
    assert Decided(None, {}, axes).blind(ScoreConfig(fault_effect=0.95)) == []


@pytest.mark.parametrize(
    ("effect", "said"), [(0.0, "size most clearly"), (0.4, "size by 40% (root mean square), most")]
)
def test_no_share_is_told_of_a_current_that_changed_at_one_place_alone(effect, said):
    """Changed by 0 %, where they are down to 14 %: absurd."""
    bundles = {axis: known_fleet.bundle(axis, 6, 1, (), 0.0) for axis in (1, 2, 3, 4)}
    one = judge(bundles)[3]
    one = replace(one, effects={**one.effects, "spectrum": effect, "profile": effect})
    entries = [
        {
            **{"motion": cell.motion, "order": cell.order, "tau": cell.tau},
            **{"jsd_baseline": [0.02], "jsd_target": [0.03]},
        }
        for cell in bundles[3].cells
    ]
    text = " ".join(reasons(one, bundles[3], entries, {"baseline": [], "target": []}))
    assert f"Fluctuations of the current changed in {said}" in text
    assert "by 0%" not in text
