"""The run format: one recording = one Parquet file, one row per sample.

A run is opened lazily: its metadata and schema are read at once, its samples only by column and
row group as they are asked for.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

from opamc_cli.config.reading import require_regular_file, shown
from opamc_cli.errors import InputError
from opamc_cli.signal.quality import LIMITS, spikes
from opamc_cli.storage.files.atomic import atomic_path
from opamc_cli.storage.files.json_documents import Document, parsed
from opamc_cli.storage.files.parquet import read_schema, reading, samples_sha256, shown_line
from opamc_cli.storage.files.paths import expand_patterns
from opamc_cli.storage.ingest.formats import FORMAT_OF_ENDING
from opamc_cli.storage.schemas.channels import (
    COLUMN,
    CURRENTS,
    LEAST_HZ,
    MOST_HZ,
    NEARLY_COLUMN,
    PHASES,
    quantity_of,
    same_clock,
)

METADATA_KEY = b"opamc"
ROW_GROUP_SAMPLES = 1 << 18
"""Samples per row group: 128 s at 2048 Hz, 19 MB for 18 float32 channels."""

RECENT_GROUPS = 2
"""Row groups kept after reading: a segment may span a boundary."""

MOST_GROUP_SAMPLES = 1 << 24
"""Rows of a row group, which is decoded at once: two hours at 2048 Hz."""

MOST_AXES = 999

LARGEST_SAMPLE = 1e9
"""More is no measurement in whatever unit; the fourth power of this is still a float32."""

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class RunInfo:
    """What a run says of itself in the schema metadata key `opamc`."""

    sampling_rate_hz: float
    """Samples per second; required, positive."""
    robot: str | None = None
    program: str | None = None
    """With `robot`: names; runs of different program or robot are not comparable."""
    speed_percent: float | None = None
    payload_kg: float | None = None
    """With `speed_percent`: conditions of the recording."""
    started_at: str | None = None
    """ISO 8601, UTC."""
    session: str | None = None
    """Name of the recording session; runs of one session are not independent."""
    source_sha256: str | None = None
    map_sha256: str | None = None
    """With `source_sha256`: of the file that the run was made from, and of the map that it was read
    by."""
    current_unit: str = "A"
    """"A", or "Nm" where a joint's torque stands for its motor's current."""

    def to_json(self) -> str:
        """Return canonical JSON without the unknown fields and an ordinary unit."""
        known = {key: value for key, value in asdict(self).items() if value is not None}
        if self.current_unit == "A":
            del known["current_unit"]
        return json.dumps(known, sort_keys=True)


@dataclass(frozen=True)
class AxisChannels:
    """Names of the columns that a run holds for one axis."""

    axis: int
    """Counted from 1."""
    columns: Mapping[str, str]
    """By channel, see `schemas.channels`."""

    @property
    def phases(self) -> tuple[str, ...]:
        """Those of its phase currents."""
        return tuple(self.columns[name] for name in PHASES if name in self.columns)

    @property
    def current(self) -> str | None:
        """That of the reported current."""
        return self.columns.get("current")

    @property
    def position(self) -> str | None:
        """That of the angle."""
        return self.columns.get("position")

    @property
    def velocity(self) -> str | None:
        """That of the speed."""
        return self.columns.get("velocity")


class Run:
    """A recording, opened lazily.

    Parameters
    ----------
    path
        The Parquet file.
    name
        How stage tables call it; the file's stem by default.

    Raises
    ------
    InputError
        If the file is missing, not Parquet, damaged, or not a run.
    """

    def __init__(self, path: Path, name: str | None = None) -> None:
        self.path = Path(path)
        self.name = name or self.path.stem
        self._file = _open_parquet(self.path)
        schema = self._file.schema_arrow
        repeated = {name for name in schema.names if schema.names.count(name) > 1}
        if repeated:
            msg = f"{self.path}: has column {shown(min(repeated))} more than once; write it again"
            raise InputError(msg)
        for group in range(self._file.num_row_groups):
            n_rows = self._file.metadata.row_group(group).num_rows
            if n_rows > MOST_GROUP_SAMPLES:
                msg = (
                    f"{self.path}: a row group has {n_rows} samples, at most {MOST_GROUP_SAMPLES} "
                    "are read at once; write it again with smaller row groups"
                )
                raise InputError(msg)
        self.info = _parse_info(self.path, schema.metadata)
        self.n_samples: int = self._file.metadata.num_rows
        self.columns: tuple[str, ...] = tuple(schema.names)
        if self.n_samples == 0:
            msg = f"{self.path}: the run has no samples (0 rows); record at least one cycle"
            raise InputError(msg)
        self._channels = _axis_channels(self.path, schema)
        self._recent: dict[tuple[int, str], Array] = {}
        self._spikes: dict[str, dict[int, float]] = {}

    @property
    def sampling_rate_hz(self) -> float:
        """Samples per second."""
        return self.info.sampling_rate_hz

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return self.n_samples / self.sampling_rate_hz

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes with a current, ascending, counted from 1."""
        return tuple(self._channels)

    @property
    def positions(self) -> dict[int, str]:
        """Columns of angles by axis; of an axis without a current, too."""
        matches = [match for match in map(COLUMN.fullmatch, self.columns) if match is not None]
        return {int(match[1]): match[0] for match in matches if match[2] == "position"}

    def channels(self, axis: int) -> AxisChannels:
        """Return the columns of one axis.

        Raises
        ------
        InputError
            If the run has no current for this axis.
        """
        if axis not in self._channels:
            have = ", ".join(str(a) for a in self.axes)
            msg = f"{self.path}: axis {axis} has no current column; the run has axes {have}"
            raise InputError(msg)
        return self._channels[axis]

    @cached_property
    def _row_group_starts(self) -> list[int]:
        starts = [0]
        for index in range(self._file.num_row_groups):
            starts.append(starts[-1] + self._file.metadata.row_group(index).num_rows)
        return starts

    def read(
        self, columns: Sequence[str], start: int = 0, stop: int | None = None
    ) -> dict[str, Array]:
        """Read samples start..stop (half-open) of some columns; nulls, spikes, infinities are NaN.

        Only the row groups that hold these samples are touched.

        Returns
        -------
        dict
            One array of shape (stop - start,) per column, in the file's own float width.
        """
        stop = self.n_samples if stop is None else min(stop, self.n_samples)
        start = max(start, 0)
        starts = self._row_group_starts
        groups = [g for g in range(len(starts) - 1) if starts[g] < stop and starts[g + 1] > start]
        if not groups:
            return {name: np.empty(0, dtype=np.float32) for name in columns}
        pieces = [self._group(group, columns) for group in groups]
        cut = slice(start - starts[groups[0]], stop - starts[groups[0]])
        return {name: _join([piece[name] for piece in pieces])[cut] for name in columns}

    def blocks(self, columns: Sequence[str]) -> Iterator[tuple[int, dict[str, Array]]]:
        """Yield (start sample, samples by column) in blocks of at most `ROW_GROUP_SAMPLES`.

        Raises
        ------
        InputError
            If the file is damaged.
        """
        start = 0
        batches = self._file.iter_batches(ROW_GROUP_SAMPLES, columns=list(columns))
        while True:
            with self._reading(columns):
                batch = next(batches, None)
            if batch is None:
                return
            yield start, {name: self._samples(name, batch.column(name), start) for name in columns}
            start += batch.num_rows

    def _group(self, group: int, columns: Sequence[str]) -> dict[str, Array]:
        """Read one row group, or take it from the last ones read.

        Segments are read one after the other and many lie in the same row group: each group is
        decoded once instead of once per segment.
        """
        missing = [name for name in columns if (group, name) not in self._recent]
        if missing:
            table = self._read_groups([group], missing)
            for name in missing:
                start = self._row_group_starts[group]
                self._recent[group, name] = self._samples(name, table.column(name), start)
        found = {name: self._recent[group, name] for name in columns}
        kept = max(RECENT_GROUPS * len(columns), len(columns))
        while len(self._recent) > kept:
            self._recent.pop(next(iter(self._recent)))
        return found

    def _samples(self, name: str, column: pa.ChunkedArray | pa.Array, start: int) -> Array:
        values = _to_numpy(name, column)
        if quantity_of(name) == "current":
            beyond = spikes(values, LIMITS[self.info.current_unit])
            if beyond.size:
                found = self._spikes.setdefault(name, {})
                sizes = np.abs(values[beyond]).tolist()
                found.update(zip((start + beyond).tolist(), sizes, strict=True))
                values = values.copy()
                values[beyond] = np.nan
        return values

    def doubt(self, column: str) -> str | None:
        """Say what was no measurement in what was read of a current so far; None: nothing."""
        found = self._spikes.get(column)
        if not found:
            return None
        count = f"{len(found)} sample{'s' * (len(found) > 1)}"
        largest = f"{max(found.values()):.3g} {self.info.current_unit}"
        return f"{self.path}: column {column} has {count} of up to {largest}, no measurement"

    def _read_groups(self, groups: list[int], columns: Sequence[str]) -> pa.Table:
        with self._reading(columns):
            return self._file.read_row_groups(groups, columns=list(columns), use_threads=False)

    def _reading(self, columns: Sequence[str]) -> AbstractContextManager[None]:
        return reading(
            self.path,
            "the file is damaged, copy it again from its source",
            f"samples of {', '.join(columns)} cannot be read",
        )

    def check_time(self) -> None:
        """Check that `time_s`, where it is there, agrees with the sampling rate.

        Raises
        ------
        InputError
            If it does not, or if it has gaps.
        """
        if "time_s" not in self.columns or self.n_samples < 2:
            return
        period = 1.0 / self.sampling_rate_hz
        last: float | None = None
        for start, block in self.blocks(["time_s"]):
            time = np.asarray(block["time_s"], dtype=np.float64)
            if last is not None:
                time = np.concatenate(([last], time))
                start -= 1
            step = np.diff(time)
            bad = np.flatnonzero(~(np.abs(step - period) <= 0.5 * period))
            if bad.size:
                at = start + int(bad[0])
                msg = (
                    f"{self.path}: column time_s steps by {step[bad[0]]:.6g} s at sample {at} "
                    f"where the rate of {self.sampling_rate_hz:g} Hz needs {period:.6g} s; "
                    "resample the recording with `opamc ingest`"
                )
                raise InputError(msg)
            if step.size and not same_clock(float(step.mean()), period):
                msg = (
                    f"{self.path}: column time_s says {1 / step.mean():.6g} Hz, the metadata "
                    f"{self.sampling_rate_hz:g} Hz; correct sampling_rate_hz or drop time_s"
                )
                raise InputError(msg)
            last = float(time[-1])

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file."""
        return file_sha256(self.path)

    @property
    def currents_sha256(self) -> str:
        """SHA-256 of the currents' samples as they are stored; empty if they never change."""
        names = (name for own in self._channels.values() for name in own.columns.values())
        currents = [name for name in names if quantity_of(name) == "current"]
        return samples_sha256(self.path, currents, self._file.metadata)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        """Return the run itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self.close()


def find_runs(paths: Sequence[Path]) -> list[tuple[str, Path]]:
    """List the runs named by files, folders and patterns, as (name, path), sorted, each once.

    A folder stands for every `*.parquet` below it that is not a stage table. Names are the
    paths below the folder without their ending; of files given one by one, their stems.

    Raises
    ------
    InputError
        If a path does not exist or a folder holds no run.
    """
    found: dict[Path, str] = {}
    for path in expand_patterns(paths):
        if path.is_dir():
            files = [f for f in sorted(path.rglob("*.parquet")) if _may_be_run(path, f)]
            if not files:
                msg = f"{path}: the folder holds no run (*.parquet); record or ingest one first"
                raise InputError(msg)
            for file in files:
                found.setdefault(file, file.relative_to(path).with_suffix("").as_posix())
        elif path.exists():
            found.setdefault(path, path.stem)
        else:
            msg = f"{path}: no such file or folder; check the path"
            raise InputError(msg)
    for path in found:
        if any("\ud800" <= c <= "\udfff" for c in str(path)):
            msg = f"{str(path)!r}: its name is not UTF-8; rename it"
            raise InputError(msg)
    runs = [(name, path) for path, name in found.items()]
    names = [name for name, _ in runs]
    if len(set(names)) < len(names):
        # two folders with equal file names: the whole path tells them apart
        runs = [(path.with_suffix("").as_posix(), path) for _, path in runs]
    return sorted(runs)


NO_RUNS = {ending for ending in FORMAT_OF_ENDING if ending not in (".txt", ".dat", ".parquet")}
"""Of files that are recordings, if not runs: a text beside them may be anything."""


def passed_over(paths: Sequence[Path]) -> list[str]:
    """Say in one sentence for each folder what recordings in it are no runs, and of links in it.

    A recording that lies beside a run of its name was made into it.
    """
    said = []
    for folder in dict.fromkeys(path for path in expand_patterns(paths) if path.is_dir()):
        inside = sorted(folder.rglob("*"))
        left = [
            file.relative_to(folder)
            for file in inside
            if _ending(file) in NO_RUNS or file.suffix == ".PARQUET"
            if not any(part.startswith(".") for part in file.relative_to(folder).parts)
            if file.is_file() and not file.with_suffix(".parquet").exists()
        ]
        if left:
            count = f"{len(left)} recordings are" if len(left) > 1 else "1 recording is"
            said.append(
                f"{folder}: {count} passed over ({shown(left[0])}"
                f"{', …' if len(left) > 1 else ''}): only *.parquet are runs; "
                "`opamc ingest` turns others into runs"
            )
        said += [
            f"{link}: is a link to a folder, which is passed over; name it beside {folder}"
            for link in inside
            if link.is_symlink() and link.is_dir() and not link.name.startswith(".")
        ]
    return said


def _ending(file: Path) -> str:
    suffixes = [suffix.lower() for suffix in file.suffixes if suffix.lower() != ".gz"]
    return suffixes[-1] if suffixes else ""


def _may_be_run(folder: Path, file: Path) -> bool:
    relative = file.relative_to(folder)
    if any(part.startswith(".") for part in relative.parts):
        return False
    try:
        metadata = read_schema(file, "").metadata or {}
    except InputError:
        return True  # opening it will say what is wrong with it
    return b"opamc_table" not in metadata


@contextmanager
def write_run(path: Path, info: RunInfo, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a run for writing, block by block; it appears under its name when all is written.

    Raises
    ------
    InputError
        If what it says of itself is out of bounds.

    Yields
    ------
    pyarrow.parquet.ParquetWriter
        Call `write_table` with tables of the given schema. Blocks of `ROW_GROUP_SAMPLES` rows
        keep row groups whole.
    """
    metadata = dict(schema.metadata or {})
    metadata[METADATA_KEY] = raw = info.to_json().encode()
    # what no reader would take is not written
    parsed(RunMetadata, raw, f"{path}: its metadata", "correct the map or what was recorded")
    with (
        atomic_path(path) as temporary,
        pq.ParquetWriter(
            temporary,
            schema.with_metadata(metadata),
            # What an A/D converter delivers has few distinct values: a dictionary of them makes
            # the file a quarter smaller and decodes twice as fast as zstd over split bytes
            # (benchmarks/encoding.py); other floats fall back to plain pages by themselves.
            use_dictionary=True,
            compression="lz4",
            write_page_checksum=True,
        ) as writer,
    ):
        yield writer


