"""What is recorded of a cell: every file with its hash and facts, read once in its life."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cached_property
from pathlib import Path

from opamc_cli.config.cell import CellConfig
from opamc_cli.errors import InputError
from opamc_cli.stages.recordings.sessions import night_of
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import FileRow
from opamc_cli.storage.logs import (
    Facts,
    LogFile,
    fetch,
    find_closed,
    find_logs,
    find_logs_and_strays,
    find_unnamed,
    fits,
    read_facts,
)
from opamc_cli.storage.schemas import files

EARLIEST_NIGHT = "2001-01-01"
"""Clocks that were never set begin in 1970, 1980 or 2000."""

CLOCKS_DIFFER = timedelta(hours=1)
"""A local time that was stated as UTC in summer, or a logger whose clock nobody sets."""

REMEMBER_EVERY = 50
"""Files that are read between two writes to the history: what a kill costs."""


@dataclass(frozen=True)
class Recording:
    """One recording of a robot."""

    log: LogFile
    """Where it lies."""
    night: str
    """YYYY-MM-DD that it counts to; empty if nothing tells."""
    sha256: str
    """Of its bytes."""
    facts: Facts
    """What it says of itself."""

    @cached_property
    def name(self) -> str:
        """How tables call it: its night and its file's stem."""
        file = self.log.path.rpartition("/")[2]
        return f"{self.night}/{file.rpartition('.')[0] or file}"

    @property
    def identity(self) -> str:
        """How the record of a night calls it."""
        return f"{self.name} {self.sha256[:24]}"

    @cached_property
    def condition(self) -> str:
        """The conditions that recordings to be compared have in common, in words."""
        facts = self.facts
        parts = (
            (facts.sampling_rate_hz, "Hz"),
            (facts.speed_percent, "%"),
            (facts.payload_kg, "kg"),
        )
        return ", ".join(f"{value:g} {unit}" for value, unit in parts if value is not None)


@dataclass(frozen=True)
class CellRecordings:
    """All recordings of a cell."""

    by_robot: dict[str, list[Recording]]
    """Recordings of each robot, by path; robots without any have an empty list."""
    baseline_by_robot: dict[str, list[Recording]]
    """Those that `baseline.runs` names."""
    gone_by_robot: dict[str, list[Recording]]
    """Recordings of which only the history knows any more."""
    gone_of_baseline: dict[str, list[Recording]]
    """Those that `baseline.runs` names."""
    beside: dict[str, list[Recording]]
    """What is known of the recordings of robots that are not asked for."""
    strays: list[tuple[str, str]]
    """Robot and path of recordings that lie in the place of a night and are called otherwise."""
    unnamed: list[tuple[str, str]]
    """Robots with recordings that the cell's file does not name, and where these lie."""


def find_recordings(
    cell: CellConfig, history: History, only: Sequence[str] | None, copies: Path
) -> CellRecordings:
    """List a cell's recordings; read those that are new or have another size or time than before.

    Parameters
    ----------
    cell
        What to look for.
    history
        What is remembered of files, and where new ones are remembered.
    only
        Robots that are asked for; None: all.
    copies
        Folder for copies of what lies in an object store.

    Raises
    ------
    InputError
        If nothing is found, or a robot that was asked for is none of the cell's.
    """
    named = None if cell.robots == "auto" else tuple(cell.robots)
    logs, strays = find_logs_and_strays(cell.runs, named)
    unnamed = find_unnamed(cell.runs, named) if named and only is None else []
    judged = {robot for robot, _ in history.nights()}
    # a robot whose logs were cleared away, or are out of reach, keeps its alarm
    robots = sorted(named or {log.robot for log in logs} | judged)
    logs += find_closed(cell.runs, tuple(robots))
    fixed = find_logs(cell.baseline.runs, tuple(robots)) if cell.baseline.runs else []
    strays = [
        (robot, path)
        for robot, path in strays
        if not Path(path).is_relative_to(cell.out)
        and not any(log.path.startswith(path) for log in fixed)
    ]
    if not logs and not judged:
        of = f" of {some(named)}" if named else ""
        msg = f"{cell.runs}: no file{of} fits this pattern; check `runs` of the cell's file"
        msg += f"; {said_of_strays([path for _, path in strays])}" if strays else ""
        raise InputError(msg)
    known = sorted({*robots, *judged})
    for name in only or ():
        if name not in known:
            msg = f"--robot {name}: is none of the cell's robots; it has {some(known)}"
            raise InputError(msg)
    wanted = [robot for robot in robots if only is None or robot in only]
    reader = _Reader(cell, history, copies)
    result = CellRecordings(
        {robot: [] for robot in wanted},
        {robot: [] for robot in wanted},
        {robot: [] for robot in wanted},
        {robot: [] for robot in wanted},
        {},
        [one for one in strays if only is None or one[0] in only],
        [one for one in unnamed if not Path(one[1]).is_relative_to(cell.out)],
    )
    for found, by_robot in ((logs, result.by_robot), (fixed, result.baseline_by_robot)):
        for log in found:
            if log.robot in by_robot:
                by_robot[log.robot].append(reader.read(log))
            else:
                result.beside.setdefault(log.robot, []).extend(reader.known(log))
    reader.finish()
    for one in reader.gone({log.path for log in (*logs, *fixed)}):
        robot, path = one.log.robot, one.log.path
        if robot in wanted and fits(cell.runs, path):
            result.gone_by_robot[robot].append(one)
        if robot in wanted and cell.baseline.runs and fits(cell.baseline.runs, path):
            result.gone_of_baseline[robot].append(one)
    return result


