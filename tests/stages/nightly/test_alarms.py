"""What is said of a joint's nights, from the nights alone."""

import json
from pathlib import Path

import numpy as np
import pytest

from opamc_cli.config.cell import AlarmConfig
from opamc_cli.errors import NotEnoughDataError
from opamc_cli.stages.nightly.alarms.not_judged import NO_AXIS, do_first
from opamc_cli.stages.nightly.alarms.robot import settle_robot
from opamc_cli.stages.nightly.alarms.trend import trend_phrase
from opamc_cli.stages.nightly.morning import as_told, tell
from opamc_cli.stages.nightly.start.outcome import CellOutcome
from opamc_cli.stages.nightly.summary import JointSummary, RobotSummary, Summary
from opamc_cli.stages.verdict.agreement.unjudged import refuse_all
from opamc_cli.storage.history.rows import EXCUSED, AlarmRow, Declared, Event, NightRow


def nights_of(states, distances=None):
    """Return a joint's nights with these states."""
    return [
        {
            "robot": "r1",
            "program": "",
            "axis": 2,
            "night": f"2026-03-{day:02d}",
            "state": state,
            "baseline": "b",
            "harmless": 0,
            "distance": 0.0 if distances is None else distances[day - 1],
            "common": 0.0,
            "effect": 0.0,
            "p_value": 0.5,
            "temperature_c": None,
            "cause": None,
            "reason": "no motion" if state == "insufficient-data" else "",
        }
        for day, state in enumerate(states, start=1)
    ]


def said(*states):
    """Return what is said of a joint whose nights had these states."""
    series = nights_of(states)
    return [one.text for one in settle_robot("r1", series, (), (), AlarmConfig(), 0.4, 6).events]


def test_a_joint_that_was_judged_again_is_not_said_to_be_unjudged_since():
    lost, judged = "insufficient-data", "healthy"
    assert said(judged, lost, lost) == [
        "axis 2: not judged since 2026-03-02 (2 nights in a row): no motion"
    ]
    assert said(lost, judged) == ["axis 2: not judged 2026-03-01: no motion"]
    (told,) = said(judged, lost, lost, lost)
    assert told.endswith(
        "no motion; if that is meant to stay, and the joint was looked at: "
        "opamc nightly rebaseline ROBOT --from 2026-03-02 "
        "--why TEXT --cell CELL"
    )
    assert said(lost, lost, judged, lost) == [
        "axis 2: not judged from 2026-03-01 to 2026-03-02 (2 nights in a row): no motion",
        "axis 2: not judged since 2026-03-04: no motion",
    ]


def test_what_was_said_in_a_night_is_not_changed_by_later_ones():
    """An alarm of effect 0.08 was in the history with the effect of a month later."""
    rng = np.random.default_rng(3)
    distances = [*0.1 * rng.normal(size=8), *np.linspace(1.0, 4.0, 20)]
    states = ["healthy"] * 8 + ["fault"] * 20
    series = nights_of(states, distances)
    for row, effect in zip(series, [0.0] * 8 + [0.05 * k for k in range(20)], strict=True):
        row["effect"] = effect
    early, late = (
        settle_robot("r1", series[:stop], (), (), AlarmConfig(remind_after=7), 0.4, 6)
        for stop in (18, 28)
    )
    assert [one.kind for one in early.events] == ["alarm", "reminder", "fault"]
    assert {*early.events} < {*late.events}
    assert late.alarms[0].text != early.alarms[0].text
    assert "changed by 5%" in late.events[0].text
    assert "changed by 95%" in late.alarms[0].text


def failures(*reasons):
    """Return when and how it is said of a robot that its nights failed for these reasons."""
    nights = [
        NightRow("r1", f"2026-03-{day:02d}", "", "failed", 0, why)
        for day, why in enumerate(reasons, start=1)
    ]
    events = settle_robot("r1", (), nights, (), AlarmConfig(), 0.4, 6).events
    return [(one.time[-2:], one.text) for one in events]


def test_a_new_reason_is_said_and_an_old_one_is_not_said_again():
    slow, odd = "took longer than 5 s (limits.seconds)", "logs/{}/a.parquet: cannot be opened"
    assert failures(slow) == [("01", f"2026-03-01: {slow}")]
    row = "2026-03-01 to 2026-03-02 (2 nights in a row)"
    assert failures(slow, slow) == [("01", f"{row}: {slow}")]
    row = "2026-03-01 to 2026-03-04 (4 nights in a row)"
    text = f"{row}: {slow}; 2026-03-02: {odd.format(2)}"
    assert failures(slow, odd.format(2), odd.format(3), slow) == [("01", text), ("02", text)]
    both = f"{odd.format(1)}; {slow}"
    assert [day for day, _ in failures(odd.format(1), both, slow)] == ["01", "02"]
    assert [day for day, _ in failures(*[slow] * 9)] == ["01", "08"]