def save_run(path: Path, info: RunInfo, columns: Mapping[str, Array]) -> None:
    """Write a run from arrays of equal length, each in its own float width.

    Raises
    ------
    InputError
        If the arrays differ in length.
    """
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        msg = f"{path}: columns of different length {lengths}; a run has one row per sample"
        raise InputError(msg)
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    with write_run(path, info, table.schema) as writer:
        for start in range(0, table.num_rows, ROW_GROUP_SAMPLES):
            writer.write_table(table.slice(start, ROW_GROUP_SAMPLES))


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's content as hexadecimal digits.

    Raises
    ------
    InputError
        If it is missing or no regular file.
    """
    require_regular_file(path, InputError)
    state = path.stat()
    return _sha256(path.resolve(), state.st_mtime_ns, state.st_size)


def know_sha256(path: Path, modified_ns: int, size: int, sha256: str) -> None:
    """Spare a file the hashing: its content was read before it last had this time and size."""
    _KNOWN_SHA256[path.resolve(), modified_ns, size] = sha256


_KNOWN_SHA256: dict[tuple[Path, int, int], str] = {}


@lru_cache(maxsize=4096)
def _sha256(path: Path, modified_ns: int, size: int) -> str:
    # a diagnosis names the same gigabytes in three tables: they are hashed once
    known = _KNOWN_SHA256.get((path, modified_ns, size))
    if known is not None:
        return known
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def _open_parquet(path: Path) -> pq.ParquetFile:
    if not path.exists():
        msg = f"{path}: no such file; check the path"
        raise InputError(msg)
    require_regular_file(path, InputError, "a run file (*.parquet)")
    advice = "if it is another format, turn it into a run with `opamc ingest`"
    with reading(path, advice, "cannot be opened as Parquet"):
        # pre-buffering would hold the columns of all row groups at once
        file = pq.ParquetFile(
            path, page_checksum_verification=True, memory_map=False, pre_buffer=False
        )
        _ = file.schema_arrow.names  # which may be no UTF-8
    return file


def _parse_info(path: Path, metadata: Mapping[bytes, bytes] | None) -> RunInfo:
    raw = (metadata or {}).get(METADATA_KEY)
    if raw is None:
        what = "is a stage table" if b"opamc_table" in (metadata or {}) else "is not a run"
        msg = (
            f"{path}: {what}: its schema metadata has no key 'opamc' with sampling_rate_hz; "
            "make a run of it with `opamc ingest`"
        )
        raise InputError(msg)
    document = parsed(RunMetadata, raw, f"{path}: metadata key 'opamc'", "write the run again")
    return RunInfo(**document.model_dump())


def _as_text(value: object) -> object:
    # a program called 7 in one run and "7" in another is the same program
    return str(value) if isinstance(value, int | float) else value


def _as_moment(text: str) -> str:
    # one that no session can be told by is worse than none; loggers write "" for none
    try:
        if text:
            datetime.fromisoformat(text)
    except ValueError as error:
        kind, needed = "time", "an ISO 8601 time such as 2026-03-01T22:00:00Z is needed, or none"
        raise PydanticCustomError(kind, needed) from error
    return text


Text = Annotated[str, Field(max_length=1000), BeforeValidator(_as_text)]
Condition = Annotated[float, Field(ge=-1e6, le=1e6)]


class RunMetadata(Document):
    """The JSON of the metadata key `opamc`; see `RunInfo`."""

    sampling_rate_hz: Annotated[float, Field(ge=LEAST_HZ, le=MOST_HZ)]
    robot: Text | None = None
    program: Text | None = None
    speed_percent: Condition | None = None
    payload_kg: Condition | None = None
    started_at: Annotated[Text, AfterValidator(_as_moment)] | None = None
    session: Text | None = None
    source_sha256: Text | None = None
    map_sha256: Text | None = None
    current_unit: Literal["A", "Nm"] = "A"


def _axis_channels(path: Path, schema: pa.Schema) -> dict[int, AxisChannels]:
    by_axis: dict[int, set[str]] = {}
    for field in schema:
        match = COLUMN.fullmatch(field.name)
        if match is None and field.name != "time_s":
            _refuse_misspelt(path, field.name, schema.names)
            continue
        if not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type)):
            msg = f"{path}: column {field.name} has type {field.type}; it must hold numbers"
            raise InputError(msg)
        if match is not None:
            if len(match[1]) > len(str(MOST_AXES)) or int(match[1]) > MOST_AXES:
                msg = f"{path}: column {shown(field.name)}: axes count from 1 to {MOST_AXES}"
                raise InputError(msg)
            by_axis.setdefault(int(match[1]), set()).add(match[2])
    channels = {}
    for axis in sorted(by_axis):
        have = by_axis[axis]
        if have.intersection(CURRENTS):
            channels[axis] = AxisChannels(axis, {name: f"axis{axis}_{name}" for name in have})
    if not channels:
        names = ", ".join(map(shown_line, schema.names[:8]))
        msg = (
            f"{path}: no current column among [{names}]; a run needs axis1_a (axis1_b, axis1_c) "
            "or axis1_current, counted from axis 1; rename with `opamc ingest --map`"
        )
        raise InputError(msg)
    return channels


def _refuse_misspelt(path: Path, name: str, names: Sequence[str]) -> None:
    """Refuse a column that is nearly an axis's: an axis left out on both sides is never missed."""
    match = NEARLY_COLUMN.fullmatch(name)
    meant = match and f"axis{match[1]}_{match[2].lower()}"
    if meant and meant not in names:
        msg = f"{path}: column {shown(name)}: is it {meant}? Rename it"
        raise InputError(msg)


def _to_numpy(name: str, column: pa.ChunkedArray | pa.Array) -> Array:
    if pa.types.is_integer(column.type):
        column = column.cast(pa.float64(), safe=False)
    if isinstance(column, pa.Array):
        values = np.asarray(column.to_numpy(zero_copy_only=False))
    else:
        values = np.asarray(column.to_numpy())
    if values.dtype == np.float16:
        values = values.astype(np.float32)
    if name == "time_s":
        return values
    # an infinite current is no measurement, and one of them spoils every mean and transform
    beyond = np.abs(values) > LARGEST_SAMPLE
    return np.where(beyond, np.float32(np.nan), values) if beyond.any() else values


def _join(pieces: list[Array]) -> Array:
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
