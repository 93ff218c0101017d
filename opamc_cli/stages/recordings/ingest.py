"""Foreign recordings become runs: read, convert, resample where uneven, write."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast

import numpy as np

from opamc_cli.config.models import digest
from opamc_cli.errors import InputError, OpamcError, UsageError
from opamc_cli.signal.plausible.quality import held_for
from opamc_cli.stages.processes.parallel import Outcome, Watch, map_items, unwatched
from opamc_cli.stages.recordings.written_run import write_recording
from opamc_cli.storage.files.lock import output_lock
from opamc_cli.storage.files.parquet import read_schema
from opamc_cli.storage.ingest.convert import convert
from opamc_cli.storage.ingest.map.map_file import (
    ColumnMap,
    IngestMap,
    RateMap,
    ValueMap,
    count_doubts,
    for_axes,
    rate_hz,
)
from opamc_cli.storage.ingest.map.units import (
    ISO8601,
    LATEST_S,
    SAMPLES,
    conversion,
    date_s,
    is_torque,
    known_units,
)
from opamc_cli.storage.ingest.opening import open_source
from opamc_cli.storage.ingest.recordings import find_recordings, local_copy
from opamc_cli.storage.ingest.source import Array, Block, Name, Selection, Source
from opamc_cli.storage.ingest.time.dates import utc_text
from opamc_cli.storage.ingest.time.resample import resample
from opamc_cli.storage.ingest.time.stamps import RATE_WITHIN, Clock, Seconds, StampAccount, examine
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.runs.metadata import METADATA_KEY, RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas.channels import LEAST_HZ, MOST_HZ, quantity_of, same_clock

_TIME = "time"

MAP_VERSION = 2
"""Part of what a run remembers of its map: raised when the same map makes other runs."""

FIRST_DATE = "1970"
"""A clock that was never set begins there, or later; an earlier date is none of a log."""


@dataclass(frozen=True)
class Ingested:
    """One recording that became a run."""

    source: str
    run: Path
    """With `source`: what was read, and the file that was written."""
    sampling_rate_hz: float
    n_samples: int
    """With `sampling_rate_hz`: of the run."""
    missing: Mapping[str, int]
    """Values that are NaN, by column; columns without are left out."""
    stamps: StampAccount | None
    """What was found in the time stamps; None where the map names none, or nothing was done."""
    sources: Mapping[str, Name] = field(default_factory=dict)
    """The recording's channel by run column."""
    skipped: bool = False
    """The run was there already, made from the same recording by the same map."""
    replaced: bool = False
    """The run was there already, made from another recording or by another map."""
    doubts: tuple[str, ...] = ()
    """One sentence for each column whose numbers are larger than most robots', and for axes that
    are missing between others."""
    lost: str | None = None
    """What of the recording is not in the run: times that stamps tell, joints."""


@dataclass(frozen=True)
class _Task:
    source: str
    run: Path
    channels: IngestMap


def run(
    files: Sequence[Path | str],
    channels: IngestMap,
    out: Path,
    jobs: int = 1,
    watch: Watch = unwatched,
) -> Outcome[Ingested]:
    """Turn every recording into a run below `out`; one that cannot be used stops no other.

    What has become a run already, by the same map, is left alone.

    Parameters
    ----------
    files
        Files, folders, patterns and addresses in object stores.
    channels
        The map.
    out
        Output folder.
    jobs
        Worker processes.
    watch
        Called with what is done and what there is to do.

    Raises
    ------
    UsageError
        If two recordings have the same name, or `out` cannot be written. Nothing is written then.
    InputError
        If a folder or pattern names no recording.
    LockedError
        If another process writes to `out`.
    """
    found = find_recordings([str(file) for file in files], channels.format is not None)
    tasks = [_Task(each.source, out / f"{each.name}.parquet", channels) for each in found]
    by_run: dict[Path, str] = {}
    for task in tasks:
        if task.run in by_run:
            msg = (
                f"{by_run[task.run]} and {task.source} would both become {task.run}; "
                "rename one or ingest them into different folders with --out"
            )
            raise UsageError(msg)
        by_run[task.run] = task.source
    with output_lock(out):
        outcome = map_items(ingest_file, tasks, jobs, watch)
    for error in outcome.errors:
        if isinstance(error, UsageError):
            raise error  # what cannot be written for one file cannot be for the next
    return outcome


