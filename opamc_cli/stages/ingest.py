"""Foreign recordings become runs: read, convert, resample where uneven, write."""

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import pyarrow as pa

from opamc_cli.errors import InputError, UsageError
from opamc_cli.stages.parallel import Outcome, map_items
from opamc_cli.storage.ingest.convert import convert
from opamc_cli.storage.ingest.dates import utc_text
from opamc_cli.storage.ingest.map import IngestMap, RateMap, ValueMap, quantity_of, rate_hz
from opamc_cli.storage.ingest.opening import open_source
from opamc_cli.storage.ingest.resample import resample
from opamc_cli.storage.ingest.source import Array, Block, Selection, Source
from opamc_cli.storage.ingest.stamps import Clock, Seconds, StampAccount, examine
from opamc_cli.storage.ingest.units import ISO8601, SAMPLES, conversion
from opamc_cli.storage.lock import output_lock
from opamc_cli.storage.runs import ROW_GROUP_SAMPLES, RunInfo, file_sha256, write_run

_TIME = "time"


@dataclass(frozen=True)
class Ingested:
    """One recording that became a run.

    Attributes
    ----------
    source, run
        Files read and written.
    sampling_rate_hz, n_samples
        Of the run.
    missing
        Values that are NaN, by column; columns without are left out.
    stamps
        What was found in the time stamps; None where the map names none.
    """

    source: Path
    run: Path
    sampling_rate_hz: float
    n_samples: int
    missing: Mapping[str, int]
    stamps: StampAccount | None


@dataclass(frozen=True)
class _Task:
    source: Path
    run: Path
    channels: IngestMap


def run(files: Sequence[Path], channels: IngestMap, out: Path, jobs: int = 1) -> Outcome[Ingested]:
    """Turn every file into ``out/<stem>.parquet``; one that cannot be used stops no other.

    Raises
    ------
    UsageError
        If two files have the same stem, or `out` cannot be written. Nothing is written then.
    LockedError
        If another process writes to `out`.
    """
    tasks = [_Task(file, out / f"{_stem(file)}.parquet", channels) for file in files]
    by_run: dict[Path, Path] = {}
    for task in tasks:
        if task.run in by_run:
            msg = (
                f"{by_run[task.run]} and {task.source} would both become {task.run}; "
                "rename one or ingest them into different folders with --out"
            )
            raise UsageError(msg)
        by_run[task.run] = task.source
    with output_lock(out):
        outcome = map_items(ingest_file, tasks, jobs)
    for error in outcome.errors:
        if isinstance(error, UsageError):
            raise error  # what cannot be written for one file cannot be for the next
    return outcome


def ingest_file(task: _Task) -> Ingested:
    """Turn one file into a run.

    Raises
    ------
    InputError
        If the file cannot be used; no run is written then.
    """
    channels = task.channels
    with open_source(task.source, channels) as source:
        rate = _declared_rate(task.source, source, channels)
        selections = {
            name: Selection(column.source, column.index)
            for name, column in channels.columns.items()
        }
        if channels.time is None:
            clock = None
            blocks: Iterable[Block] = convert(source.blocks(selections), channels)
        else:
            times_s = _times(source, channels, rate)
            clock = examine(
                task.source, channels.time.source, times_s, rate, channels.time.max_gap_samples
            )
            blocks = _on_grid(
                convert(source.blocks(selections), channels), times_s, clock, channels
            )
        rate = clock.sampling_rate_hz if clock is not None else cast(float, rate)
        info = _info(task.source, source, channels, rate)
        n_samples, missing = _write(task, info, blocks)
    return Ingested(
        task.source, task.run, rate, n_samples, missing, clock.account if clock else None
    )


def _stem(file: Path) -> str:
    return (file.with_suffix("") if file.suffix.lower() == ".gz" else file).stem


def _declared_rate(path: Path, source: Source, channels: IngestMap) -> float | None:
    declared = channels.sampling_rate_hz
    if not isinstance(declared, RateMap):
        return declared
    value = _number(source.value(declared.source))
    if value is None or not 0 < value < np.inf:
        msg = (
            f"{path}: {declared.source!r} is {source.value(declared.source)!r}; "
            "a sampling rate is a positive number"
        )
        raise InputError(msg)
    return rate_hz(declared, value)


