"""What is said of a joint that is far out and yet called healthy."""

import pytest

from opamc_cli.config.models import ScoreConfig
from opamc_cli.stages.verdict.agreement.common import far_together, not_sure


def verdict(*axes):
    entries = [
        {
            **{"axis": axis, "state": "healthy", "health_index": index},
            **{"p_adjusted": p_adjusted, "distance": {"effect": effect}, "cause": None},
        }
        for axis, (index, p_adjusted, effect) in enumerate(axes, 1)
    ]
    return {"axes": entries}


@pytest.mark.parametrize(
    ("p_adjusted", "effect", "said"),
    [
        # as a current's gain that is off by 6 %: to record it again shows the same
        (1e-9, 0.057, "is 5.7%, less than score.minimum_effect (10.0%)"),
        (0.2, 0.057, "does not suffice to call it changed"),
        (1e-9, 0.2, "does not suffice to call it changed"),
        (1e-9, None, "does not suffice to call it changed"),
    ],
)
def test_a_change_that_is_certain_and_small_is_called_small(p_adjusted, effect, said):
    found = far_together(verdict((40.0, p_adjusted, effect), (0.5, 0.8, 0.0)), ScoreConfig())
    assert list(found) == [1]
    assert said in found[1][0]


def test_a_joint_of_which_no_witness_shows_any_effect_is_not_far():
    """Of a hundred files beside a baseline of single ones a healthy robot was not judged."""
    assert far_together(verdict((33.0, 1e-9, 0.0), (20.5, 1e-9, 0.0)), ScoreConfig()) == {}


def test_joints_that_are_far_together_are_no_small_changes():
    found = far_together(verdict((40.0, 1e-9, 0.05), (50.0, 1e-9, 0.05)), ScoreConfig())
    assert list(found) == [1, 2]
    assert all("other joints lie as far" in why for (why,) in found.values())


def test_a_joint_that_is_far_beside_others_that_moved_has_no_sensor_to_check():
    """A palletizer's heavier parts: one of its four joints was to have its sensor looked at."""
    judged = verdict((40.0, 1e-9, 0.05), (9.0, 1e-4, 0.2), (8.0, 1e-4, 0.2), (1.0, 0.5, 0.0))
    for entry in judged["axes"][1:3]:
        entry["excused"] = True
    assert "other joints have moved, too" in far_together(judged, ScoreConfig())[1][0]
    judged["axes"][1]["excused"] = judged["axes"][2]["excused"] = False
    assert "is 5.0%, less than" in far_together(judged, ScoreConfig())[1][0]


def test_joints_that_are_far_beside_one_at_fault_name_it():
    """Beside a cracked joint the others were told that this is no fault of one."""
    shaken = robot(a=("h", 60), b=("f", 9000), c=("f", 9900), d=("h", 1))
    shaken["axes"][1]["cause"] = {"effect": "ripple", "origin": "joint", "explained": 0.7}
    shaken["axes"][1]["distance"]["changed_a"] = 0.1
    (why,) = not_sure(shaken, ScoreConfig(), ())[1]
    assert "a joint at fault, axis 2, may have shaken it" in why
    assert "no fault of one" not in why
    shaken["axes"][1]["cause"] |= {"origin": "load"}
    assert "axis 3, may have" in not_sure(shaken, ScoreConfig(), ())[1][0]
    # one as near as healthy ones shakes nobody, nor does what is no sure fault
    near = robot(a=("h", 60), b=("h", 50), c=("f", 6), d=("h", 1), e=("h", 1))
    assert "no fault of one" in not_sure(near, ScoreConfig(), ())[1][0]
    alone = robot(a=("h", 60), b=("f", 50), c=("h", 70), d=("h", 40), e=("h", 1))
    said = not_sure(alone, ScoreConfig(), ())
    assert sorted(said) == [1, 2, 3, 4]
    assert "no fault of one" in said[1][0]


def test_what_a_log_says_of_the_temperature_is_said_of_what_is_far():
    cold = robot(a=("h", 60), b=("h", 40), c=("h", 1))
    cold["axes"][0]["warmer_c"] = -19.6
    said = not_sure(cold, ScoreConfig(), ())
    assert "from the baseline (logged: 20 °C colder), and other joints" in said[1][0]
    assert "logged" not in said[2][0]
    assert "check temperature, payload" in said[2][0]


def robot(**states):
    """Return a verdict of axes in turn, their states as letters, each with its health index."""
    names = {"h": "healthy", "c": "changed", "f": "fault"}
    axes = [
        {"axis": axis, "state": names[text[0]], "health_index": float(index)}
        | {"p_adjusted": 1e-9, "distance": {"effect": 0.9, "changed_a": 0.01}, "cause": None}
        for axis, (text, index) in enumerate(states.values(), 1)
    ]
    return {"axes": axes}