def test_a_night_that_was_judged_in_part_is_not_called_failed():
    slow, sign = "took longer than 5 s (limits.seconds)", "axis 4 has lost its sign"

    def said(*nights):
        rows = [
            NightRow("r1", f"2026-03-0{day}", "", status, 0, why)
            for day, (status, why) in enumerate(nights, start=1)
        ]
        events = settle_robot("r1", (), rows, (), AlarmConfig(), 0.4, 6).events
        return [(one.kind, one.text) for one in events]

    partial = ("partial", sign)
    assert said(partial) == [("partial", f"2026-03-01: in part not judged: {sign}")]
    row = "2026-03-01 to 2026-03-02 (2 nights in a row)"
    assert said(partial, partial) == [("partial", f"{row}: in part not judged: {sign}")]
    baseline = ("baseline", sign)
    assert said(baseline) == [("partial", f"2026-03-01: in part not used: {sign}")]
    # one that failed among them is a line of its own, and the others are not said again
    assert said(partial, ("broken", slow), partial) == [
        ("partial", f"2026-03-01 to 2026-03-03 (2 nights): in part not judged: {sign}"),
        ("failed", f"2026-03-02: {slow}"),
    ]


def test_of_a_program_that_stays_faster_the_command_is_said_once_it_lasts():
    """A program at 110 % had to be looked up in the docs, a joint that was not judged had not."""
    with pytest.raises(NotEnoughDataError) as refused:
        refuse_all({1: ("its motions last 0.91 times as long.",)})
    fast = str(refused.value)

    def said(*whys):
        rows = [
            NightRow("r1", f"2026-03-{day:02d}", "", "failed", 0, why)
            for day, why in enumerate(whys, start=1)
        ]
        events = settle_robot("r1", (), rows, (), AlarmConfig(), 0.4, 6).events
        return [one.text for one in events]

    command = "; if that is meant to stay: opamc nightly rebaseline ROBOT --from 2026-03-01 --why"
    assert [command in text for text in said(*[fast] * 2)] == [False]
    assert [command in text for text in said(*[fast] * 8)] == [True, True]
    # what broke the nights is not meant to stay
    assert command not in " ".join(said(*["took longer than 5 s (limits.seconds)"] * 8))


def test_an_acknowledged_alarm_is_another_after_a_new_baseline():
    series = nights_of(["healthy"] * 5 + ["fault"] * 3)
    known = Declared("t", "r1", 2, "acknowledged", "2026-03-07", "gear ordered")
    new = Declared("t", "r1", None, "rebaselined", "2026-03-02", "oil")
    late = Declared("t", "r1", None, "rebaselined", "2026-03-20", "oil")
    back = Declared("t", "r1", None, "taken-back", "2026-03-02", "a mistake")

    def acknowledged(*declared):
        found = settle_robot("r1", series, (), declared, AlarmConfig(), 0.4, 6).alarms
        return [one.acknowledged for one in found]

    assert acknowledged() == [None]
    for said in ((known,), (new, known), (known, late), (known, new, back), (known, new, known)):
        assert acknowledged(*said) == ["gear ordered"]
    assert acknowledged(known, new) == [None]


def test_an_acknowledged_alarm_is_raised_once_more_by_nights_at_fault_where_none_was():
    """Acknowledged at effect 0.05, a joint that became a fault was silent for 14 mornings."""
    states = ["healthy"] * 8 + ["changed"] * 8 + ["healthy", "fault", "fault", "fault"]
    series = nights_of(states, [*0.1 * np.sin(np.arange(8)), *[3.0] * 12])
    for row in series:
        row["effect"] = {"changed": 0.05, "fault": 0.5}.get(row["state"], 0.0)

    def alarm(until, *nights):
        declared = [
            Declared(f"{night}T09", "r1", 2, "acknowledged", night, "gear") for night in nights
        ]
        found = settle_robot("r1", series[:until], (), declared, AlarmConfig(), 0.4, 6)
        said = [(one.time[-2:], one.text) for one in found.events if one.kind == "alarm"]
        return found.alarms[0], said

    known, more = "2026-03-14", "acknowledged on 2026-03-14, then changed by 5%, and at fault since"
    # a lone night at fault is not enough
    assert [alarm(until, known)[0].acknowledged for until in (14, 17, 18)] == ["gear"] * 3
    for until in (19, 20):
        stands, said = alarm(until, known)
        assert stands.acknowledged is None
        assert stands.text.startswith(f"{more} 2026-03-19; at fault, changed by 50%")
        assert [time for time, _ in said] == [stands.raised[-2:], "19"]
        assert said[1][1].startswith(f"axis 2: {more} 2026-03-19; at fault, changed by 50%")
    # acknowledged again, or with a fault among its nights, it is silent
    for nights in ((known, "2026-03-19"), ("2026-03-18",)):
        assert alarm(20, *nights)[0].acknowledged == "gear"
    # one gross night is enough
    series[17]["effect"] = 1.0
    assert alarm(18, known)[0].acknowledged is None


