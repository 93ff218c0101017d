"""What follows from the history: alarms, what is worth saying, old folders, pages and metrics."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date, timedelta
from itertools import accumulate
from operator import or_

from opamc_cli import __version__
from opamc_cli.config.cell import CellConfig
from opamc_cli.config.models import digest
from opamc_cli.decision.trend.alarm import LATELY
from opamc_cli.decision.trend.chart import LIMIT
from opamc_cli.stages.nightly.alarms.commands import ACKNOWLEDGE
from opamc_cli.stages.nightly.alarms.not_judged import said_in
from opamc_cli.stages.nightly.alarms.robot import settle_robot
from opamc_cli.stages.nightly.inputs.recordings import some
from opamc_cli.stages.nightly.plan.baselines import NIGHTS_AGAIN
from opamc_cli.stages.nightly.publish.metrics import write_metrics
from opamc_cli.stages.nightly.publish.page import write_page
from opamc_cli.stages.nightly.summary import Summary, summarise
from opamc_cli.storage.files.folders import remove_folder
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import AlarmRow, Event, NightRow, begun_anew
from opamc_cli.storage.schemas import files

OF_NIGHT = frozenset({files.VERDICT, files.REPORT})
"""All that a night's folder holds."""

REST_WEEKS = 4
"""Weeks in a row after which a weekday without files, such as Sunday, is the robot's habit."""

HOW_TO_END = f"if they are to have none: {ACKNOWLEDGE}"
"""What ends that a robot counts as missing, beside its files."""


def settle_cell(
    cell: CellConfig, source: str, history: History, robots: Sequence[str], *, whole: bool = False
) -> Summary:
    """Bring everything that follows from the nights up to date.

    Parameters
    ----------
    cell
        What is looked after.
    source
        Name of its file, for errors.
    history
        Of the cell.
    robots
        Those that were looked at.
    whole
        Whether all nights of all robots were: only then a night that is not known is missing.

    Returns
    -------
    Summary
        How all robots of the cell stand now.
    """
    # another version may tell other alarms, or tell them otherwise, of nights it cannot judge anew
    rule = {**cell.alarm.model_dump(), "limit": LIMIT, "lately": LATELY, "version": __version__}
    history.apply_rule(digest(rule))
    by_robot: dict[str, list[NightRow]] = {}
    for row in sorted(history.nights().values(), key=lambda row: (row.robot, row.night)):
        by_robot.setdefault(row.robot, []).append(row)
    known = history.alarms()
    for robot in history.stale():
        before = [alarm for alarm in known if alarm.robot == robot]
        _settle(cell, source, history, robot, by_robot.get(robot, []), before)
    if whole:
        gone = {one.robot: one.night for one in history.declared() if one.kind == "gone"}
        # what left the cell is no other that has files
        own = {*robots, *(by_robot if cell.robots == "auto" else ())}
        left = [one for one in history.events() if one.kind == "missing" and one.robot not in own]
        nights = {robot: by_robot.get(robot, []) for robot in own}
        history.replace_missing([*left, *_missing(nights, gone, cell.alarm.remind_after)])
    _prune(cell, history)
    named = None if cell.robots == "auto" else tuple(cell.robots)
    by_first_nights = cell.baseline.nights is not None
    summary = summarise(history, named or robots, by_first_nights=by_first_nights)
    if named:  # what left the cell is no concern of its page
        summary = summary.only(named)
    write_page(cell, history, summary)
    write_metrics(cell, summary)
    return summary


def _settle(
    cell: CellConfig,
    source: str,
    history: History,
    robot: str,
    nights: Sequence[NightRow],
    before: Sequence[AlarmRow],
) -> None:
    """Find a robot's alarms anew; those of nights that are a new baseline's now are kept."""
    series, declared = history.series(robot), history.declared(robot)
    settled = settle_robot(
        robot,
        series,
        nights,
        declared,
        cell.alarm,
        cell.diagnosis_of(robot, source).score.fault_effect,
        cell.baseline.nights or NIGHTS_AGAIN,
    )
    begun = [night for _, night in begun_anew(declared)]
    taken = list(_taken_into_baseline(before, settled.alarms, nights, begun))
    events = [
        *settled.events,
        *_events_of(taken, before, history.events() if taken else (), settled.events),
    ]
    history.settle(robot, [*settled.alarms, *taken], settled.standing, events)


def _taken_into_baseline(
    before: Sequence[AlarmRow],
    after: Sequence[AlarmRow],
    nights: Sequence[NightRow],
    begun: Sequence[str],
) -> Iterator[AlarmRow]:
    """Keep the alarms of nights that a user has made a new baseline of: over, but not forgotten."""
    baseline = {row.night for row in nights if row.status == "baseline"}
    there = {(one.program, one.axis, one.raised) for one in after}
    for alarm in before:
        declared = any(night <= alarm.raised for night in begun)
        again = (alarm.program, alarm.axis, alarm.raised) in there
        if declared and alarm.raised in baseline and not again:
            yield replace(alarm, cleared=alarm.cleared or nights[-1].night)


