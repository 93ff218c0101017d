"""What a maintainer is told first."""

from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.decision.judge import Bundle
from opamc_cli.decision.witnesses.amplitudes import AmplitudeCell, AmplitudeEvidence
from opamc_cli.decision.witnesses.spectra import SpectrumCell, SpectrumEvidence
from opamc_cli.stages.nightly.workers.judge import _axis
from opamc_cli.stages.report.wording import verdict as verdict_words
from opamc_cli.stages.verdict.agreement.unjudged import with_reasons
from opamc_cli.stages.verdict.wording.brief import _inspect, _tie, brief, foremost, shaken_by
from opamc_cli.storage.sources import other_conditions


@pytest.mark.parametrize(
    ("size", "loudest", "first"),
    [(0.3, "spectrum", "filters"), (0.7, "spectrum", "gear"), (3.0, "spectrum", "gear"),
     (0.3, "patterns", "gear"), ([0.1, 3, 3, 1, 1, 1, 1, 1], "spectrum", "gear")],
)  # fmt: skip
def test_a_current_that_became_smooth_is_no_worn_gear(size, loudest, first):
    """One frequency that is less, as where a damaged tooth moved a resonance, is no filter."""
    rng = np.random.default_rng(0)
    sessions = 0.02 * rng.normal(size=(6, 8))
    sessions[5] += 2 * np.log(size)  # log powers
    cell = SpectrumCell(0, sessions, np.ones(6), np.full(8, 1e-3), 2, 4, 3.0)
    bundle = Bundle([], {"spectrum": SpectrumEvidence([cell], 5)})
    p_values = {"patterns": 0.01, "spectrum": 0.01} | {loudest: 1e-5}
    judged = SimpleNamespace(
        state="fault", witnesses=p_values, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = brief(judged, bundle, None)["inspect"]
    assert f"{first}" in told.split(":")[0]
    assert ("filters" in told) == (first == "filters")


@pytest.mark.parametrize(("state", "first"), [("fault", "Inspect"), ("changed", "Record again")])
def test_what_nothing_explains_is_recorded_again_before_a_gear_is_opened(state, first):
    """A tool put back 1 cm off had the gear inspected."""
    judged = SimpleNamespace(
        state=state, witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = brief(judged, Bundle([], {}), None, in_vain=True)
    assert told["inspect"].startswith(first)
    assert "inspect the gear: backlash" in told["inspect"].lower()
    assert ("repeat" in told["against"]) == (state == "fault")


@pytest.mark.parametrize(
    ("explained", "harmless", "first"),
    [
        (0.09, True, "Inspect the gear"),
        (0.9, True, "Check before"),
        # with a ripple beside it, a cracked flexspline was warmer grease, not a fault
        (0.51, False, "Inspect the gear"),
    ],
)
def test_a_harmless_cause_of_a_small_part_sends_nobody_away_from_the_gear(
    explained, harmless, first
):
    """A backlash of which colder grease held 9 % was first of all said to be colder grease."""
    cause = {"effect": "viscous", "interpretation": "colder grease", "harmless": harmless}
    cause |= {"origin": "environment"}
    judged = SimpleNamespace(
        state="fault", witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = brief(judged, Bundle([], {}), cause | {"explained": explained})
    assert told["inspect"].startswith(first)
    assert "colder grease" in told["inspect"]


@pytest.mark.parametrize(
    ("origin", "first"), [(None, "Record again"), ("load", "Record again"), ("joint", "Inspect")]
)
def test_of_declared_conditions_that_differ_a_cause_in_the_joint_alone_comes_first(origin, first):
    """A healthy joint with three times the payload was to be opened."""
    runs = [
        SimpleNamespace(info=SimpleNamespace(payload_kg=kg, speed_percent=speed))
        for kg, speed in ((1.0, 100.0), (3.0, 100.0), (1.0, None))
    ]
    unlike = other_conditions(runs[:1], runs[1:])
    assert unlike == "the target's payload is 3 kg, the baseline's 1 kg"
    assert other_conditions(runs[::2], runs[1:2]) == unlike
    assert other_conditions(runs[:2], runs) == ""
    judged = SimpleNamespace(
        state="fault", witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    cause = {"effect": "x", "interpretation": "y", "origin": origin, "harmless": False}
    cause |= {"explained": 0.9}
    told = brief(judged, Bundle([], {}), cause if origin else None, unlike=unlike)["inspect"]
    assert told.startswith(first)
    assert (unlike in told) == (first == "Record again")


def test_a_sensor_s_noise_beside_friction_is_told():
    cause = {"effect": "viscous", "interpretation": "friction", "origin": "joint"}
    cause |= {"harmless": False, "share": 0.9, "others": [{"effect": "sensor_noise"}]}
    judged = SimpleNamespace(
        state="fault", witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = brief(judged, Bundle([], {}), cause)
    assert told["inspect"] == "Inspect the joint for friction."
    assert "at standstill, too: check its sensor" in told["against"]


def test_a_sensor_s_noise_sends_nobody_to_the_gear():
    cause = {"effect": "sensor_noise", "interpretation": "noise: check the sensor"}
    cause |= {"origin": "measurement", "harmless": False, "share": 0.9, "explained": 0.9}
    judged = SimpleNamespace(
        state="fault", witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = brief(judged, Bundle([], {}), cause)
    assert told["inspect"] == "Check before the gear: noise: check the sensor."
    assert "at standstill, too" in told["against"]
    entry = {"axis": 1, "state": "fault", "cause": cause}
    assert verdict_words.inspection(entry) == "Check the sensor; do that before opening the gear."
    assert _axis(entry, None).cause == "sensor_noise"
    # the same of an effect of the library that explains as little of a fault stands beside it
    assert _axis(entry | {"cause": cause | {"effect": "mains_hum"}}, None).cause is None


def test_a_late_current_sends_to_the_logger_first_and_to_the_gear_for_what_is_left():
    late = "the current comes 40 ms later than in the baseline: look at the logger"
    cause = {"effect": "current_lag", "interpretation": late, "origin": "measurement"}
    cause |= {"harmless": False, "share": 0.9, "explained": 0.9, "others": []}
    judged = SimpleNamespace(
        state="fault", witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = brief(judged, Bundle([], {}), cause)
    assert told["inspect"] == f"Check before the gear: {late}."
    assert "moved in time as a whole (90% of the change)." in told["against"]
    entry = {"axis": 1, "state": "fault", "cause": cause}
    assert verdict_words.inspection(entry) == "Look at the logger; do that before opening the gear."
    assert _axis(entry, None).cause == "current_lag"
    cause["others"] = [{"effect": "ripple", "interpretation": "a tooth", "share": 0.08}]
    assert brief(judged, Bundle([], {}), cause)["against"].endswith("Besides: a tooth.")


def test_that_a_cause_was_sought_in_vain_is_said():
    judged = SimpleNamespace(
        state="fault", witnesses={}, effects={}, n_baseline_sessions=5, common_log_ratio=0.0
    )
    told = [brief(judged, Bundle([], {}), None, in_vain=sought)["against"] for sought in (1, 0)]
    assert ["No effect of the library" in one for one in told] == [True, False]


@pytest.mark.parametrize(
    ("common", "ratio", "first"),
    [
        (0.0, 9.0, "The recordings"),
        (1.0, 9.0, "The other joints moved too, 2.7 times"),
        # a joint at fault shakes the others: 20 000 times as far as a healthy session is no hall's
        (1.0, 2e4, "The recordings"),
    ],
)
def test_what_a_cause_cannot_be_told_from_is_said_beside_all_else(common, ratio, first):
    """Order 2.003 was tooth damage to whoever read the terminal alone."""
    judged = SimpleNamespace(
        **{"state": "fault", "witnesses": {}, "effects": {}, "n_baseline_sessions": 5},
        **{"common_log_ratio": common, "distance_ratio": ratio},
    )
    cause = {"effect": "ripple", "interpretation": "a tooth", "origin": "joint", "share": 0.9}
    told = brief(judged, Bundle([], {}), cause | {"ties": ["kinematic_error", "x"]})["against"]
    assert told.startswith(first)
    assert told.endswith("The recordings cannot tell it from: kinematic error.")
    proven = cause | {"ties": ["ripple"], "evidence": {"times_in_the_sum": 9.0}, "others": []}
    assert "tell it from" not in brief(judged, Bundle([], {}), proven)["against"]


CRACK = {"effect": "ripple", "origin": "joint", "explained": 0.65}
LITTLE = CRACK | {"explained": 0.41}
LOAD = {"effect": "payload_change", "origin": "load", "harmless": True, "explained": 0.9}
GAIN = {"effect": "sensor_gain", "origin": "measurement", "explained": 1.0}


@pytest.mark.parametrize(
    ("joints", "first"),
    [
        # whose current changed most, though a wrist that it shakes lies forty times as far
        ([("fault", 1.5e5, 0.067, CRACK), ("fault", 6.2e6, 0.041, CRACK)], 1),
        ([("changed", 223.0, 0.032, None), ("fault", 4680.0, 0.008, CRACK)], 1),
        # but not beside one that lies a hundred times as far
        ([("changed", 267.0, 0.023, None), ("fault", 1.28e5, 0.011, None)], 2),
        # a load shakes nobody, nor is one healthy that is not called so; a drive's sensor does
        ([("changed", 90.0, 0.2, LOAD), ("fault", 60.0, 0.1, None)], 2),
        ([("changed", 90.0, 0.2, GAIN), ("fault", 60.0, 0.1, None)], 1),
        ([("fault", 60.0, 0.1, None), ("healthy", 900.0, 0.3, None)], 1),
        # where that is not known of all, the farthest
        ([("fault", 60.0, None, None), ("fault", 90.0, None, None)], 2),
        ([("fault", 60.0, 0.1, None), ("fault", 90.0, None, None)], 2),
        ([("healthy", 0.1, 0.1, None)], None),
    ],
)
def test_the_joint_to_look_at_first_is_the_one_whose_current_changed_most(joints, first):
    axes = [
        {"axis": axis, "state": state, "health_index": index, "cause": cause}
        | {"distance": {"changed_a": changed}}
        for axis, (state, index, changed, cause) in enumerate(joints, 1)
    ]
    assert (foremost(axes) or {}).get("axis") == first


@pytest.mark.parametrize(
    ("causes", "left", "told"),
    [
        ((None, CRACK, None), (), {3: 1}),
        ((CRACK, LITTLE, None), (), {2: 1, 3: 1}),
        ((None, None, CRACK), (), {2: 1}),
        # another payload shakes nobody, nor does what is no sure fault
        ((LOAD, None, None), (), {3: 2}),
        ((CRACK, CRACK, None), (1,), {3: 2}),
    ],
)
def test_a_joint_without_a_cause_beside_one_at_fault_may_be_shaken_by_it(causes, left, told):
    """Sound neighbours of a cracked joint were to be opened, or the hall was too warm."""
    axes = [
        {"axis": axis, "state": "fault", "health_index": 90.0 / axis, "cause": cause}
        | {"brief": {"inspect": "the gear", "evidence": [], "against": "the hall"}}
        for axis, cause in enumerate(causes, 1)
    ]
    axes[0]["state"] = "changed" if causes[0] is LOAD else "fault"
    found = with_reasons({"axes": axes}, dict.fromkeys(left, ("another log",)))["axes"]
    against = {one["axis"]: one["brief"]["against"] for one in found if one["brief"]}
    for axis, said in against.items():
        by = f" Axis {told.get(axis)}, which is at fault, may shake it: see to that one first."
        assert said == "the hall" + by * (axis in told)


@pytest.mark.parametrize(("cause", "shaken"), [(CRACK, True), (LOAD, False)])
def test_an_excused_joint_beside_one_at_fault_may_be_shaken_by_it(cause, shaken):
    """It was only to be recorded again in other weather."""
    axes = [
        {"axis": 1, "state": "healthy", "excused": True, "reasons": ["It differs.", "Compared."]},
        {"axis": 2, "state": "fault", "health_index": 90.0, "cause": cause},
    ]
    first, *others = with_reasons({"axes": axes}, {})["axes"][0]["reasons"]
    said = "It differs. Axis 2, which is at fault, may shake it: see to that one first."
    assert (first, others) == (said if shaken else "It differs.", ["Compared."])


@pytest.mark.parametrize(
    ("origin", "index", "shakes"),
    [("measurement", 4e5, 1), ("measurement", 4e3, 1), ("load", 4e5, None)],
)
def test_a_drive_s_own_sensor_shakes_the_joint_and_others(origin, index, shakes):
    """The neighbour of a joint whose phase was measured 12 % too large was to be seen to first."""
    axes = [
        {"axis": 1, "state": "fault", "health_index": index, "cause": GAIN | {"origin": origin}},
        {"axis": 2, "state": "fault", "health_index": 2e3, "cause": None},
    ]
    assert (shaken_by(axes) or {}).get("axis") == shakes


@pytest.mark.parametrize(("ratio", "first"), [(1.01, "spectrum"), (1.2, "amplitude")])
def test_a_size_of_1_01_times_is_said_last(ratio, first):
    sessions = np.zeros((6, 8))
    sessions[:5] += 1e-3 * np.random.default_rng(0).normal(size=(5, 8))
    sessions[5] = np.log(ratio)
    of_all = (sessions, np.ones(6), np.full(8, 1e-6))
    cells = {
        "amplitude": AmplitudeEvidence([AmplitudeCell(0, *(one[..., :3] for one in of_all))], 5),
        "spectrum": SpectrumEvidence([SpectrumCell(0, *of_all, 2, 4, 3.0)], 5),
    }
    judged = SimpleNamespace(
        **{"state": "fault", "effects": {}, "n_baseline_sessions": 5, "common_log_ratio": 0.0},
        witnesses={"amplitude": 1e-60, "spectrum": 1e-9},
    )
    told = brief(judged, Bundle([], cells), None)["evidence"]
    sizes = [n for n, text in enumerate(told) if "times the baseline's" in text]
    assert sizes == ([0] if first == "amplitude" else [1])


def test_what_a_cause_is_not_told_from_is_said_in_words():
    """It was `sublinear_friction`, in the engineer's mail."""
    assert _tie({"ties": ["sublinear_friction", "coulomb"]}).endswith(
        "from: shear-thinning or starved lubricant."
    )


@pytest.mark.parametrize(
    ("share", "told"),
    [(0.0, "hardly any of the change: a tooth"), (0.3, "part of the change is a")],
)
def test_a_cause_that_holds_next_to_nothing_is_no_part_of_the_change(share, told):
    cause = CRACK | {"interpretation": "a tooth", "explained": 0.3, "share": share}
    assert told in _inspect(cause, SimpleNamespace(), Bundle([], {}), "")