def test_of_joints_that_shake_each_other_the_one_to_see_to_first_comes_first():
    alarm = AlarmRow("r1", "", 0, "2026-03-01", "2026-03-01", None, None, "at fault", "{}")
    joints = [
        JointSummary(axis, "", state, "2026-03-02", "", index, alarm, first=first)
        for axis, state, index, first in (
            (1, "fault", 9.0, 2),
            (2, "fault", 5.0, None),
            (3, "fault", 11.0, 2),
            (4, "changed", 20.0, None),
        )
    ]
    robot = RobotSummary("r1", tuple(joints), None)
    assert [joint.axis for joint in robot.alarms] == [2, 3, 1, 4]
    row = {"state": "fault", "reason": "behind axis 2: Inspect the gear."}
    assert do_first(row) == "; do first: see to axis 2, which may shake it; then: Inspect the gear"
    assert do_first(row | {"reason": "Inspect the gear."}) == "; do first: Inspect the gear"
    assert do_first(row | {"state": "healthy"}) == ""


def test_since_does_not_move_with_the_nights_after_the_alarm():
    """Distances that end on a plateau, as a joint that is worn out or a fault that stays."""
    told = []
    for after in range(14):
        rise = [0.05 * (-1) ** day for day in range(10)] + [0.4, 0.7, 1.1, 1.8, 3.0]
        distances = [*rise, *[5.0] * after]
        series = nights_of(["healthy"] * 12 + ["fault"] * (len(distances) - 12), distances)
        (alarm,) = settle_robot("r1", series, (), (), AlarmConfig(), 0.4, 6).alarms
        told.append(alarm.since)
    assert len(set(told)) == 1, told
    assert told[0] in ("2026-03-10", "2026-03-11")


@pytest.mark.parametrize("before", [1, 2, 3, 8])
@pytest.mark.parametrize("gross", [True, False])
def test_a_change_that_comes_at_once_began_in_its_first_night(before, gross):
    """A gear that was exchanged was said to differ since two healthy nights before."""
    after = 1 if gross else 2
    distances = [0.05 * (-1) ** day for day in range(before)] + [5.0] * after
    series = nights_of(["healthy"] * before + ["fault"] * after, distances)
    for night in series[before:]:
        night["effect"] = 2.0 if gross else 0.4
    (alarm,) = settle_robot("r1", series, (), (), AlarmConfig(), 0.4, 6).alarms
    assert alarm.raised == series[-1]["night"]
    assert alarm.since == series[before]["night"]


def raised(states, distances):
    """Return the days on which alarms were raised."""
    series = nights_of(states, distances)
    found = settle_robot("r1", series, (), (), AlarmConfig(), 0.4, 6).alarms
    return [int(one.raised[-2:]) for one in found]


def test_nights_that_only_changed_are_an_alarm_once_the_chart_says_so():
    """A baseline that is too even by chance: every few nights of its joint differ, as they did."""
    even = [0.1 * (-1) ** day for day in range(30)]
    odd = [day in (8, 10, 20, 21) for day in range(30)]
    states = ["changed" if one else "healthy" for one in odd]
    assert (
        raised(states, [0.5 if one else usual for one, usual in zip(odd, even, strict=True)]) == []
    )
    lasting = ["healthy"] * 20 + ["changed"] * 10
    assert raised(lasting, [*even[:20], *[0.6] * 10]) == [25]
    assert raised(["healthy"] * 20 + ["fault"] * 10, even) == [22]


def test_an_alarm_by_the_chart_alone_says_so_and_none_after_a_night_that_differed():
    quiet = [*[0.1 * (-1) ** day for day in range(16)], *[1.0] * 6]
    events = settled(nights_of(["healthy"] * 22, quiet)).events
    assert any("each night for itself healthy, all together not" in one.text for one in events)
    (alarm,) = settled(nights_of(["healthy"] * 16 + ["fault"] * 4 + ["healthy"], quiet)).alarms
    assert alarm.text.startswith("healthy in the last night, changed by")


