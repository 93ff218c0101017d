"""A run written from a recording's samples, and what is odd about their numbers."""

from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from opamc_cli.errors import InputError
from opamc_cli.signal.plausible.quality import LIMITS, Size, strided_speed
from opamc_cli.storage.ingest.map.map_file import IngestMap
from opamc_cli.storage.ingest.map.units import ALIASES, ONE_UNIT
from opamc_cli.storage.ingest.source import Array, Block
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import LARGEST_SAMPLE
from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES, write_run
from opamc_cli.storage.schemas.channels import quantity_of

NO_UNITS = (
    "one of them is of the motor's side, or has another unit, scale or sign, or the time's unit is "
    "wrong"
)
"""Of a speed that is its position's rate of change by a factor that no pair of units makes."""

MOST_EMPTY = 0.5
"""Share of a channel's rows without a value from which on it is lost, not only holed by the gaps
that are told; a temperature may be logged once a minute."""


@dataclass(frozen=True)
class Written:
    """What was written of a recording; see `Ingested`."""

    n_samples: int
    missing: dict[str, int]
    doubts: tuple[str, ...]
    lost: list[str]


def write_recording(
    path: Path, run: Path, channels: IngestMap, info: RunInfo, blocks: Iterable[Block]
) -> Written:
    """Write the run that a recording becomes.

    Parameters
    ----------
    path, run
        The recording, as it is named in what is said of it, and the file that is written.
    channels
        The map.
    info
        Metadata of the run.
    blocks
        Samples by column, in the units of a run.

    Raises
    ------
    InputError
        If there are no samples, a column has no value, or has numbers that are of no joint.
    """
    names = list(channels.columns)
    schema = pa.schema([(name, _width(name)) for name in names])
    missing = dict.fromkeys(names, 0)
    sizes = {
        name: Size(LIMITS[key])
        for name in names
        if (key := _limited(name, info.current_unit)) is not None
    }
    n_samples = 0
    apart: list[str] = []
    groups = _row_groups(blocks, schema)
    with closing(groups), write_run(run, info, schema) as writer:
        for table in groups:
            for name in names:
                values = table.column(name).to_numpy()
                missing[name] += int(np.isnan(values).sum())
                if name in sizes:
                    of_position = quantity_of(name) == "position"
                    rate = info.sampling_rate_hz
                    sizes[name].add(strided_speed(values, rate) if of_position else values)
            if n_samples == 0:  # a minute and more
                apart = _units_apart(path, channels, info.sampling_rate_hz, table)
            n_samples += table.num_rows
            writer.write_table(table)
        if n_samples == 0:
            msg = f"{path}: holds no samples; check the map's skip_rows and sources"
            raise InputError(msg)
        for name, count in missing.items():
            if count == n_samples:
                msg = (
                    f"{path}: column {name} (source {channels.columns[name].source!r}) has no "
                    f"value in {n_samples} rows; name another source in the map"
                )
                raise InputError(msg)
        doubts = apart
        for name, size in sizes.items():
            source = channels.columns[name].source
            speed = "the speed of " if quantity_of(name) == "position" else ""
            doubt = f"{path}: {speed}column {name} (source {source!r}) {size.doubt()}"
            if size.is_impossible and quantity_of(name) != "temperature":
                msg = f"{doubt} Correct its unit or scale in the map"
                raise InputError(msg)
            doubts += [doubt] if size.doubt() else []
    lost = [
        f"{path}: column {name} (source {channels.columns[name].source!r}) has no value in "
        f"{count / n_samples:.0%} of the rows; look at the logger, or leave the axis out"
        for name, count in missing.items()
        if count > MOST_EMPTY * n_samples and quantity_of(name) != "temperature"
    ]
    return Written(n_samples, {name: n for name, n in missing.items() if n}, tuple(doubts), lost)


def _units_apart(path: Path, channels: IngestMap, rate_hz: float, table: pa.Table) -> list[str]:
    """Say which axes' speeds are not their positions', but would be in another unit."""
    joints = [name.removesuffix("_velocity") for name in table.column_names if "_vel" in name]
    joints = [joint for joint in joints if f"{joint}_position" in table.column_names]
    found: dict[str, list[str]] = {}
    if joints:  # scipy takes as long to load as all else, and most logs have no speed
        from opamc_cli.signal.motion.reported import unwrapped
        from opamc_cli.signal.motion.signs import speed_ratio
        from opamc_cli.stages.recordings.axis_recording import fitting_units
    for joint in joints:
        names = [f"{joint}_position", f"{joint}_velocity"]
        position, velocity = (table.column(name).to_numpy() for name in names)
        ratio = speed_ratio(unwrapped(position), velocity, rate_hz)
        declared = [channels.columns[name].unit for name in names]
        units = [ALIASES.get(unit, unit) for unit in declared]
        fit = [" and ".join(each.values()) for each in fitting_units(ratio or 1.0, *units)]
        # what is nearer to 1 a filter or a coarse encoder makes as well
        if fit or (ratio is not None and not 1 / ONE_UNIT < ratio < ONE_UNIT):
            agree = f"{', or '.join(fit)} would agree"
            said = (
                f"is {ratio:.2g} times the rate of change of its position, in the map's units "
                f"({' and '.join(declared)}); {agree if fit else NO_UNITS}: correct the map"
            )
            found.setdefault(said, []).append(joint.removeprefix("axis"))
    return [f"{path}: the speed of axis {', '.join(axes)} {said}" for said, axes in found.items()]


def _limited(name: str, current_unit: str) -> str | None:
    """Return which limit a column is held against."""
    quantity = quantity_of(name)
    key = current_unit if quantity == "current" else quantity
    return key if key in LIMITS else None


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
    # what no reader takes for a measurement, an infinity among it
    known = np.where(np.abs(values) <= LARGEST_SAMPLE, values, np.nan)
    return np.asarray(known.astype(width.to_pandas_dtype()))
