"""What follows from the history: alarms, what is worth saying, old folders, pages and metrics."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from opamc_cli import __version__
from opamc_cli.config.cell import CellConfig
from opamc_cli.config.models import digest
from opamc_cli.decision.trend.alarm import LATELY
from opamc_cli.decision.trend.chart import LIMIT
from opamc_cli.stages.nightly.alarms.missing import missing
from opamc_cli.stages.nightly.alarms.robot import settle_robot
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


def settle_cell(
    cell: CellConfig,
    source: str,
    history: History,
    robots: Sequence[str],
    *,
    whole: bool = False,
    may_begin: Callable[[str, str], bool] = lambda robot, night: False,
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
    may_begin
        Whether a robot may record of a night yet.

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
        history.replace_missing([*left, *missing(nights, gone, cell.alarm.remind_after, may_begin)])
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


def _prune(cell: CellConfig, history: History) -> None:
    """Remove the folders of all but a robot's last nights; the history keeps what they said."""
    for robot, nights in history.reports().items():
        old = list(nights)[: -cell.keep.reports]
        for night in old:
            remove_folder(cell.out / robot / night, of=OF_NIGHT)
        if old:  # only then: a start that was killed finds them again
            history.forget_reports(robot, old)