def _times(source: Source, channels: IngestMap, rate: float | None) -> Seconds:
    """Return all time stamps in seconds: 8 bytes per row are the price of a sound account."""
    time = channels.time
    assert time is not None
    dates = time.unit == ISO8601
    selection = {_TIME: Selection(time.source, time.index, dates)}
    stamps = [block[_TIME] for block in source.blocks(selection)]
    column: Array = np.concatenate(stamps) if stamps else np.empty(0)
    if dates:
        seconds = np.full(len(column), np.nan)
        known = ~np.isnat(column)
        if known.any():
            since = column[known] - column[known][0]
            seconds[known] = since / np.timedelta64(1, "us") * 1e-6
        return seconds
    unit = conversion(time.unit, "time")
    if time.unit == SAMPLES or unit is None:
        return np.asarray(column / cast(float, rate))
    return np.asarray(column if unit.factor == 1.0 else column * unit.factor)


def _on_grid(
    blocks: Iterator[Block], times_s: Seconds, clock: Clock, channels: IngestMap
) -> Iterable[Block]:
    if clock.kept is None:
        return blocks
    time = channels.time
    assert time is not None
    return resample(
        _stamped(blocks, times_s, clock.kept),
        clock.start_s,
        clock.sampling_rate_hz,
        clock.n_samples,
        clock.max_gap_s,
        cubic=time.interpolation == "cubic",
    )


def _stamped(
    blocks: Iterator[Block], times_s: Seconds, kept: Array
) -> Iterator[tuple[Seconds, Block]]:
    start = 0
    for block in blocks:
        stop = start + len(next(iter(block.values())))
        rows = kept[start:stop]
        yield times_s[start:stop][rows], {name: values[rows] for name, values in block.items()}
        start = stop


def _info(path: Path, source: Source, channels: IngestMap, rate: float) -> RunInfo:
    values: dict[str, object] = {}
    for key in ("robot", "program", "speed_percent", "payload_kg", "started_at"):
        given = getattr(channels.metadata, key)
        value = source.value(given.source) if isinstance(given, ValueMap) else given
        if value is None:
            continue
        if key == "started_at":
            known: object = utc_text(value)
            wanted = "a date and time in ISO 8601, such as 2022-10-26T08:17:21Z"
        elif key in ("speed_percent", "payload_kg"):
            known, wanted = _number(value), "a number"
        else:
            known, wanted = str(value), "text"
        if known is None:
            msg = f"{path}: metadata.{key} is {value!r}; it must be {wanted}"
            raise InputError(msg)
        values[key] = known
    return RunInfo(sampling_rate_hz=rate, source_sha256=file_sha256(path), **values)  # type: ignore[arg-type]


def _number(value: object) -> float | None:
    try:
        number = float(str(value).replace(",", "."))
    except ValueError:
        return None
    return number if np.isfinite(number) else None


def _write(task: _Task, info: RunInfo, blocks: Iterable[Block]) -> tuple[int, dict[str, int]]:
    names = list(task.channels.columns)
    schema = pa.schema([(name, _width(name)) for name in names])
    missing = dict.fromkeys(names, 0)
    n_samples = 0
    groups = _row_groups(blocks, schema)
    with closing(groups), write_run(task.run, info, schema) as writer:
        for table in groups:
            for name in names:
                missing[name] += int(np.isnan(table.column(name).to_numpy()).sum())
            n_samples += table.num_rows
            writer.write_table(table)
        if n_samples == 0:
            msg = f"{task.source}: holds no samples; check the map's skip_rows and sources"
            raise InputError(msg)
        for name, count in missing.items():
            if count == n_samples:
                msg = (
                    f"{task.source}: column {name} (source "
                    f"{task.channels.columns[name].source!r}) has no value in {n_samples} rows; "
                    "name another source in the map"
                )
                raise InputError(msg)
    return n_samples, {name: count for name, count in missing.items() if count}


def _width(name: str) -> pa.DataType:
    # float32 resolves a current to 1e-7 of itself; turns of a joint add up and need more
    return pa.float64() if quantity_of(name) == "position" else pa.float32()


def _row_groups(blocks: Iterable[Block], schema: pa.Schema) -> Generator[pa.Table, None, None]:
    held: list[pa.Table] = []
    n_held = 0
    for block in blocks:
        columns = [pa.array(_measured(block[field.name], field.type)) for field in schema]
        held.append(pa.Table.from_arrays(columns, schema=schema))
        n_held += held[-1].num_rows
        while n_held >= ROW_GROUP_SAMPLES:
            table = pa.concat_tables(held)
            yield table.slice(0, ROW_GROUP_SAMPLES)
            held = [table.slice(ROW_GROUP_SAMPLES)]
            n_held -= ROW_GROUP_SAMPLES
    if n_held:
        yield pa.concat_tables(held)


def _measured(values: Array, width: pa.DataType) -> Array:
    # what float32 cannot hold is as little a measurement as an infinity
    with np.errstate(over="ignore"):
        column = values.astype(width.to_pandas_dtype())
    column[np.isinf(column)] = np.nan
    return np.asarray(column)