def rates_note(results: Sequence[Ingested]) -> str | None:
    """Return what to do about runs of different rates, None where they have one.

    Baseline and target are compared at one rate only; to hear of it now saves a refusal later.
    """
    rates = sorted({item.sampling_rate_hz for item in results})
    if not rates or same_clock(rates[-1], rates[0]):
        return None
    low, high = (next(i for i in results if i.sampling_rate_hz == r) for r in (rates[0], rates[-1]))
    said = (
        f"sampling rates differ, {rates[0]:g} Hz ({low.run}) to {rates[-1]:g} Hz ({high.run}), "
        "and runs of different rates cannot be compared"
    )
    if rates[-1] / rates[0] - 1.0 > RATE_WITHIN:
        return f"{said}; ingest them into different folders"
    middle = float(f"{(rates[0] * rates[-1]) ** 0.5:.3g}")
    return f"{said}: set resample_hz in the map, as with --set resample_hz={middle:g}"


def map_digest(channels: IngestMap) -> str:
    """Return the SHA-256 of what a map says."""
    return digest({"version": MAP_VERSION, **channels.model_dump(mode="json")})


def ingest_file(task: _Task) -> Ingested:
    """Turn one recording into a run.

    Raises
    ------
    InputError
        If the recording cannot be used; no run is written then.
    """
    with local_copy(task.source) as path:
        return _ingest(path, task)


def _ingest(path: Path, task: _Task) -> Ingested:
    with open_source(path, task.channels) as source:
        sha256 = _source_sha256(path)
        replaced = task.run.exists()
        if replaced:
            known = _made_from(task.run)
            if known is None:
                msg = f"{task.run}: was not made by ingest and would be replaced; use another --out"
                raise InputError(msg)
            if known == (sha256, map_digest(task.channels)):
                with Run(task.run) as old:
                    rate, n = old.sampling_rate_hz, old.n_samples
                return Ingested(task.source, task.run, rate, n, {}, None, skipped=True)
        channels = for_axes(task.channels, source.channels)
        declared = _declared_rate(path, source, channels)
        selections = {
            name: Selection(column.source, cast(int | None, column.index))
            for name, column in channels.columns.items()
        }
        clock = _clock(path, source, channels, declared, selections)
        held: dict[str, int] = {}
        blocks: Iterable[Block] = _noting_held(
            convert(path, source.blocks(selections), channels), held
        )
        if clock is not None and clock.clock.kept is not None:
            blocks = _on_grid(blocks, clock.times_s, clock.clock, channels)
        rate = clock.clock.sampling_rate_hz if clock is not None else cast(float, declared)
        info = replace(
            _info(path, source, channels, rate),
            source_sha256=sha256,
            map_sha256=map_digest(task.channels),
        )
        written = write_recording(path, task.run, channels, info, blocks)
        remarks = source.remarks
        listed = source.channels()
        labels = {each.name: each.labels for each in listed if each.labels}
        gaps, left = count_doubts(path, task.channels, channels, listed)
    account = clock.clock.account if clock and channels.time else None
    doubts = [*left, *written.lost]
    if account and (doubt := account.doubt()):
        doubts.append(f"{path}: {doubt}")
    return Ingested(
        task.source,
        task.run,
        rate,
        written.n_samples,
        written.missing,
        account,
        {name: _label(column, labels) for name, column in channels.columns.items()},
        replaced=replaced,
        doubts=(*gaps, *remarks, *written.doubts, *_held_long(path, channels, held, clock, rate)),
        lost="; ".join(doubts) or None,
    )


def _made_from(path: Path) -> tuple[str | None, str | None] | None:
    """Return the hashes of what a run was made from and by; None if it is of somebody else."""
    try:
        metadata = read_schema(path, "").metadata or {}
    except InputError:
        return "", ""  # a run that was damaged is made again
    if METADATA_KEY not in metadata:
        return None
    with suppress(OpamcError), Run(path) as old:
        found = (old.info.source_sha256, old.info.map_sha256)
        return found if found[0] else None
    return "", ""


def _label(column: ColumnMap, labels: Mapping[Name, Sequence[str]]) -> Name:
    """Return what a column was made from: the joint's name where the map has its place."""
    if column.source in labels and isinstance(column.index, int):
        return f"{labels[column.source][column.index]}/{column.source}"
    return column.source


def _source_sha256(path: Path) -> str:
    """Return the SHA-256 of a recording; of a folder (a ROS 2 bag), that of all its files."""
    if not path.is_dir():
        return file_sha256(path)
    files = [file for file in sorted(path.rglob("*")) if file.is_file()]
    return digest({str(file.relative_to(path)): file_sha256(file) for file in files})


@dataclass(frozen=True)
class _Stamped:
    """The time stamps of a recording and the grid made of them."""

    times_s: Seconds
    clock: Clock


