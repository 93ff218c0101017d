"""How a cell stands: robots and joints with their alarms, for terminal, page and metrics."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from opamc_cli.decision.trend.alarm import LATELY
from opamc_cli.stages.nightly.alarms.course import day
from opamc_cli.stages.nightly.inputs.recordings import some
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import (
    UNJUDGED,
    AlarmRow,
    Event,
    NightRow,
    begun_anew,
    told_by,
)

SEVERITY = (
    "alarm",
    "failed",
    "missing",
    "gathering",
    "fault",
    "changed",
    "insufficient-data",
    "partial",
    "excused",
    "known",
    "gone",
    "baseline",
    "healthy",
)
"""Worst first; known: an alarm that was acknowledged, gone: that there are no recordings."""

COMPLETE = """
SELECT robot, since, min(night) AS night FROM (
  SELECT robot, since, max(night) AS night FROM baseline GROUP BY robot, program, condition, since
) GROUP BY robot, since
"""
"""Night in which each robot had a complete baseline for the first time, by where that begins."""


@dataclass(frozen=True)
class JointSummary:
    """One joint of a robot in one program, as of its last night."""

    axis: int
    program: str
    state: str
    """Of its last night; baseline, where that one's has been replaced since."""
    night: str
    """That night."""
    report: str
    """Where its report lies, below `out`; empty if it was pruned."""
    health_index: float | None
    """Of its last night."""
    alarm: AlarmRow | None
    """The alarm that stands, or None."""
    excused: bool = False
    """Whether it differs, but no more than conditions may move it."""
    in_part: bool = False
    """Whether not all of that night's recordings could be used for it."""
    reason: str = ""
    """Of its state, in words."""
    cause: str | None = None
    """What the change looks like."""
    first: int | None = None
    """Joint to look at first, if it is another one."""

    @property
    def shown(self) -> str:
        """Its state, or that it is excused or an alarm stands."""
        if self.alarm is None:
            return "excused" if self.excused else self.state
        return "alarm" if self.alarm.acknowledged is None else "known"

    @property
    def since(self) -> str:
        """Night from which on it is not as it was."""
        return "" if self.alarm is None else self.alarm.since

    @property
    def text(self) -> str:
        """What is said of its alarm."""
        return "" if self.alarm is None else self.alarm.text


@dataclass(frozen=True)
class RobotSummary:
    """One robot."""

    name: str
    joints: tuple[JointSummary, ...]
    """Its joints."""
    last: NightRow | None
    """What became of its last night; None if it has none."""
    undated: NightRow | None = None
    """What became of files that tell no night; None without any."""
    missing: str = ""
    """First night since which it has no recordings but the cell has; empty if it rests, or has."""
    gone: bool = False
    """Whether somebody has said that it has none."""
    gathering: bool = False
    """Whether its last night became part of a baseline though an earlier one was complete."""
    lately: tuple[Event, ...] = ()
    """What was said within a month of joints at fault for which no alarm stood, or does."""

    @property
    def several_programs(self) -> bool:
        """Whether a joint's row has to name its program."""
        return len({joint.program for joint in self.joints}) > 1

    @property
    def last_night(self) -> str:
        """Its last night; empty without any."""
        return self.last.night if self.last else ""

    @property
    def failure(self) -> NightRow | None:
        """Its last night if that could not be judged at all, or files that may be of it."""
        failed = self.last is not None and self.last.status in UNJUDGED
        return self.undated or (self.last if failed else None)

    @property
    def broken(self) -> bool:
        """Whether nothing of its last night could be judged, or some of it may be lost."""
        return not self.gone and (self.last is None or self.failure is not None)

    @property
    def of_last_night(self) -> str:
        """What became of it as a whole; empty where its joints tell how it stands."""
        if self.gone:
            return "gone"
        if self.broken:
            return "failed"
        if self.missing:
            return "missing"
        if self.gathering:
            return "gathering"
        assert self.last is not None
        return self.last.status if self.last.status in ("partial", "baseline") else ""

    @property
    def unwatched(self) -> bool:
        """Whether it cannot be said for sure how it is: of its last night something is missing."""
        if self.gone:
            return False
        # a baseline's night has a reason, too, if not all of it could be used
        in_part = bool(self.last and self.last.why) or any(
            (joint.state, joint.night) == ("insufficient-data", self.last_night)
            for joint in self.joints
        )
        return in_part or self.of_last_night in ("failed", "missing", "gathering")

    @property
    def alarms(self) -> list[JointSummary]:
        """Joints with an alarm that nobody has acknowledged, worst first."""
        found = [joint for joint in self.joints if joint.shown == "alarm"]
        return sorted(found, key=_worst_first)

    @property
    def alarms_by_joint(self) -> list[list[JointSummary]]:
        """Alarms of each joint, of one program each, in their order: one repair is for them all."""
        found: dict[int, list[JointSummary]] = {}
        for one in self.alarms:
            found.setdefault(one.axis, []).append(one)
        return list(found.values())

    def shown_of(self, joint: JointSummary) -> str:
        """Return a joint's state, or what became of the last night if that is worse."""
        if self.gone and joint.shown != "alarm":
            return "gone"
        of_night = self.of_last_night
        if of_night == "partial" and joint not in self._in_part:
            of_night = ""
        return min(joint.shown, of_night or "healthy", key=SEVERITY.index)

    @property
    def _in_part(self) -> Sequence[JointSummary]:
        """Joints that the last night's recordings did not tell of in full; all if nobody knows."""
        own = [one for one in self.joints if one.in_part or one.night < self.last_night]
        return own or self.joints

    @property
    def shown(self) -> str:
        """The worst of its joints, or what became of its last night."""
        shown = [self.shown_of(joint) for joint in self.joints]
        return min(shown, key=SEVERITY.index, default=self.of_last_night or "failed")

    @property
    def reasons(self) -> Iterator[dict[str, Any]]:
        """Why it is not healthy, but for its alarms, whose words are their own: for programs."""
        of_night = self.of_last_night
        why = self.failure.why if self.failure else self.last.why if self.last else ""
        if of_night == "missing":
            why = f"no file since {self.missing}"
        elif of_night == "gathering":
            why = "its last night is part of another condition's baseline"
        elif of_night == "failed" and not why:
            why = "no recording"
        if of_night == "gone":
            why = "no recordings, acknowledged"
        if of_night and (why or of_night != "baseline"):
            night = self.failure.night if self.failure else self.last_night
            yield {"kind": of_night, "axis": None, "program": None, "night": night, "text": why}
        for one in self.joints:
            if one.alarm is None and one.shown not in ("healthy", "baseline"):
                yield {
                    "kind": one.shown,
                    "axis": one.axis,
                    "program": one.program,
                    "night": one.night,
                    "text": one.reason,
                    "cause": one.cause,
                }
        for said in self.lately:
            yield {
                "kind": "alone",
                "axis": said.axis,
                "program": None,
                "night": said.time,
                "text": said.text,
            }