def test_an_alarm_does_not_end_while_the_chart_is_near_its_limit():
    def cleared(left):
        distances = [0.1 * (-1) ** day for day in range(16)] + [2.0] * 3 + [left] * 6
        states = ["healthy"] * 16 + ["fault"] * 3 + ["changed"] * 6
        (alarm,) = settled(nights_of(states, distances)).alarms
        return alarm.cleared and int(alarm.cleared[-2:])

    assert [cleared(left) for left in (0.0, 0.1, 0.3)] == [22, 22, None]


def test_an_alarm_stands_while_the_joint_differs_whatever_excuses_it():
    """Wear that stays as it is becomes the usual of the chart, and the hall excuses the night."""
    series = nights_of(["healthy"] * 5 + ["fault"] * 3 + ["healthy"] * 12)
    for row in series[8:16]:
        row.update(reason=EXCUSED, p_value=0.002)
    found = settled(series)
    assert [one.cleared for one in found.alarms] == ["2026-03-19"]
    # the alarm says it, and no line besides; before it stood there was one
    assert [one.kind for one in found.events] == ["alarm", "reminder", "cleared", "fault"]
    assert found.events[-1].time == "2026-03-06"


def test_an_alarm_says_what_it_waits_for_once_the_joint_is_healthy():
    def waits(*after, far=0.0, p=0.5, states=("fault",) * 3):
        quiet = [0.1 * (-1) ** day for day in range(16)]
        distances = [*quiet, *(2.0 * (one == "fault") for one in states), *[far] * len(after)]
        series = nights_of([*["healthy"] * 16, *states, *after], distances)
        for row in series[16:]:
            row["effect"] = 0.4 * (row["state"] == "fault")
        series[-1]["p_value"] = p
        return settled(series).alarms[-1].text.partition("; over ")[2]

    assert waits() == ""
    assert waits("changed") == ""
    assert waits("healthy") == "after 2 more nights without a sign of it"
    assert waits("healthy", "healthy") == "after 1 more night without a sign of it"
    small = "after 3 more nights without a sign of it (a p-value of 0.01 or below is one)"
    assert waits("healthy", p=0.002) == small
    far = " more nights without a sign of it (its distance of late still is one)"
    assert waits("healthy", "healthy", far=1.0).endswith(far)
    # of nights that lie apart it is said how many they were, and they have to be past
    apart = ("fault", "healthy", "healthy", "healthy") * 2 + ("fault",)
    assert waits("healthy", states=apart) == "after 21 more nights without a sign of it"


def settled(series, nights=(), declared=()):
    return settle_robot("r1", series, nights, declared, AlarmConfig(), 0.4, 6)


def test_a_night_of_another_condition_clears_no_alarm():
    """A worn joint that looks healthy beside nights at another speed, which show the same wear."""
    series = nights_of(["healthy"] * 5 + ["fault"] * 3 + ["healthy"] * 3 + ["fault"] * 2)
    for row in series:
        other = 9 <= int(row["night"][-2:]) <= 11
        row["baseline"] = "from 2026-02-03, 70 %" if other else "from 2026-02-01, 100 %"
    found = settled(series)
    (alarm,) = found.alarms
    assert (alarm.raised[-2:], alarm.cleared) == ("07", None)
    # the rule stands in the nights of the other condition as well
    assert [night[-2:] for _, _, night in found.standing] == [f"{day:02d}" for day in range(7, 14)]
    assert [one.kind for one in found.events] == ["alarm", "fault"]


def test_an_alarm_that_a_new_baseline_ends_is_said_to_be_over_and_stays():
    over = "axis 2: the alarm of 2026-03-04 is over, by a new baseline"
    series = nights_of(["healthy"] * 2 + ["fault"] * 3 + ["healthy"] * 4)
    for row in series:
        old = row["night"] <= "2026-03-05"
        row["baseline"] = f"from {'2026-02-01' if old else '2026-03-06'}, 100 %"
    ends = [one for one in settled(series).events if one.kind == "cleared"]
    assert [(one.time, one.text) for one in ends] == [("2026-03-06", over)]
    # declared, its first night is one of the baseline, also once later ones are judged against it
    declared = [Declared("t", "r1", None, "rebaselined", "2026-03-06", "oil")]
    nights = [NightRow("r1", f"2026-03-{day:02d}", "", "done") for day in range(1, 13)]
    later = [{**row, "night": f"2026-03-{int(row['night'][-2:]) + 3:02d}"} for row in series[5:]]
    for known in (series[:5], [*series[:5], *later]):
        found = settled(known, nights, declared)
        assert [one.cleared for one in found.alarms] == ["2026-03-06"]
        assert [one.text for one in found.events if one.kind == "cleared"] == [over]