def _clock(
    path: Path,
    source: Source,
    channels: IngestMap,
    declared: float | None,
    selections: Mapping[str, Selection],
) -> _Stamped | None:
    """Return the grid of a recording, None where its rows are taken as they come."""
    time, grid = channels.time, channels.resample_hz
    if time is None:
        if grid is None:
            return None
        # evenly spaced rows, by declaration
        first = next(iter(selections))
        rows = sum(len(block[first]) for block in source.blocks({first: selections[first]}))
        times_s = np.arange(rows) / cast(float, declared)
        return _Stamped(times_s, examine(path, "rows", times_s, declared, 2.5, grid))
    times_s = _times(source, channels, declared)
    clock = examine(path, time.source, times_s, declared, time.max_gap_samples, grid)
    if not LEAST_HZ <= clock.sampling_rate_hz <= MOST_HZ:
        msg = (
            f"{path}: time column {time.source!r} says {clock.sampling_rate_hz:.4g} Hz, a log has "
            f"{LEAST_HZ:g} to {MOST_HZ:g}: it is not in {time.unit}; correct time.unit in the map, "
            f"units: {known_units('time')}"
        )
        raise InputError(msg)
    return _Stamped(times_s, clock)


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


def _noting_held(blocks: Iterable[Block], held: dict[str, int]) -> Iterator[Block]:
    """Pass blocks on, and note which columns of the first hold each value for some samples."""
    for number, block in enumerate(blocks):
        if number == 0:  # before any grid: between two values it would draw a line
            for name, values in block.items():
                if quantity_of(name) != "temperature" and (count := held_for(values)):
                    held[name] = count
        yield block


def _held_long(
    path: Path, channels: IngestMap, held: Mapping[str, int], clock: _Stamped | None, rate: float
) -> Iterator[str]:
    """Say which columns were logged less often than the rows."""
    account = clock.clock.account if clock else None
    logged_hz = account.measured_rate_hz if account else rate
    for rows in sorted(set(held.values())):
        columns = [name for name, count in held.items() if count == rows]
        source = channels.columns[columns[0]].source
        yield (
            f"{path}: each value of {', '.join(columns)} (source {source!r}) is held for {rows} "
            f"rows: it comes at {logged_hz / rows:.3g} Hz, up to {rows / logged_hz:.2g} s late "
            "beside other columns; log it as often as they are"
        )


def _on_grid(
    blocks: Iterable[Block], times_s: Seconds, clock: Clock, channels: IngestMap
) -> Iterable[Block]:
    assert clock.kept is not None
    linear = channels.time is not None and channels.time.interpolation == "linear"
    return resample(
        _stamped(blocks, times_s, clock.kept),
        clock.start_s,
        clock.sampling_rate_hz,
        clock.n_samples,
        clock.max_gap_s,
        cubic=not linear,
    )


def _stamped(
    blocks: Iterable[Block], times_s: Seconds, kept: Array
) -> Iterator[tuple[Seconds, Block]]:
    start = 0
    for block in blocks:
        stop = start + len(next(iter(block.values())))
        rows = kept[start:stop]
        yield times_s[start:stop][rows], {name: values[rows] for name, values in block.items()}
        start = stop


def _info(path: Path, source: Source, channels: IngestMap, rate: float) -> RunInfo:
    values: dict[str, object] = {}
    for key in ("robot", "program", "speed_percent", "payload_kg", "started_at", "session"):
        given = getattr(channels.metadata, key)
        value = source.value(given.source) if isinstance(given, ValueMap) else given
        if value is None:
            continue
        if key == "started_at":
            known: object = utc_text(_since_1970(path, value, given, channels))
            if known is not None and str(known) < FIRST_DATE:
                msg = f"{path}: no log is of {known}: write its year in four digits, or correct it"
                raise InputError(msg)
            wanted = "a date and time in ISO 8601, such as 2022-10-26T08:17:21Z"
        elif key in ("speed_percent", "payload_kg"):
            known, wanted = _number(value), "a number"
        else:
            known, wanted = str(value), "text"
        if known is None:
            msg = f"{path}: metadata.{key} is {value!r}; it must be {wanted}"
            raise InputError(msg)
        values[key] = known
    units = {
        column.unit for name, column in channels.columns.items() if quantity_of(name) == "current"
    }
    values["current_unit"] = "Nm" if any(map(is_torque, units)) else "A"
    return RunInfo(sampling_rate_hz=rate, **values)  # type: ignore[arg-type]


def _since_1970(path: Path, value: object, given: object, channels: IngestMap) -> object:
    """Return the date that a first time stamp is, where stamps count from 1970."""
    time = channels.time
    number = _number(value)
    if time is None or not isinstance(given, ValueMap) or given.source != time.source:
        return value
    seconds = date_s(number, time.unit) if number is not None else None
    if seconds is None:
        return value
    if seconds >= LATEST_S:
        years = 1970 + seconds / 31_556_952
        msg = f"{path}: no log is of {years:.0f}: its time is in another unit than {time.unit}"
        raise InputError(msg)
    return np.datetime64(round(seconds * 1e6), "us")


def _number(value: object) -> float | None:
    try:
        number = float(str(value).replace(",", "."))
    except ValueError:
        return None
    return number if np.isfinite(number) else None