@dataclass(frozen=True)
class Summary:
    """A cell, its robots by name."""

    robots: tuple[RobotSummary, ...]

    def only(self, names: Sequence[str]) -> "Summary":
        """Return some robots of the cell."""
        return Summary(tuple(robot for robot in self.robots if robot.name in names))

    def needing(self) -> list[RobotSummary]:
        """Return the robots that need a look, worst first."""
        found = [one for one in self.robots if one.alarms or one.broken]
        return sorted(
            found,
            key=lambda one: (
                SEVERITY.index(one.shown),
                _worst_first(one.alarms[0]) if one.alarms else (),
                one.name,
            ),
        )

    def headline(self) -> str:
        """Return the cell in one sentence."""
        if not self.robots:
            return "No robot has been looked at yet"
        counts = Counter(one.shown for one in self.robots)
        n_alarms = sum(len(one.alarms_by_joint) for one in self.robots)
        parts = []
        if n_alarms:
            joints = "joint" if n_alarms == 1 else "joints"
            parts.append(f"{n_alarms} {joints} of {_robots(counts['alarm'])} with an alarm")
        for state, words in (
            ("failed", "could not be judged"),
            ("missing", "without recordings"),
            ("gathering", "not judged while a baseline is recorded"),
            ("fault", "with a fault in the last night, no alarm yet"),
            ("changed", "changed in the last night, no alarm yet"),
            ("insufficient-data", "with a joint that was not judged"),
            ("partial", "judged in part"),
            ("excused", "with a joint not told from unusual conditions"),
            ("known", "with an acknowledged alarm"),
            ("gone", "without recordings, acknowledged"),
            ("baseline", "recording the baseline"),
            ("healthy", "healthy"),
        ):
            if counts[state]:
                # where no line of the morning need name them
                named = state not in ("failed", "known", "gone", "baseline", "healthy")
                names = some([_named(one) for one in self.robots if one.shown == state])
                parts.append(f"{_robots(counts[state])} {words}" + (f": {names}" if named else ""))
        beside = [
            one.name
            for one in self.robots
            if one.shown in ("alarm", "fault", "changed")
            and any(joint.state == "insufficient-data" for joint in one.joints)
        ]
        if beside:
            parts.append(f"{_robots(len(beside))} of these with a joint not judged: {some(beside)}")
        return "; ".join(parts)


