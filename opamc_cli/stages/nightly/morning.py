"""What is said in the morning: who needs a look, and nothing to those who need none."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Any

from opamc_cli.config.cell import CellConfig
from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.alarms.commands import ACKNOWLEDGE, REBASELINE, to_copy
from opamc_cli.stages.nightly.alarms.not_judged import NO_AXIS
from opamc_cli.stages.nightly.inputs.recordings import said_of_strays, said_of_unnamed, some
from opamc_cli.stages.nightly.start.outcome import CellOutcome
from opamc_cli.stages.nightly.summary import JointSummary, RobotSummary, Summary
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import STANDING, THE_CELL, AlarmRow, Event
from opamc_cli.storage.schemas import files

OVER = {
    kind: rank
    for rank, kind in enumerate(
        (
            *("lost", "ended", "fault", "silent", "thinned", "lacking", "failed", "partial"),
            *("not-judged", "missing", "cleared", "together", "excused", "outside", "gathering"),
        )
    )
}
"""Kinds of event that are a line of their own, in the order in which they are said."""


NO_ROBOTS = ("lost", "silent", "ended", "stray", "unnamed")
"""Kinds of event that may be of none of the cell's robots."""

MOST_STANDING = 20
"""Lines of what was said before and still stands."""

MOST_OTHERS = 3
"""Verdicts that are others than before which are told one by one."""

SILENT_DAYS = 3
"""Days without a night after which a cell is silent: a weekend is none."""


@dataclass(frozen=True)
class Morning:
    """What a start has to say."""

    lines: tuple[str, ...]
    """Sentences for people: robots that need a look first, four lines each."""
    standing: tuple[str, ...]
    """What was said before and still stands, worst first, one line each."""
    values: dict[str, Any]
    """The same for programs."""
    exit_code: ExitCode
    """The largest concern of the cell."""


def silent(history: History, today: date, remind_after: int) -> Iterator[Event]:
    """Say that the whole cell has no new night: no robot can be said to lack what others have.

    It is said and no more: of logs of the past, which are judged, too, only the clock tells it.
    """
    last = max((night for _, night in history.nights()), default="")
    days = (today - date.fromisoformat(last)).days if last else 0
    if days > SILENT_DAYS:
        told = (days - SILENT_DAYS - 1) // remind_after  # each time is an event of its own
        time = (date.fromisoformat(last) + timedelta(told * remind_after)).isoformat()
        yield Event(time, THE_CELL, None, "silent", f"no recording of any robot since {last}")


def as_told(alarm: AlarmRow) -> Event:
    """Return what is remembered of an alarm that was told to stand."""
    kind = STANDING[alarm.acknowledged is not None]
    return Event(f"{alarm.raised} {alarm.program}", alarm.robot, alarm.axis, kind, "")


def over(history: History, cell: CellConfig, stood: Sequence[Event]) -> Iterator[Event]:
    """Say which alarms stand no more of which it was told last that they stand, and why.

    Whatever has ended them: what was said is held against what is.
    """
    alarms: dict[tuple[str, int | None, str], list[AlarmRow]] = {}
    for one in history.alarms() if stood else ():
        alarms.setdefault((one.robot, one.axis, one.program), []).append(one)
    for told in stood:
        raised, _, program = told.time.partition(" ")
        place = (told.robot, told.axis, program)
        of = [one for one in alarms.get(place, ()) if (one.cleared or "9999") >= raised]
        left = cell.robots != "auto" and told.robot not in cell.robots
        if not left and any(one.cleared is None for one in of):
            continue
        if not left and of:
            ends = (told.robot, told.axis, "cleared", of[-1].cleared)
            yield from (
                one for one in history.events() if (one.robot, one.axis, one.kind, one.time) == ends
            )
            continue
        why = "its nights show none now"
        if left:
            why = "the robot has left the cell's file"
        elif not history.rows(
            "SELECT night FROM verdict WHERE (robot, axis, program) = (?, ?, ?) LIMIT 1", place
        ):
            why = "it is not watched any more (`axes` in the cell's file, or its recordings)"
        text = f"axis {told.axis}: the alarm of {raised} stands no more: {why}"
        nights = [night for robot, night in history.nights() if robot == told.robot]
        yield Event(max(nights, default=raised), told.robot, told.axis, "ended", text)