def test_an_alarm_that_is_over_is_said_though_another_stands_on_that_axis():
    """Of another program, or of the same after some calm nights."""
    alarm = AlarmRow("r1", "lift", 2, "2026-03-01", "2026-03-01", None, None, "at fault", "{}")
    joints = tuple(
        JointSummary(2, program, "fault", "2026-03-05", "", 5.0, stands)
        for program, stands in (("cycle", None), ("lift", alarm))
    )
    robot = RobotSummary("r1", joints, NightRow("r1", "2026-03-05", "", "done"))
    over = "axis 2 in program cycle: the alarm of 2026-03-01 is over"
    said = [Event("2026-03-05", "r1", 2, "cleared", over)]
    morning = tell(Summary((robot,)), said, CellOutcome(), Path("out"), Path("cell.yaml"))
    assert morning.lines == (f"r1 {over}",)


def test_what_to_do_after_a_repair_is_said_once_of_a_robots_joints():
    alarms = [
        AlarmRow("r1", "", axis, "2026-03-05", "2026-03-04", None, None, "at fault", "{}")
        for axis in (2, 5)
    ]
    joints = tuple(
        JointSummary(one.axis, "", "fault", "2026-03-05", "", 5.0, one) for one in alarms
    )
    robot = RobotSummary("r1", joints, NightRow("r1", "2026-03-05", "", "done"))
    said = [as_told(one) for one in alarms]
    morning = tell(Summary((robot,)), said, CellOutcome(), Path("out"), Path("cell.yaml"))
    assert [line.split(":")[0] for line in morning.lines] == [
        "r1 axis 2",
        "  at fault",
        "  see out/index.html; silence it with",
        "r1 axis 5",
        "  at fault",
        "  see out/index.html; silence it with",
        "  after a repair",
    ]


@pytest.mark.parametrize("others", [0, 1, 2])
def test_two_robots_that_move_as_a_whole_in_one_night_may_be_exchanged(others):
    """Their exchanged files were two lines, each with the command that would make them stay so."""
    names = ["r1", "r2", "r3"][: others + 1]
    robots = [RobotSummary(name, (), NightRow(name, "2026-03-05", "", "done")) for name in names]
    said = [
        Event(
            "2026-03-05",
            name,
            None,
            *("failed", f"2026-03-05: {NO_AXIS}") if n else ("together", "5 of 6"),
        )
        for n, name in enumerate(names)
    ]
    found = tell(Summary(tuple(robots)), said, CellOutcome(), Path("out"), Path("cell.yaml"))
    asked = "moved in that night, too: are the files of the two exchanged?"
    lines = {f"r1 5 of 6; r2 {asked}", f"r2 2026-03-05: {NO_AXIS}; r1 {asked}"}
    assert (set(found.lines) == lines) == (others == 1)
    assert ("exchanged" in " ".join(found.lines)) == (others == 1)


def worn(per_night, weather, seed=3, nights=30):
    """Return what is said of a joint whose distance grows, and whose effect has weather on it."""
    rng = np.random.default_rng(seed)
    distances = np.r_[np.zeros(10), per_night * np.arange(nights - 10)] + rng.normal(0, 0.1, nights)
    series = nights_of(["healthy"] * 12 + ["fault"] * (nights - 12), distances.tolist())
    for row, of_weather in zip(series, weather * np.sin(1.3 * np.arange(nights)), strict=True):
        row["effect"] = 0.2 + of_weather
    (alarm,) = settled(series).alarms
    return alarm.text, json.loads(alarm.trend)


def test_wear_that_the_weather_hides_from_the_effect_is_no_lack_of_a_trend():
    text, trend = worn(0.1, 0.15)
    assert trend["low"] <= 0
    assert trend["distance"][1] <= 0.1 <= trend["distance"][2]
    assert trend["reach"] is None
    start = "at fault, changed by 20%; distance from the baseline grows by "
    assert text.startswith(start), text
    assert text.endswith(
        "a night, the change too unevenly to say when it reaches the fault level of 40%"
    )
    # what does not grow seldom seems to: the interval is one of 90 %
    still = [worn(0.0, 0.15, seed)[0] for seed in range(10)]
    assert sum(text.endswith("; no trend") for text in still) >= 8, still


