"""A recording, opened lazily.

Its metadata and schema are read at once, its samples only by column and row group as they are asked
for.
"""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.config.reading import require_regular_file, shown
from opamc_cli.errors import InputError
from opamc_cli.signal.plausible.quality import LIMITS, spikes
from opamc_cli.storage.files.parquet import reading, samples_sha256
from opamc_cli.storage.runs.columns import AxisChannels, axis_channels
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.runs.metadata import parse_info
from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES, Array
from opamc_cli.storage.schemas.channels import (
    COLUMN,
    quantity_of,
    same_clock,
)

RECENT_GROUPS = 2
"""Row groups kept after reading: a segment may span a boundary."""


MOST_GROUP_SAMPLES = 1 << 24
"""Rows of a row group, which is decoded at once: two hours at 2048 Hz."""


LARGEST_SAMPLE = 1e9
"""More is no measurement in whatever unit; the fourth power of this is still a float32."""


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
        self.info = parse_info(self.path, schema.metadata)
        self.n_samples: int = self._file.metadata.num_rows
        self.columns: tuple[str, ...] = tuple(schema.names)
        if self.n_samples == 0:
            msg = f"{self.path}: the run has no samples (0 rows); record at least one cycle"
            raise InputError(msg)
        self._channels = axis_channels(self.path, schema)
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
        while len(self._recent) > RECENT_GROUPS * len(columns):
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