def tell(
    summary: Summary, untold: Sequence[Event], outcome: CellOutcome, out: Path, cell: Path
) -> Morning:
    """Say what a start has found that nobody was told of yet.

    Parameters
    ----------
    summary
        How the robots that were looked at stand.
    untold
        Events that nobody was told of.
    outcome
        What the start did.
    out
        Folder of the results, for paths.
    cell
        The cell's file, for what can be done about an alarm.
    """
    names = {robot.name for robot in summary.robots}
    news = [event for event in untold if event.robot in names or event.kind in NO_ROBOTS]
    under: dict[tuple[str, int | None], str] = {
        (robot.name, joint.axis): joint.since
        for robot in summary.robots
        for joint in robot.joints
        if joint.alarm
    }
    # nights that an alarm which stands is of are its own
    news = [
        one
        for one in news
        if one.kind != "fault" or one.time < under.get((one.robot, one.axis), "9999")
    ]
    of_robots, standing_lines = _of_robots(summary, news, out, cell)
    lines = [*outcome.absent, *of_robots]
    told_now = {(event.robot, event.text) for event in news}
    standing_lines += [
        f"{robot.name} {event.text}"
        for robot in summary.robots
        for event in robot.lately
        if (robot.name, event.text) not in told_now
    ]
    if len(standing_lines) > MOST_STANDING:
        more = f"and {len(standing_lines) - MOST_STANDING} more, see {out / files.PAGE}"
        standing_lines[MOST_STANDING:] = [more]
    n_joints = {one.name: len({joint.axis for joint in one.joints}) for one in summary.robots}
    lines += _of_events(news, cell, n_joints)
    alarms = any(robot.alarms for robot in summary.robots)
    unwatched = any(robot.unwatched for robot in summary.robots)
    # nothing stays of these
    once = any(event.kind in ("lost", "ended", "stray", "unnamed") for event in news)
    failed = outcome.failed or outcome.unjudged or outcome.absent or outcome.ended
    doubtful = failed or unwatched or once
    code = ExitCode.UNHEALTHY if alarms else ExitCode.PARTIAL if doubtful else ExitCode.DONE
    return Morning(tuple(lines), tuple(standing_lines), _values(summary, outcome), code)


def _of_robots(
    summary: Summary, news: Sequence[Event], out: Path, cell: Path
) -> tuple[list[str], list[str]]:
    """Say of robots that need a look what is new, and what was said before and still stands."""
    lines: list[str] = []
    standing_lines: list[str] = []
    for robot in summary.needing():
        told = {(e.axis, e.kind) for e in news if e.robot == robot.name}
        in_full = False
        for joints in robot.alarms_by_joint:
            new = [one for one in joints if one.alarm and as_told(one.alarm) in news]
            first, *again = joints
            if (first.axis, "reminder") in told or len(new) == len(joints):
                how = "ALARM" if new else "STILL UNDER ALARM"
                lines += _alarm_lines(how, robot, first, again, out, cell)
                in_full = True
                continue
            before = [one for one in joints if one not in new]
            lines += [f"{robot.name} axis {first.axis}: alarm{_also(robot, one)}" for one in new]
            standing_lines += [
                f"{_place(robot, one)}: alarm since {one.since}, {one.text}" for one in before
            ]
        if in_full:  # one repair is for all its joints
            lines.append(to_copy(f"  after a repair: {REBASELINE}", [robot.name], cell))
        said_now = any(e.robot == robot.name and e.kind in ("failed", "missing") for e in news)
        if robot.broken and not said_now:
            of = robot.failure
            why = f"{of.night} could not be judged: {of.why}" if of else "no recording"
            standing_lines.append(f"{robot.name} {to_copy(why, [robot.name], cell)}")
    return lines, standing_lines