def test_few_nights_that_grow_by_more_than_nights_differ_grow():
    def said(*rise, effect=0.0):
        distances = [0.1 * (-1) ** day for day in range(16)] + list(rise)
        series = nights_of(["healthy"] * 17 + ["fault"] * 3, distances)
        for row in series[16:]:
            row["effect"] = effect
        (alarm,) = settled(series).alarms
        return alarm.text, json.loads(alarm.trend)

    text, trend = said(0.4, 0.9, 1.4, 1.9)
    assert trend["distance"][0] == pytest.approx(0.5, abs=0.05)
    assert "distance from the baseline grows by 6" in text
    assert text.endswith(" a night, too few nights to say when it reaches the fault level of 40%")
    # where the effect is there already there is nothing to reach
    text, trend = said(0.4, 0.9, 1.4, 1.9, effect=0.5)
    level = "at fault, changed by 50%; beyond the fault level of 40%"
    start = f"{level}, distance from the baseline grows by 6"
    assert (text.startswith(start), trend["reach"]) == (True, [0, 0])
    assert said(0.0, 2.0, 2.1, 2.0) == (
        "at fault, changed by 0%; too few nights for a trend",
        {},
    )


def test_a_step_is_no_growth_and_what_is_reached_is_not_forecast():
    trend = {"distance": [5.1, 5.0, 5.3], "reach": None}
    assert trend_phrase(trend, 0.4).startswith("distance from the baseline has leapt, too few")
    grows = {
        "per_night": 0.01,
        "low": 0.001,
        "high": 0.02,
        "level": 0.2,
        "distance": [0.1, 0.05, 0.2],
    }
    assert trend_phrase(grows | {"reach": [8, 80]}, 0.4).endswith("in 8 to 80 nights")
    assert trend_phrase(grows | {"reach": [8, 165]}, 0.4).endswith("in 8 nights at the earliest")
    grew = "distance from the baseline grows by 11 % (5.1 to 22) a night"
    now = f"now beyond the fault level of 40%, {grew}"
    assert trend_phrase(grows | {"reach": [8, 165]}, 0.4, reached=True) == now


def test_a_sensors_step_is_forecast_no_more_than_nights_that_stay():
    """A gain of a current sensor, one tenth more from one night on, called friction: nights that
    rose by chance were told to reach the fault level in "8 to 46 nights"."""
    before = [0.02, -0.05, 0.1, -0.08, 0.04, 0.02]
    since = [0.91, 0.88, 0.97, 1.17, 1.06, 1.02, 0.93, 1.08, 1.08]
    effects = [0.1] * 6 + [0.09, 0.115, 0.11, 0.202, 0.132, 0.168, 0.148, 0.171, 0.296]
    series = nights_of(["healthy"] * 7 + ["fault"] * 8, before + since)
    for row, effect in zip(series, effects, strict=True):
        row["effect"] = effect
    (alarm,) = settled(series).alarms
    assert alarm.text == "at fault, changed by 30%; a step, no trend since"
    assert json.loads(alarm.trend)["reach"] is None
    # back again it is beyond it no more, whatever level its nights had
    for row in series[7:]:
        row["effect"] = 0.8
    series[-1]["effect"] = 0.02
    (alarm,) = settled(series).alarms
    assert (
        alarm.text
        == "at fault, changed by 2%; was beyond the fault level of 40% before, not in this night"
    )


def test_temperature_is_taken_off_the_trend_where_it_is_logged():
    rng = np.random.default_rng(4)
    distances = 0.1 * np.clip(np.arange(30) - 10, 0, None)
    warmth = 20 + 8 * rng.normal(size=30)
    series = nights_of(["healthy"] * 12 + ["fault"] * 18, distances.tolist())
    for row, degrees in zip(series, warmth, strict=True):
        row["effect"] = 0.1 + row["distance"] / 10 + 0.01 * (degrees - np.median(warmth))
    alone = json.loads(settled(series).alarms[0].trend)
    for row, degrees in zip(series, warmth, strict=True):
        row["temperature_c"] = degrees
    told = json.loads(settled(series).alarms[0].trend)
    assert alone["low"] <= 0  # as it was
    assert (told["per_night"], told["level"]) == pytest.approx((0.01, 0.29), abs=3e-3)
    # 0.4 is reached 11 nights after the last one
    assert told["reach"][0] <= 11 <= told["reach"][1] <= 13