def _events_of(
    taken: Sequence[AlarmRow],
    before: Sequence[AlarmRow],
    said: Sequence[Event],
    anew: Sequence[Event],
) -> Iterator[Event]:
    """Keep what was said of alarms whose nights are a baseline's now, and say that they are over.

    But what is said `anew` of the same joint and night.
    """
    there = {(one.time, one.axis, one.kind) for one in anew}
    kinds = ("alarm", "reminder", "cleared")
    kept: dict[Event, None] = {}
    for alarm in taken:
        for event in said:
            same = (event.robot, event.axis) == (alarm.robot, alarm.axis) and event.kind in kinds
            if same and alarm.raised <= event.time <= str(alarm.cleared):
                kept[event] = None
        if alarm not in before:
            text = f"axis {alarm.axis}: the alarm of {alarm.raised} is over, by a new baseline"
            kept[Event(str(alarm.cleared), alarm.robot, alarm.axis, "cleared", text)] = None
    yield from (one for one in kept if (one.time, one.axis, one.kind) not in there)


def _missing(
    by_robot: Mapping[str, Sequence[NightRow]],
    gone: Mapping[str, str],
    remind_after: int,
) -> Iterator[Event]:
    """Say which robots have no file of nights of which others have, and again while they lack.

    A robot of which somebody has said that it is gone is not reminded of until it has files again;
    nor is it said of weekdays on which it rests, as long as it has files again after them.
    """
    nights = sorted({night for rows in by_robot.values() for night in _recorded(rows)})
    for robot in sorted(by_robot):
        own = {row.night for row in by_robot[robot] if row.night}
        if not own and by_robot[robot]:
            continue  # all its files tell no night, which is said
        if not own:
            if robot not in gone:
                first, text = min(nights, default=""), f"no file at all; {HOW_TO_END}"
                yield Event(first, robot, None, "missing", text)
            continue
        lacking = {night for night in nights if night > min(own)} - own
        gap: list[str] = []
        for night in [*(n for n in nights if n > min(own)), ""]:
            if night in lacking:
                gap.append(night)
            elif gap:
                span = gap[0] if len(gap) == 1 else f"{gap[0]} to {gap[-1]}"
                text = f"no file of {span}; others have some"
                weeks = min(_weeks_before(one, lacking, own) for one in gap)
                if weeks == REST_WEEKS - 1:
                    text += f", as in the {weeks} weeks before; this weekday is not said again"
                # Of a robot that had recorded for a year there would be other nights about it.
                days = {one[5:] for one in gap}
                first = min((one for one in own if one[5:] not in days), default=gap[0])
                if years := sorted(one for one in own if one[5:] in days and one < first):
                    text += f"; it has files of {some(years)}: is its clock a year off?"
                if not night:
                    text += f"; {HOW_TO_END}"
                # a free Saturday is no news that the robot is dead on Monday, too
                reach = accumulate((_records_on(n, gap[0], lacking, own) for n in gap), or_)
                for index in said_in(gap, [str(one) for one in reach], remind_after):
                    known = gap[0] <= gone.get(robot, "") <= gap[index]
                    if not known and weeks < REST_WEEKS:
                        yield Event(gap[index], robot, None, "missing", text)
                gap = []


def _records_on(night: str, begin: str, lacking: set[str], own: set[str]) -> bool:
    """Return whether a robot has recorded on a night's weekday in the weeks before a gap begins.

    And lacked none of these. A weekday that it has not had yet may be free; within a week comes
    one that it has had.
    """
    day = date.fromisoformat(night)
    weeks = {(day - timedelta(7 * n)).isoformat() for n in range(1, REST_WEEKS + 1)}
    before = {one for one in weeks if one < begin}
    return not own.isdisjoint(before) and lacking.isdisjoint(before)


def _weeks_before(night: str, lacking: set[str], own: set[str]) -> int:
    """Return for how many weeks in a row a robot has rested on a night's weekday until then.

    Weeks in which it has no file at all are none of rest. At most `REST_WEEKS` are counted.
    """
    day = date.fromisoformat(night)
    for n in range(REST_WEEKS):
        week = [(day - timedelta(7 * n + k)).isoformat() for k in range(1, 8)]
        if week[-1] not in lacking or own.isdisjoint(week):
            return n
    return REST_WEEKS


def _recorded(rows: Sequence[NightRow]) -> Iterator[str]:
    """Yield a robot's nights but those that are copies of earlier ones: nobody knows of these."""
    known: set[str] = set()
    for row in rows:
        contents = {one.rpartition(" ")[2] for one in json.loads(row.key)["files"]}
        if row.night and not contents <= known:
            yield row.night
        known |= contents


def _prune(cell: CellConfig, history: History) -> None:
    """Remove the folders of all but a robot's last nights; the history keeps what they said."""
    for robot, nights in history.reports().items():
        old = list(nights)[: -cell.keep.reports]
        for night in old:
            remove_folder(cell.out / robot / night, of=OF_NIGHT)
        if old:  # only then: a start that was killed finds them again
            history.forget_reports(robot, old)
