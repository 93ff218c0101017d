"""What several joints of a robot show alike is said once."""

import math

import pytest

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.stages.nightly.alarms.robot import settle_robot
from opamc_cli.storage.history.rows import EXCUSED

LOST = "insufficient-data"
FAR = "It lies {} of the baseline's own spreads from the baseline; record again."
OUTSIDE = "Check before the gear: another payload."


def joint(axis, *nights, program=""):
    """Return a joint's nights, each as its state, ratio and reason."""
    return [
        {
            "robot": "r1",
            "program": program,
            "axis": axis,
            "night": f"2026-03-{day:02d}",
            "state": state,
            "baseline": "b",
            "harmless": int(state == "changed"),
            "distance": None if ratio is None else math.log(ratio),
            "common": 0.0,
            "effect": 0.2,
            "p_value": None if state == LOST else 1e-9 * axis,
            "temperature_c": None,
            "cause": "payload_change" if state == "changed" else None,
            "reason": reason,
        }
        for day, (state, ratio, reason) in enumerate(nights, start=1)
    ]


CALM = ("healthy", 1.0, "")


def excused(ratio):
    return ("healthy", ratio, EXCUSED)


def told(*joints, remind_after=7):
    series = [row for of in joints for row in of]
    rule = AlarmConfig(remind_after=remind_after)
    events = settle_robot("r1", series, (), (), rule, 0.3, 6).events
    return [(one.time[-2:], one.kind, one.axis, one.text) for one in events]


def test_joints_that_a_payload_moves_are_one_line_with_what_to_do():
    """Six lines on the first night, one more on each on which another could not be judged, and
    what to do about it on the sixth."""
    nights = (
        joint(1, CALM, excused(10.0), (LOST, 12.0, FAR.format(25))),
        joint(2, CALM, excused(4.3), excused(4.0)),
        joint(3, CALM, (LOST, 36.0, FAR.format(88.6)), (LOST, 30.0, FAR.format(73))),
        joint(4, CALM, CALM, CALM),
    )
    again = "opamc nightly rebaseline ROBOT --from 2026-03-02 --why TEXT --cell CELL"
    assert told(*nights) == [
        (
            "02",
            "together",
            None,
            "3 of 4 joints moved together in 2 nights from 2026-03-02 to 2026-03-03, 4 to 30 times "
            "as far as in a healthy session: check payload, tool, temperature and the currents' "
            "scale; axis 2 not told from unusual conditions, axes 1 and 3 not judged: a fault that "
            f"looks alike would not be told; if that is meant to stay: {again}",
        )
    ]
    # once they are as they were nothing is meant to stay
    ((*_, text),) = told(*(joint(n, CALM, excused(5.0), CALM) for n in (1, 2)))
    assert "2 of 2 joints moved together in 2026-03-02" in text
    assert "rebaseline" not in text
    assert [day for day, *_ in told(*nights, remind_after=1)] == ["02", "03"]


@pytest.mark.parametrize(("calm", "since"), [(1, 2), (2, 2), (3, 6)])
def test_what_is_meant_to_stay_began_before_a_night_or_two_without_it(calm, since):
    """One program's command named the night after the calm one, the other's the true one."""
    nights = [CALM, excused(5.0), *[CALM] * calm, excused(5.0)]
    ((*_, text),) = told(*(joint(axis, *nights) for axis in (1, 2)))
    assert f"rebaseline ROBOT --from 2026-03-{since:02d} " in text


@pytest.mark.parametrize("ratio", [None, 2.0])
def test_a_joint_that_was_not_judged_and_has_not_moved_as_far_is_a_line_of_its_own(ratio):
    lost = joint(3, CALM, (LOST, ratio, "no motion"))
    (one, two) = told(joint(1, CALM, excused(4.3)), lost)
    assert {one[1:3], two[1:3]} == {("excused", 1), ("not-judged", 3)}


def test_joints_with_the_same_to_say_share_a_line_whatever_their_numbers():
    rows = [joint(n, CALM, (LOST, None, f"{n}.5% of axis {n} are clipped")) for n in (1, 2, 4)]
    text = "axes 1, 2 and 4: not judged since 2026-03-02: 1.5 to 4.5% of each axis are clipped"
    assert told(*rows) == [("02", "not-judged", axis, text) for axis in (1, 2, 4)]
    other = joint(5, CALM, (LOST, None, "no motion"))
    assert {text for *_, text in told(*rows, other)} == {
        text,
        "axis 5: not judged since 2026-03-02: no motion",
    }
    # of two programs each has its own
    of = [
        joint(axis, CALM, ("changed", 9.0, OUTSIDE), program=program)
        for program in ("P", "Q")
        for axis in (1, 2)
    ]
    assert {text.partition(": ")[0] for *_, text in told(*of)} == {
        "axes 1 and 2 in program P",
        "axes 1 and 2 in program Q",
    }