@pytest.mark.parametrize(
    ("states", "foreign", "unsure"),
    [
        # five of six fit no motion, or have their sign inverted
        ([("f", 900)], {2, 3, 4, 5, 6}, [1]),
        ([("c", 200)], {2, 3, 4, 5, 6}, [1]),
        ([("h", 0.3)], {2, 3, 4, 5, 6}, []),
        # half is not most: a fault that breaks its own motion is one joint of six
        ([("f", 900), ("h", 1), ("h", 1)], {4, 5, 6}, []),
        ([("f", 900)], {2}, []),
        ([("f", 900), ("h", 40), ("h", 2)], {4, 5, 6}, [1, 2]),
        # but beside two of four that look like each other one near its baseline is none for sure
        ([("f", 4), ("h", 1)], {3, 4}, [1]),
        ([("f", 4), ("h", 1), ("h", 1)], {4, 5}, []),
        # four lie as far as one, or less far than it
        (
            [("h", 500), ("h", 30), ("f", 600), ("h", 400), ("h", 900), ("h", 1)],
            (),
            [1, 2, 3, 4, 5],
        ),
        ([("h", 30), ("h", 30), ("f", 600), ("h", 40), ("h", 90), ("h", 1)], (), [1, 2, 4, 5]),
    ],
)
def test_a_joint_that_most_others_leave_alone_is_no_sure_fault(states, foreign, unsure):
    judged = robot(**{str(axis): one for axis, one in enumerate(states, 1)})
    # what `far_together` says of a joint alone is not asked here
    found = not_sure(judged, ScoreConfig(), foreign)
    assert sorted(found) == unsure
    left = [axis for axis in unsure if judged["axes"][axis - 1]["state"] != "healthy"]
    assert all("half of the robot or more, cannot be compared" in found[axis][0] for axis in left)


def test_a_joint_near_its_baseline_is_nothing_to_tell():
    assert far_together(verdict((2.0, 0.3, 0.01)), ScoreConfig()) == {}


@pytest.mark.parametrize(
    ("cause", "unsure"),
    [
        ({}, [1]),
        ({"ties": ["current_scale"]}, []),
        ({"explained": 0.3}, []),
        ({"effect": "thermal_viscous"}, []),
    ],
    ids=["sure", "tied", "beside a fault", "warmth"],
)
def test_joints_that_a_payload_may_have_moved_are_no_sure_faults(cause, unsure):
    """Two kilogrammes were a faulty gear of the axes before and behind the one that told them."""
    payload = {"effect": "payload_change", "harmless": True, "explained": 0.9, "ties": []}
    found = robot(a=("f", 1400), b=("c", 3600), c=("f", 5000), d=("h", 1))
    found["axes"][1]["cause"] = payload | cause
    found["axes"][2]["cause"] = {"effect": "ripple", "origin": "joint", "explained": 0.9}
    said = not_sure(found, ScoreConfig(), ())
    # what lies farther out than the payload's own joint stays a fault
    assert sorted(said) == unsure
    assert all("another payload, told by axis 2," in why for (why,) in said.values())


def loaded(**changed):
    """Of a handler whose part was half as heavy again, carried in two of eight motions."""
    axes = {1: (6.3, 3.3), 2: (41.0, 15.5), 3: (142.0, 48.2), 4: (163.0, 58.2), 5: (1.2, 1.3)}
    judged = verdict(*((index, 1e-6 if ratio > 3 else 0.3, 0.2) for index, ratio in axes.values()))
    for entry in judged["axes"]:
        entry["distance"]["ratio"] = axes[entry["axis"]][1]
    judged["axes"][0]["excused"] = True
    spring = {"effect": "spring", "origin": "joint", "explained": 0.7, "evidence": {}}
    less = {**spring, "effect": "coulomb", "evidence": {"relative_change": -0.23}}
    for entry, cause in zip(judged["axes"][2:4], (spring, less), strict=True):
        entry |= {"state": "fault", "cause": cause}
    judged["axes"][3] |= changed
    return judged


def test_what_a_part_looks_like_is_no_fault_where_most_others_moved():
    found = not_sure(loaded(), ScoreConfig(), ())
    assert sorted(found) == [2, 3, 4]
    assert "axes 1-3 do, too, nearly as far" in found[4][0]
    assert "no fault of one" in found[2][0]


@pytest.mark.parametrize(
    "changed",
    [
        # worn joints of strangers whose siblings had moved
        {"distance": {"ratio": 200.0, "effect": 0.5}},
        {"cause": {"effect": "coulomb", "evidence": {"relative_change": 0.3}}},
        {"cause": {"effect": "position_drag", "evidence": {}}},
        {"cause": {"effect": "ripple", "evidence": {}}},
        {"cause": None},
    ],
)
def test_a_joint_is_at_fault_by_what_no_part_looks_like(changed):
    assert 4 not in not_sure(loaded(**changed), ScoreConfig(), ())


def test_what_befell_one_night_of_a_joint_is_no_part():
    judged = loaded()
    judged["axes"][1]["session"] = "night 2026-03-12"
    judged["axes"][0]["excused"] = False
    judged["axes"][0]["p_adjusted"] = 0.5
    assert 4 not in not_sure(judged, ScoreConfig(), ())