def _of_events(news: Sequence[Event], cell: Path, n_joints: Mapping[str, int]) -> list[str]:
    """Say what is a line of its own, of all robots of which it is true at once."""
    said: dict[tuple[int, str], list[str]] = {}
    at_once: dict[str, dict[str, None]] = {}
    for event in news:
        if event.kind == "together" or (event.kind == "failed" and NO_AXIS in event.text):
            at_once.setdefault(event.time, {})[event.robot] = None
    for event in sorted(news, key=lambda e: (OVER.get(e.kind, 9), e.robot, e.time)):
        if event.kind in OVER:
            alike = [
                robot
                for robot in at_once.get(event.time, ())
                if n_joints.get(robot) == n_joints.get(event.robot)
            ]
            text = event.text + _exchanged(event, alike)
            robots = said.setdefault((OVER[event.kind], text), [])
            robots += [] if event.robot in robots[-1:] else [event.robot]
    # one line for all robots of a hall that was switched off, and for all reminders of one thing
    lines = [f"{some(of)} {to_copy(text, of, cell)}" for (_, text), of in said.items()]
    strays: dict[str, list[str]] = {}
    unnamed: dict[str, str] = {}
    others: dict[str, list[str]] = {}
    for event in news:
        if event.kind == "judged-anew":
            others.setdefault(event.robot, []).append(event.text)
        elif event.kind == "stray":
            strays.setdefault(event.robot, []).append(event.time)
        elif event.kind == "unnamed":
            unnamed[event.robot] = event.time
    for name, texts in sorted(others.items()):
        lines.append(f"{name} judged anew: {some(sorted(texts), MOST_OTHERS)}")
    lines += [f"{name} {said_of_strays(paths)}" for name, paths in sorted(strays.items())]
    lines += [said_of_unnamed(unnamed)] if unnamed else []
    return lines


def _exchanged(event: Event, robots: Collection[str]) -> str:
    """Ask whether two robots that are both unlike themselves since one night are exchanged.

    As a whole, by which joints move together, or fit nothing. Weather moves more of them, or one.
    """
    others = [name for name in robots if name != event.robot]
    if len(others) != 1 or event.robot not in robots or event.kind not in ("together", "failed"):
        return ""
    return f"; {others[0]} moved in that night, too: are the files of the two exchanged?"


def _alarm_lines(
    how: str,
    robot: RobotSummary,
    joint: JointSummary,
    others: Sequence[JointSummary],
    out: Path,
    cell: Path,
) -> Iterator[str]:
    """Tell a joint's alarm: of that program in which it lies farthest, the others a line each."""
    alarm = joint.alarm
    assert alarm is not None
    yield f"{_place(robot, joint)}: {how}, not as it was since {alarm.since}"
    yield f"  {joint.text}"
    yield from (f" {_also(robot, one)}" for one in others)
    where = out / joint.report if joint.report else out / files.PAGE
    silence = ACKNOWLEDGE.replace("ROBOT", f"ROBOT --axis {joint.axis}")
    yield to_copy(f"  see {where}; silence it with: {silence}", [robot.name], cell)


def _also(robot: RobotSummary, joint: JointSummary) -> str:
    return f" also in program {joint.program}, since {joint.since}: {joint.text}"


def _place(robot: RobotSummary, joint: JointSummary) -> str:
    program = f", program {joint.program}" if robot.several_programs else ""
    return f"{robot.name} axis {joint.axis}{program}"


def _values(summary: Summary, outcome: CellOutcome) -> dict[str, Any]:
    robots: dict[str, Any] = {}
    for robot in summary.robots:
        robots[robot.name] = {
            "state": robot.shown,
            "missing_since": robot.missing or None,
            "reasons": list(robot.reasons),
            "done": sorted(night for name, night in outcome.done if name == robot.name),
            "skipped": sorted(
                night.night
                for night in outcome.planned.values()
                if night.robot == robot.name and not night.why
            ),
            "failed": [
                {"night": night, "why": why}
                for name, night, why in sorted(outcome.failed)
                if name == robot.name
            ],
            "alarms": [
                {
                    "axis": joint.axis,
                    "program": joint.program,
                    "since": joint.since,
                    "text": joint.text,
                    "acknowledged": joint.alarm.acknowledged,
                }
                for joint in robot.joints
                if joint.alarm is not None
            ],
        }
    return {"robots": robots}