class _Reader:
    """Reads what is not remembered, and remembers it."""

    def __init__(self, cell: CellConfig, history: History, copies: Path) -> None:
        self._history = history
        self._copies = copies
        self._known = history.files()
        self._new: list[FileRow] = []
        self._day_starts: dict[str, float] = {}
        # the logger's day may have begun already
        self._now = datetime.now(UTC)
        self._today = self._now.date().isoformat()
        self._latest_night = (self._now.date() + timedelta(1)).isoformat()
        self._cell = cell

    def known(self, log: LogFile) -> Iterator[Recording]:
        """Yield a recording as it is remembered, if it is that still."""
        if row := self._row(log):
            yield self._recording(log, row)

    def _row(self, log: LogFile) -> FileRow | None:
        row = self._known.get(log.path)
        same = row is not None and (row.size, row.mtime_ns) == (log.size, log.mtime_ns)
        return row if same else None

    def read(self, log: LogFile) -> Recording:
        if not _is_free(log.robot):
            taken = f"a robot cannot be called {log.robot}: so is a file of the results; rename it"
            return Recording(log, log.night or "", "", Facts(error=taken))
        row = self._row(log)
        if row is None:
            try:
                sha256, facts = read_facts(log, fetch(log, self._copies))
            except InputError as error:
                sha256, facts = "", Facts(error=str(error))
            row = FileRow(
                log.path, log.robot, log.night, log.size, log.mtime_ns, sha256, facts.to_json()
            )
            if sha256:  # what could not be read for want of permission is tried again
                self._new.append(row)
            if len(self._new) >= REMEMBER_EVERY:
                self.finish()
        return self._recording(log, row)

    def gone(self, there: set[str]) -> Iterator[Recording]:
        """Yield what is remembered of recordings that are not there."""
        for row in self._known.values():
            if row.path not in there:
                log = LogFile(row.path, row.robot, row.night, row.size, row.mtime_ns)
                yield self._recording(log, row)

    def _recording(self, log: LogFile, row: FileRow) -> Recording:
        facts = Facts.from_json(row.facts)
        told = night_of(facts.started_at, self._starts_at(log.robot))
        night = log.night or (told.isoformat() if told else None)
        if not night and not facts.error:
            facts = Facts(
                error=f"{log.path}: nothing says which night it is of: no started_at in its "
                "metadata; put {night} into `runs`, or record when it began"
            )
        elif night and not EARLIEST_NIGHT <= night <= self._latest_night:
            # it would be the first night of the baseline, or hide for years that none is new
            wrong = "lies in the future" if night > EARLIEST_NIGHT else "is one of a clock not set"
            facts = Facts(
                error=f"{log.path}: its night {night} {wrong}; check the clock of the logger, and "
                "this machine's"
            )
            night = None
        elif night and night >= self._today and _began_after(facts.started_at, self._now):
            # the night of tomorrow would have all other robots missed
            facts = Facts(
                error=f"{log.path}: began at {facts.started_at}, which lies in the future; check "
                "the clock of the logger, and this machine's"
            )
            night = None
        return Recording(log, night or "", row.sha256, facts)

    def finish(self) -> None:
        if self._new:
            self._history.remember_files(self._new)
            self._new = []

    def _starts_at(self, robot: str) -> float:
        if robot not in self._day_starts:
            config = self._cell.diagnosis_of(robot, "cell")
            self._day_starts[robot] = config.score.day_starts_at
        return self._day_starts[robot]


def _began_after(started_at: str | None, now: datetime) -> bool:
    """Whether a stated instant is later than clocks differ; one without a zone may be anywhere."""
    try:
        began = datetime.fromisoformat(started_at or "")
    except ValueError:
        return False
    return began.tzinfo is not None and began > now + CLOCKS_DIFFER


def _is_free(robot: str) -> bool:
    """Whether a folder of a robot's results may have its name."""
    # disks that do not tell capitals apart would take one for the other
    name = robot.casefold()
    return not name.startswith((".", files.HISTORY)) and name not in (files.PAGE, files.METRICS)


def some(names: Sequence[str], most: int = 8) -> str:
    """Return the first names of many."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def said_of_strays(paths: Sequence[str]) -> str:
    """Say that paths are called otherwise than a night."""
    return (
        f"{some(paths, 3)}: no night by name, nothing of it is judged; call it YYYY-MM-DD, or keep "
        "it where `runs` does not look"
    )


def said_of_unnamed(places: Mapping[str, str]) -> str:
    """Say of robots with recordings that the cell's file does not name them; by name, where."""
    them = "this robot" if len(places) == 1 else "these robots"
    return (
        f"{some([*places])} not named by the cell's file: recordings in "
        f"{some([*places.values()], 3)} are not judged; name {them} under `robots`, or keep them "
        "where `runs` does not look"
    )