def nights_excused(*excused, of=12):
    """Return a healthy joint's nights, of which some differ by no more than conditions may do."""
    rows = nights_of(["healthy"] * of)
    for day, row in enumerate(rows, start=1):
        if day in excused:
            row.update(reason=EXCUSED, p_value=0.0011 * day, distance=np.log(day))
    return rows


def test_a_joint_that_conditions_alone_excuse_is_told_and_again_after_some_nights():
    """Whatever lies between: warm days come and go."""
    (told,) = settled(nights_excused(4)).events
    assert (told.time, told.kind) == ("2026-03-04", "excused")
    assert told.text == (
        "axis 2: not told from unusual conditions in 2026-03-04 (p 0.0044, 4 times as far as a "
        "healthy session): a fault that looks alike would not be told"
    )
    found = settled(nights_excused(2, 4, 5, 8, 9, 10)).events
    assert [one.time[-2:] for one in found] == ["02", "09"]
    (text,) = {one.text for one in found}
    assert "in 6 nights from 2026-03-02 to 2026-03-10 (p 0.011, 10 times as far" in text
    assert settled(nights_excused()).events == ()


def test_a_joint_that_something_outside_it_changed_is_told_by_cause_and_again_after_some_nights():
    """A sensor whose gain was off by a third was silence, night after night."""
    rows = nights_of(["healthy"] * 12)
    for row in rows[2:]:
        row.update(state="changed", harmless=True, cause="sensor_gain", p_value=1e-9)
        row.update(reason="Check before the gear: a gain.")
    rows[4].update(cause="payload_change", reason="Check before the gear: a payload.")
    rows[5].update(state="fault", harmless=False, cause="ripple")
    found = [one for one in settled(rows).events if one.kind != "fault"]
    assert [(one.time[-2:], one.kind) for one in found] == [
        (day, "outside") for day in ("03", "05", "12")
    ]
    assert found[0].text == (
        "axis 2: changed in 9 nights from 2026-03-03 to 2026-03-12 by what lies outside the joint: "
        "Check before the gear: a gain. Check before the gear: a payload. A fault that looks alike "
        "would not be told; if it is meant to stay: opamc nightly rebaseline ROBOT --from "
        "2026-03-03 --why TEXT --cell CELL"
    )


def test_a_robot_whose_last_night_conditions_alone_excuse_is_not_counted_as_healthy():
    def robot(night):
        joint = JointSummary(2, "", "healthy", night, "", 4.2, None, excused=True)
        return RobotSummary("r1", (joint,), NightRow("r1", "2026-03-09", "", "done"))

    assert not robot("2026-03-09").unwatched
    assert Summary((robot("2026-03-09"),)).headline() == (
        "1 robot with a joint not told from unusual conditions: r1"
    )


def test_a_joint_that_is_not_judged_is_counted_beside_one_that_changed():
    states = {1: "changed", 2: "insufficient-data"}
    joints = tuple(
        JointSummary(axis, "", state, "2026-03-09", "", None, None)
        for axis, state in states.items()
    )
    robot = RobotSummary("r1", joints, NightRow("r1", "2026-03-09", "", "done"))
    assert Summary((robot,)).headline() == (
        "1 robot changed in the last night, no alarm yet: r1; "
        "1 robot of these with a joint not judged: r1"
    )


def test_a_joint_with_an_alarm_in_two_programs_is_one_joint():
    alarm = AlarmRow("r1", "", 2, "2026-03-04", "2026-03-03", None, None, "at fault", "{}")
    joints = tuple(
        JointSummary(2, program, "fault", "2026-03-09", "", None, alarm) for program in ("A", "B")
    )
    robot = RobotSummary("r1", joints, NightRow("r1", "2026-03-09", "", "done"))
    assert Summary((robot,)).headline() == "1 joint of 1 robot with an alarm"


