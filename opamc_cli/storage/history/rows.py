"""What the history holds: one class a table, one object a row."""

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, get_args, get_type_hints

import pyarrow as pa

OF_ROBOT = (
    *("alarm", "reminder", "cleared", "fault"),
    *("not-judged", "together", "excused", "outside", "failed", "partial"),
)
"""Kinds of event that follow from the nights of one robot."""

OF_START = ("thinned", "stray", "unnamed", "silent", "gathering")
"""Kinds of event that each start finds anew."""

STANDING = ("stands", "known")
"""Kinds of what was told of an alarm that stands, if it is not or is acknowledged."""

THE_CELL = "the cell:"
"""What an event is of that is none of a robot's."""

UNJUDGED = ("failed", "broken")
"""What a night's status is if nothing of it could be judged."""

EXCUSED = "excused: "
"""What the reason begins with of a joint that is healthy, but differs, if no more than conditions
may move it; a column of its own would be another layout of the file."""

IN_PART = "in part: "
"""What the reason begins with, behind `EXCUSED`, of a joint for which not all of its night's
recordings could be used: of another joint of the same night they may have been."""

BEHIND = "behind axis {}: "
"""What the reason begins with, behind these, of a joint beside which another comes first."""


@dataclass(frozen=True)
class VerdictRow:
    """One joint in one night; the columns of table `verdict`."""

    robot: str
    program: str
    axis: int
    night: str
    state: str
    health_index: float | None
    p_value: float | None
    cause: str | None
    alarm: int
    temperature_c: float | None
    payload_kg: float | None
    speed_percent: float | None
    n_runs: int
    report: str | None
    config_hash: str
    version: str


@dataclass(frozen=True)
class MeasureRow:
    """What trend and alarm rest on beside the verdict."""

    robot: str
    program: str
    axis: int
    night: str
    baseline: str
    """Name of the baseline that the night was compared with; a series ends where it changes."""
    distance: float | None
    """Logarithm of the distance from the baseline in healthy sessions' own."""
    common: float | None
    """What of it the robot's joints have in common."""
    effect: float | None
    """Relative change behind the state."""
    harmless: int
    """Whether the change has a cause outside the joint."""
    reason: str
    """What the verdict says to do first, of a healthy joint or an unjudged one its first reason,
    behind its marks: see `told_by`."""


@dataclass(frozen=True)
class NightRow:
    """What became of one robot's night."""

    robot: str
    night: str
    key: str
    """Hash of its inputs, options and version."""
    status: str
    """done, partial, baseline, failed (will fail again) or broken (may be tried again)."""
    attempts: int = 0
    """Starts that it broke in."""
    why: str = ""
    """One sentence, if anything failed."""
    notes: str = "[]"
    """JSON list of what is worth knowing."""


@dataclass(frozen=True)
class FileRow:
    """A recording as it was when it was last read."""

    path: str
    robot: str
    night: str | None
    size: int
    mtime_ns: int
    sha256: str
    facts: str


@dataclass(frozen=True)
class Event:
    """Something that happened to a robot or one of its joints."""

    time: str
    robot: str
    axis: int | None
    kind: str
    text: str


@dataclass(frozen=True)
class Declared:
    """What a user said: a baseline from a night on, or not after all, or an alarm that is known."""

    time: str
    robot: str
    axis: int | None
    kind: str
    night: str
    why: str


@dataclass(frozen=True)
class AlarmRow:
    """One alarm, standing while `cleared` is None."""

    robot: str
    program: str
    axis: int
    raised: str
    since: str
    cleared: str | None
    acknowledged: str | None
    text: str
    trend: str


@dataclass(frozen=True)
class AlarmSpan:
    """Nights in which an alarm stands, half-open."""

    program: str
    axis: int
    raised: str
    cleared: str
    """Later than any night while it stands."""
    baseline: str
    """Name of the baseline whose nights raised it."""


class Told(NamedTuple):
    """What the reason of a measure says."""

    excused: bool
    in_part: bool
    """With `excused`: its marks."""
    first: int | None
    """Joint to look at first, if it is another one."""
    text: str
    """The reason in words."""

    def as_reason(self) -> str:
        """Return the reason with its marks."""
        behind = "" if self.first is None else BEHIND.format(self.first)
        return f"{EXCUSED * self.excused}{IN_PART * self.in_part}{behind}{self.text}"


def told_by(reason: str) -> Told:
    """Return what a reason's marks say, and the rest.

    Examples
    --------
    >>> told_by("excused: in part: It differs.")
    Told(excused=True, in_part=True, first=None, text='It differs.')
    """
    rest = reason.removeprefix(EXCUSED)
    text = rest.removeprefix(IN_PART)
    behind = re.match(BEHIND.format(r"(\d+)"), text)
    first = None if behind is None else int(behind[1])
    return Told(rest != reason, text != rest, first, text[behind.end() :] if behind else text)


def begun_anew(declared: Iterable[Declared]) -> list[tuple[str, str]]:
    """Return robot and first night of the baselines that were declared and not taken back."""
    begun: dict[tuple[str, str], None] = {}
    for one in declared:
        if one.kind == "rebaselined":
            begun[one.robot, one.night] = None
        elif one.kind == "taken-back":
            begun.pop((one.robot, one.night), None)
    return sorted(begun)


def as_notes(notes: Iterable[str]) -> str:
    """Return notes as a night keeps them."""
    return json.dumps(list(notes), ensure_ascii=False)


def arrow_schema(table: str) -> pa.Schema:
    """Return the columns of table `verdict` or `event` as exports have them."""
    row = {"verdict": VerdictRow, "event": Event}[table]
    kinds = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    types = get_type_hints(row)
    return pa.schema(
        [
            (name, next(kinds[t] for t in (*get_args(of), of) if t in kinds))
            for name, of in types.items()
        ]
    )
