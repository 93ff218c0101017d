"""How a cell stands: robots and joints with their alarms, for terminal, page and metrics."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from opamc_cli.stages.nightly.inputs.recordings import some
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import UNJUDGED, AlarmRow, NightRow, begun_anew

SEVERITY = (
    "alarm",
    "failed",
    "fault",
    "changed",
    "insufficient-data",
    "known",
    "baseline",
    "healthy",
)
"""Worst first; known: an alarm that was acknowledged."""


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

    @property
    def shown(self) -> str:
        """Its state, or that an alarm stands."""
        if self.alarm is None:
            return self.state
        return "alarm" if self.alarm.acknowledged is None else "known"

    @property
    def since(self) -> str:
        """Night from which on it is not as it was."""
        return "" if self.alarm is None else self.alarm.since


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
        return self.last is None or self.failure is not None

    @property
    def in_part(self) -> bool:
        """Whether a joint of its last night could not be judged."""
        return any(
            (joint.state, joint.night) == ("insufficient-data", self.last_night)
            for joint in self.joints
        )

    @property
    def alarms(self) -> list[JointSummary]:
        """Joints with an alarm that nobody has acknowledged, worst first."""
        found = [joint for joint in self.joints if joint.shown == "alarm"]
        return sorted(found, key=_worst_first)

    def text_of(self, joint: JointSummary) -> str:
        """Return what is said of a joint's alarm: a joint at fault shakes the others."""
        assert joint.alarm is not None
        more = [
            one
            for one in self.joints
            if one.alarm
            and (one.program, one.night) == (joint.program, joint.night)
            and (one.health_index or 0.0) > (joint.health_index or 0.0)
        ]
        if not more:
            return joint.alarm.text
        worst = max(more, key=lambda one: one.health_index or 0.0)
        return f"{joint.alarm.text}; axis {worst.axis} changed more that night, look there first"

    @property
    def shown(self) -> str:
        """The worst of its joints, or what became of its last night."""
        shown = [joint.shown for joint in self.joints]
        if self.broken:
            shown.append("failed")
        elif self.last is not None and self.last.status == "baseline":
            shown.append("baseline")
        return min(shown, key=SEVERITY.index, default="failed")


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
        n_alarms = sum(len(one.alarms) for one in self.robots)
        parts = []
        if n_alarms:
            joints = "joint" if n_alarms == 1 else "joints"
            parts.append(f"{n_alarms} {joints} of {_robots(counts['alarm'])} with an alarm")
        for state, words in (
            ("failed", "could not be judged"),
            ("fault", "with a fault in the last night, no alarm yet"),
            ("changed", "changed in the last night, no alarm yet"),
            ("insufficient-data", "with a joint that was not judged"),
            ("known", "with an acknowledged alarm"),
            ("baseline", "recording the baseline"),
            ("healthy", "healthy"),
        ):
            if counts[state]:
                # where no line of the morning need name them
                named = state in ("fault", "changed", "insufficient-data")
                names = some([one.name for one in self.robots if one.shown == state])
                parts.append(f"{_robots(counts[state])} {words}" + (f": {names}" if named else ""))
        return "; ".join(parts)


def summarise(history: History, robots: Sequence[str] = ()) -> Summary:
    """Read how a cell stands.

    Parameters
    ----------
    history
        Of the cell.
    robots
        Robots of the cell that may have no night yet.
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
    begun = {
        robot: night
        for robot, night in begun_anew(history.declared())
        if robot in last and night <= last[robot].night
    }
    joints: dict[str, list[JointSummary]] = {}
    query = (
        "SELECT robot, program, axis, state, max(night) AS night, report, health_index "
        "FROM verdict GROUP BY robot, program, axis"
    )
    for row in history.rows(query):
        alarm = standing.get((row["robot"], row["program"], row["axis"]))
        since = begun.get(row["robot"], "")
        if alarm is None and row["night"] < since:
            # against a baseline that somebody has replaced
            row |= {"state": "baseline", "health_index": None}
        joints.setdefault(row["robot"], []).append(_joint(row, alarm))
    names = sorted({*last, *joints, *robots})
    return Summary(
        tuple(
            RobotSummary(name, tuple(joints.get(name, ())), last.get(name), undated.get(name))
            for name in names
        )
    )


def _joint(row: Mapping[str, Any], alarm: AlarmRow | None) -> JointSummary:
    return JointSummary(
        row["axis"],
        row["program"],
        row["state"],
        row["night"],
        row["report"] or "",
        row["health_index"],
        alarm,
    )


def _worst_first(joint: JointSummary) -> tuple[int, float]:
    return SEVERITY.index(joint.state), -(joint.health_index or 0.0)


def _robots(count: int) -> str:
    return f"{count} robot" if count == 1 else f"{count} robots"