def test_a_joint_under_alarm_in_two_programs_is_told_once():
    """It was two alarms of four lines, with the same two commands in both."""
    alarms = {
        program: AlarmRow("r1", program, 2, "2026-03-09", since, None, None, text, "{}")
        for program, since, text in (("A", "2026-03-03", "at fault"), ("B", "2026-03-05", "worn"))
    }
    joints = tuple(
        JointSummary(2, program, "fault", "2026-03-09", "", index, alarms[program])
        for program, index in (("A", 50.0), ("B", 40.0))
    )
    robot = RobotSummary("r1", joints, NightRow("r1", "2026-03-09", "", "done"))

    def morning(*events):
        found = tell(Summary((robot,)), events, CellOutcome(), Path("out"), Path("cell.yaml"))
        return found.lines, found.standing

    stand = {program: as_told(alarm) for program, alarm in alarms.items()}
    lines, standing = morning(*stand.values())
    assert lines[:3] == (
        "r1 axis 2, program A: ALARM, not as it was since 2026-03-03",
        "  at fault",
        "  also in program B, since 2026-03-05: worn",
    )
    assert (len(lines), standing) == (5, ())
    # where the other one was told some mornings before
    lines, standing = morning(stand["B"])
    assert lines == ("r1 axis 2: alarm also in program B, since 2026-03-05: worn",)
    assert standing == ("r1 axis 2, program A: alarm since 2026-03-03, at fault",)
    reminder = Event("2026-03-09", "r1", 2, "reminder", "")
    assert morning(reminder)[0][0].startswith("r1 axis 2, program A: STILL UNDER ALARM")
    assert len(morning(reminder)[0]) == 5


def single(*rows):
    """Return when and how it is said of a joint that it was not as it was in single nights."""
    return [(one.time[-5:], one.kind, one.text) for one in settled(rows).events]


def intermittent(states, effect=0.2, **said):
    """Return nights of a joint whose faults have this effect."""
    rows = nights_of(states)
    for row in rows:
        if row["state"] != "healthy":
            row.update(effect=effect, distance=1.0, **said)
    return rows


NEEDS = "an alarm needs 2 of 3 nights at fault, 3 of 30 that changed by 40%, or a change that lasts"


def test_a_single_night_at_fault_is_said_and_each_time_that_it_comes_back():
    """A cable that dropped out every third night was silence, fifteen starts in a row."""
    one, calm = "fault", ["healthy"] * 3
    rows = intermittent(
        ["healthy", one, *calm, one, *calm, one], reason="in part: Inspect the joint for ripple."
    )
    needs = f"{NEEDS}; do first: Inspect the joint for ripple"
    alone = f"axis 2: at fault in 2026-03-02 alone, changed by 20%: {needs}"
    assert single(*rows[:3]) == [("03-02", "fault", alone)]
    text = (
        "axis 2: at fault in 3 nights from 2026-03-02 to 2026-03-10, the last changed by 20%: "
        f"{needs}"
    )
    kinds = [("03-02", "fault"), ("03-06", "fault"), ("03-10", "fault")]
    assert single(*rows) == [(*said, text) for said in kinds]
    # after a month it is another
    late = {**rows[1], "night": "2026-05-01", "reason": ""}
    between = [{**rows[0], "night": f"2026-04-{day}"} for day in (29, 30)]
    assert single(*rows, *between, late)[3] == (
        "05-01",
        "fault",
        f"axis 2: at fault in 2026-05-01 alone, changed by 20%: {NEEDS}",
    )
    # a night that was not judged parts none, and one that only changed is the chart's
    between = {**rows[2], "state": "insufficient-data"}
    told = single(rows[1], between, {**rows[1], "night": "2026-03-05"})
    assert [time for time, kind, _ in told if kind == "fault"] == ["03-02"]
    assert single({**rows[1], "state": "changed"}) == []


def test_large_faults_that_come_back_are_an_alarm_that_says_so():
    rows = intermittent((["fault"] + ["healthy"] * 3) * 3, effect=0.5)
    (alarm,) = settled(rows).alarms
    assert (alarm.raised, alarm.since) == ("2026-03-09", "2026-03-01")
    named = settled([{**row, "reason": "Check the grease."} for row in rows]).events
    assert next(one.text for one in named if one.kind == "alarm").endswith(
        "no trend; do first: Check the grease"
    )
    told = [one for one in settled(rows).events if one.kind == "alarm"]
    assert [one.text for one in told] == [
        "axis 2: at fault, changed by 50%; comes and goes, in 3 nights until 2026-03-09; "
        "now beyond the fault level of 40%, no trend"
    ]


def test_what_is_said_of_single_nights_is_not_said_beside_the_alarm_that_they_are_of():
    alarm = AlarmRow("r1", "", 2, "2026-03-04", "2026-03-03", None, None, "at fault", "{}")
    joint = JointSummary(2, "", "fault", "2026-03-04", "", 5.0, alarm)
    robot = RobotSummary("r1", (joint,), NightRow("r1", "2026-03-04", "", "done"))
    said = [Event(f"2026-03-0{day}", "r1", 2, "fault", f"night {day}") for day in (2, 3)]
    morning = tell(Summary((robot,)), said, CellOutcome(), Path("out"), Path("cell.yaml"))
    assert morning.lines == ("r1 night 2",)
