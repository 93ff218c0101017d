"""Where a cell's recordings lie: files that fit a pattern with {robot} and {night}.

A pattern is a path with shell wildcards, on a mounted file system or, read only, an address that
pyarrow's file systems know, such as ``s3://bucket/logs/{robot}/{night}/*.parquet``.
"""

import functools
import glob
import hashlib
import json
import os
import re
import shutil
import stat
import uuid
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from datetime import date
from itertools import islice
from pathlib import Path

import pyarrow as pa
import pyarrow.fs
from pydantic import TypeAdapter

from opamc_cli.errors import InputError, OpamcError
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run

BLOCK_BYTES = 1 << 22

NO_TEXT = "\ufffd"
"""In the place of a sign of a name that is no text."""

NOT_IN_A_LINE = re.compile("[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Signs that break or turn a line, and bytes that are none."""

NAMELESS = "its name holds control characters or is not UTF-8; rename it"

A_NIGHT = r"\d{4}[-_.]?\d{1,2}[-_.]?\d{1,2}"
"""What stands for {night}, or is meant to; files of other names are strays, and no logs."""

MOST_UNNAMED = 100
"""Robots that nobody has named that are found: of thousands each costs a millisecond a start."""

MOST_LOOKED_AT = 100
"""Files of a robot that nobody has named that are looked at for a recording."""

A_NAME = r"[^/.][^/]*?"
"""What stands for {night} in a stray's path."""


@dataclass(frozen=True)
class LogFile:
    """A recording that was found."""

    path: str
    """Where it is: a path, or an address with ``://``."""
    robot: str
    """Name in the place of {robot}."""
    night: str | None
    """YYYY-MM-DD in the place of {night}; None where the pattern has none."""
    size: int
    mtime_ns: int
    """With `size`: to tell whether it is the file that it was."""

    @property
    def remote(self) -> bool:
        """Whether it has to be fetched before it can be read."""
        return "://" in self.path


@dataclass(frozen=True)
class Facts:
    """What a recording says of itself, or why it cannot be read."""

    program: str = ""
    """Its name; empty if the recording names none."""
    speed_percent: float | None = None
    payload_kg: float | None = None
    sampling_rate_hz: float | None = None
    """With `speed_percent`, `payload_kg`: its conditions."""
    started_at: str | None = None
    """ISO 8601."""
    robot: str = ""
    """That it names; empty if it names none."""
    error: str = ""
    """Why it is no recording; empty if it is one."""
    samples: str = ""
    """SHA-256 of its currents' samples; empty if they never change, or nobody looked."""

    @classmethod
    def of(cls, info: RunInfo) -> "Facts":
        """Take what matters from a recording's metadata."""
        return cls(
            info.program or "",
            info.speed_percent,
            info.payload_kg,
            info.sampling_rate_hz,
            info.started_at,
            info.robot or "",
        )

    @classmethod
    def from_json(cls, text: str) -> "Facts":
        """Read what `to_json` wrote.

        Raises
        ------
        ValueError
            If it is something else.
        """
        return _facts().validate_json(text)

    def to_json(self) -> str:
        """Return the facts as the history keeps them."""
        return json.dumps(asdict(self), sort_keys=True)


@functools.cache
def _facts() -> TypeAdapter[Facts]:
    """Return what checks facts; to make it takes a thousand times as long as to use it."""
    return TypeAdapter(Facts)


def find_logs(pattern: str, robots: tuple[str, ...] | None) -> list[LogFile]:
    """List the recordings that fit a pattern, sorted by path.

    Parameters
    ----------
    pattern
        With {robot} and maybe {night}.
    robots
        Names that may stand in the place of {robot}; None: any.

    Raises
    ------
    InputError
        If an address cannot be listed.
    """
    return _sorted(_listed(pattern, robots), pattern, robots)


def find_logs_and_strays(
    pattern: str, robots: tuple[str, ...] | None
) -> tuple[list[LogFile], list[tuple[str, str]]]:
    """List as `find_logs` does, and robot and path of what would be logs, were it called a night.

    A path ends with what stands in the place of {night}; {robot} has to be in the pattern.
    """
    listed = [*_listed(pattern, robots)]
    strays = set()
    for path, _, _ in listed if "{night}" in pattern else ():
        found = None if fits(pattern, path) else _expression(pattern, A_NAME).fullmatch(path)
        if found is not None:
            robot, path = map(_in_a_line, (found["robot"], path[: found.end("night")]))
            if robots is None or robot in robots:
                strays.add((robot, path))
    return _sorted(listed, pattern, robots), sorted(strays)


def find_unnamed(pattern: str, robots: tuple[str, ...]) -> list[tuple[str, str]]:
    """List the robots that have recordings beside some, and where.

    Parameters
    ----------
    pattern
        With {robot}; the folders of its place are listed, and of others than these robots' a file
        is looked for.
    robots
        Names.
    """
    head = pattern[: (f"{pattern}/").index("/", pattern.index("{robot}"))]
    places = _expression(head)
    found: dict[str, str] = {}
    looked = set(robots)
    if "://" in pattern:
        listed: Iterable[str] = (path for path, _, _ in _remote(pattern))
    else:
        listed = glob.iglob(_wild(head), recursive=True)  # noqa: PTH207
    for at in sorted(listed):
        if len(found) == MOST_UNNAMED:
            break
        of_file = _expression(pattern).fullmatch(at)
        place = of_file or places.fullmatch(at)
        if place is None or place["robot"] in looked:
            continue
        robot = place["robot"]
        inside = [at]
        if of_file is None:
            looked.add(robot)
            below = glob.escape(at) + _wild(pattern[len(head) :], robot)
            inside = [*islice(glob.iglob(below, recursive=True), MOST_LOOKED_AT)]  # noqa: PTH207
        if any(fits(pattern, path) for path in inside):
            found[_in_a_line(robot)] = _in_a_line(at[: place.end("robot")])
            looked.add(robot)
    return sorted(found.items())


def _sorted(
    listed: Iterable[tuple[str, int, int]], pattern: str, robots: tuple[str, ...] | None
) -> list[LogFile]:
    return sorted(_as_logs(listed, pattern, robots), key=lambda one: (one.robot, one.path))


def fits(pattern: str, path: str) -> bool:
    """Whether a recording that is there no more was one of a pattern's."""
    return _expression(pattern).fullmatch(path) is not None


def robot_of(pattern: str, path: str) -> str | None:
    """Return whose recording a file is to a pattern, empty if it is all robots'; None if none's."""
    found = _expression(pattern).fullmatch(path)
    return None if found is None else found.groupdict().get("robot") or ""


def holds_logs(pattern: str, folder: str) -> bool:
    """Whether recordings of a pattern may lie in a folder, or below it."""
    return any(_expression(of).fullmatch(folder) for of in _folders(pattern))


def find_closed(pattern: str, robots: tuple[str, ...]) -> list[LogFile]:
    """List the folders of some robots that may not be listed: whatever lies there is not missing.

    Parameters
    ----------
    pattern, robots
        As of `find_logs`; of other names a folder may be closed for good (``lost+found``).
    """
    folders = () if "://" in pattern else _folders(pattern)
    return [log for of in folders for log in _as_logs(_closed(of, robots), of, robots)]


def _as_logs(
    listed: Iterable[tuple[str, int, int]], pattern: str, robots: tuple[str, ...] | None
) -> Iterator[LogFile]:
    expression = _expression(pattern)
    for path, size, mtime_ns in listed:
        found = expression.fullmatch(path)
        if found is None:
            continue
        named = found.groupdict()
        robot, night = named.get("robot") or "", _as_night(named.get("night"))
        path, robot = map(_in_a_line, (path, robot))
        if robots is not None and robot and robot not in robots:
            continue
        # one baseline may be of several robots
        for each in (robot,) if robot else robots or ():
            yield LogFile(path, each, night, size, mtime_ns)


def read_facts(log: LogFile, at: Path) -> tuple[str, Facts]:
    """Read a recording once: its SHA-256 and what it says of itself.

    Parameters
    ----------
    log
        The recording.
    at
        Where it, or its copy, can be opened.

    Returns
    -------
    tuple of str and Facts
        The hash is empty if the system refused to read it.
    """
    digest = hashlib.sha256()
    if NO_TEXT in log.path:
        return digest.hexdigest(), Facts(error=f"{log.path}: {NAMELESS}")
    try:
        with at.open("rb") as file:
            while block := file.read(BLOCK_BYTES):
                digest.update(block)
        with Run(at) as run:
            facts = replace(Facts.of(run.info), samples=run.currents_sha256)
    except OpamcError as error:
        facts = Facts(error=str(error).replace(str(at), log.path))
    except OSError as error:
        return "", Facts(error=f"{log.path}: cannot be read ({error.strerror or error})")
    return digest.hexdigest(), facts


def fetch(log: LogFile, to: Path) -> Path:
    """Return where a recording can be opened: its own place, or a copy in the folder `to`.

    Raises
    ------
    InputError
        If it cannot be copied.
    """
    if not log.remote:
        return Path(log.path)
    copy = to / copy_name(log)
    if copy.exists():
        return copy
    to.mkdir(parents=True, exist_ok=True)
    part = copy.with_suffix(f".{uuid.uuid4().hex}.part")  # other machines may fetch it, too
    try:
        filesystem, path = pa.fs.FileSystem.from_uri(log.path)
        with filesystem.open_input_stream(path) as source, part.open("wb") as target:
            shutil.copyfileobj(source, target, BLOCK_BYTES)
        part.replace(copy)
    except (OSError, pa.ArrowException) as error:
        part.unlink(missing_ok=True)
        msg = f"{log.path}: cannot be fetched ({_first_line(error)}); check address and credentials"
        raise InputError(msg) from error
    return copy


def copy_name(log: LogFile) -> str:
    """Return how `fetch` calls its copy: another name for other bytes."""
    told = f"{log.path} {log.size} {log.mtime_ns}"
    return f"{hashlib.sha256(told.encode()).hexdigest()}.parquet"


def _in_a_line(text: str) -> str:
    return NOT_IN_A_LINE.sub(NO_TEXT, text)


def _listed(pattern: str, robots: tuple[str, ...] | None) -> Iterator[tuple[str, int, int]]:
    """Yield path, size and time in ns of what fits a pattern; at an address, of all below it."""
    return _remote(pattern) if "://" in pattern else _local(pattern, robots)


def _local(pattern: str, robots: tuple[str, ...] | None) -> Iterator[tuple[str, int, int]]:
    for path in _fitting(pattern, robots):
        try:
            state = os.stat(path)  # noqa: PTH116
        except OSError:  # gone between listing and looking
            if os.path.islink(path):  # noqa: PTH114 - or on a disk that is not there
                yield path, 0, 0
            continue
        if stat.S_ISREG(state.st_mode):  # a pipe or a folder is no log
            yield path, state.st_size, state.st_mtime_ns


def _folders(pattern: str) -> Iterator[str]:
    """Yield the patterns of the folders of one robot that recordings lie in."""
    for end in (at for at, sign in enumerate(pattern) if sign == "/"):
        if "{robot}" in pattern[:end]:
            yield pattern[:end]


def _closed(pattern: str, robots: tuple[str, ...] | None) -> Iterator[tuple[str, int, int]]:
    """Yield folders that may not be listed: whatever lies there is not missing."""
    for path in _fitting(pattern, robots):
        if not os.access(path, os.R_OK | os.X_OK) and os.path.isdir(path):  # noqa: PTH112
            yield path, 0, 0


def _wild(pattern: str, robot: str | None = None) -> str:
    named = "*" if robot is None else glob.escape(robot)
    return pattern.replace("{night}", "*").replace("{robot}", named)


def _fitting(pattern: str, robots: tuple[str, ...] | None) -> Iterator[str]:
    for robot in robots if robots is not None and "{robot}" in pattern else (None,):
        # plain strings: tens of thousands of Path objects take a second
        yield from glob.iglob(_wild(pattern, robot), recursive=True)  # noqa: PTH207


def _remote(pattern: str) -> Iterator[tuple[str, int, int]]:
    scheme, _, rest = pattern.partition("://")
    fixed = re.split(r"[*?\[{]", rest, maxsplit=1)[0].rpartition("/")[0]
    try:
        filesystem, root = pa.fs.FileSystem.from_uri(f"{scheme}://{fixed}")
        selector = pa.fs.FileSelector(root, recursive=True, allow_not_found=True)
        listed = filesystem.get_file_info(selector)
    except (OSError, pa.ArrowException) as error:
        msg = f"{pattern}: cannot be listed ({_first_line(error)}); check address and credentials"
        raise InputError(msg) from error
    for info in listed:
        if info.type == pa.fs.FileType.File:
            below = info.path[len(root) :].lstrip("/")
            yield f"{scheme}://{fixed}/{below}", info.size, info.mtime_ns or 0


@functools.cache
def _expression(pattern: str, a_night: str = A_NIGHT) -> re.Pattern[str]:
    """Turn a pattern into a regular expression with the groups robot and night."""
    parts = re.split(r"(\{robot\}|\{night\}|\*\*/|\*|\?|\[[^\]]*\])", pattern)
    known: set[str] = set()
    text = ""
    for part in parts:
        if part in ("{robot}", "{night}"):
            name = part[1:-1]
            form = r"[^/]+?" if name == "robot" else a_night
            text += f"(?P={name})" if name in known else f"(?P<{name}>{form})"
            known.add(name)
        elif part.startswith("["):
            text += part.replace("[!", "[^")
        else:
            text += {"**/": r"(?:.*/)?", "*": r"[^/]*", "?": r"[^/]"}.get(part, re.escape(part))
    return re.compile(text)


def _as_night(text: str | None) -> str | None:
    """Write a day as YYYY-MM-DD; None where it is none, and the recording itself has to tell."""
    try:
        return None if text is None else date.fromisoformat(text).isoformat()
    except ValueError:
        return None


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0].rstrip(".") if str(error).strip() else "no reason"