def summarise(
    history: History, robots: Sequence[str] = (), *, by_first_nights: bool = True
) -> Summary:
    """Read how a cell stands.

    Parameters
    ----------
    history
        Of the cell.
    robots
        Robots of the cell that may have no night yet.
    by_first_nights
        Whether baselines are the first nights, not given by dates or files.
    """
    # of a joint's alarms under several conditions the latest that nobody knows of
    by_news = sorted(
        history.alarms(standing=True), key=lambda one: (one.acknowledged is None, one.raised)
    )
    standing = {(alarm.robot, alarm.program, alarm.axis): alarm for alarm in by_news}
    last: dict[str, NightRow] = {}
    undated: dict[str, NightRow] = {}
    for night in history.nights().values():
        if not night.night:
            undated[night.robot] = night
        if night.robot not in last or night.night > last[night.robot].night:
            last[night.robot] = night
    declared = history.declared()
    begun = {
        robot: night
        for robot, night in begun_anew(declared)
        if robot in last and night <= last[robot].night
    }
    gone = {one.robot: one.night for one in declared if one.kind == "gone"}
    # the first and its reminders; those of before its last night are over
    missing: dict[str, str] = {}
    for row in history.rows("SELECT robot, time FROM event WHERE kind = 'missing' ORDER BY time"):
        if row["robot"] in last and row["time"] > last[row["robot"]].night:
            missing.setdefault(row["robot"], row["time"])
    complete: dict[str, str] = {}
    for row in history.rows(COMPLETE):
        # a baseline that a user began, or gave, is recorded as any first one: nobody was watched
        # by it yet
        if row["since"] == begun.get(row["robot"], "" if by_first_nights else None):
            complete[row["robot"]] = min(row["night"], complete.get(row["robot"], "9999"))
    joints: dict[str, list[JointSummary]] = {}
    query = (
        "SELECT robot, program, axis, state, max(night) AS night, report, health_index, reason, "
        "cause "
        "FROM verdict JOIN measure USING (robot, program, axis, night) "
        "GROUP BY robot, program, axis"
    )
    for row in history.rows(query):
        alarm = standing.get((row["robot"], row["program"], row["axis"]))
        since = begun.get(row["robot"], "")
        if alarm is None and row["night"] < since:
            # against a baseline that somebody has replaced
            row |= {"state": "baseline", "health_index": None, "reason": "", "cause": None}
        joints.setdefault(row["robot"], []).append(_joint(row, alarm))
    lately = _lately(history, last, begun)
    names = sorted({*last, *joints, *robots})
    return Summary(
        tuple(
            RobotSummary(
                name,
                tuple(joints.get(name, ())),
                last.get(name),
                undated.get(name),
                missing.get(name, ""),
                name in gone
                and name not in undated
                and (name not in last or last[name].night < gone[name]),
                name in last
                and last[name].status == "baseline"
                and complete.get(name, "9999") < last[name].night,
                lately.get(name, ()),
            )
            for name in names
        )
    )


def _lately(
    history: History, last: Mapping[str, NightRow], begun: Mapping[str, str]
) -> dict[str, tuple[Event, ...]]:
    """Return what holds of what was said of single nights at fault, by robot."""
    raised: dict[tuple[str, int | None], str] = {}
    for alarm in history.alarms():
        until = "9999" if alarm.cleared is None else alarm.raised
        raised[alarm.robot, alarm.axis] = max(until, raised.get((alarm.robot, alarm.axis), ""))
    found: dict[tuple[str, str], Event] = {}
    query = "SELECT * FROM event WHERE kind = 'fault' ORDER BY time, axis"
    for event in (Event(**row) for row in history.rows(query)):
        newest = last[event.robot].night if event.robot in last else ""
        anew = max(begun.get(event.robot, ""), raised.get((event.robot, event.axis), ""))
        if newest and event.time >= anew and day(newest) - day(event.time) <= LATELY:
            found[event.robot, event.text] = event
    robots = {robot for robot, _ in found}
    return {
        name: tuple(event for (robot, _), event in found.items() if robot == name)
        for name in robots
    }


def _joint(row: Mapping[str, Any], alarm: AlarmRow | None) -> JointSummary:
    told = told_by(row["reason"])
    return JointSummary(
        row["axis"],
        row["program"],
        row["state"],
        row["night"],
        row["report"] or "",
        row["health_index"],
        alarm,
        told.excused,
        told.in_part,
        told.text,
        row["cause"],
        told.first,
    )


def _worst_first(joint: JointSummary) -> tuple[int, bool, float]:
    behind = joint.first is not None
    return SEVERITY.index(joint.state), behind, -(joint.health_index or 0.0)


def _named(robot: RobotSummary) -> str:
    return f"{robot.name} since {robot.missing}" if robot.shown == "missing" else robot.name


def _robots(count: int) -> str:
    return f"{count} robot" if count == 1 else f"{count} robots"
