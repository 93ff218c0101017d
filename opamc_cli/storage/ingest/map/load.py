"""Read a map file, and refuse what cannot be in it although every key and value is allowed."""

import codecs
from collections.abc import Sequence
from pathlib import Path

from opamc_cli.config.files import read_values, validate
from opamc_cli.config.shipped import shipped_file
from opamc_cli.errors import ConfigError
from opamc_cli.storage.ingest.map.axes import as_written, has_placeholder, protect, shown
from opamc_cli.storage.ingest.map.map_file import (
    IngestMap,
    RateMap,
    for_axes,
    rate_kind,
)
from opamc_cli.storage.ingest.map.units import ISO8601, SAMPLES, conversion, is_torque, known_units
from opamc_cli.storage.schemas.channels import CHANNELS, COLUMN, quantity_of

CSV_KEYS = frozenset(
    {"separator", "decimal", "header", "encoding", "skip_rows", "units_rows", "missing"}
)


def load_map(path: Path, overrides: Sequence[str] = ()) -> IngestMap:
    """Return a map file or a shipped map by its name, with `key=value` overrides applied.

    Raises
    ------
    ConfigError
        If it cannot be read, or a key, column name, unit or combination is not allowed.
    """
    file = shipped_file(path, "maps")
    with as_written():
        channels = validate(IngestMap, read_values(file, overrides, protect), str(path), overrides)
    check_map(path, channels)
    return channels


def check_map(path: Path, channels: IngestMap) -> None:
    """Check a map whose keys are all known.

    Raises
    ------
    ConfigError
        Naming `path` and the first key that is wrong.
    """
    _check_placeholders(path, channels)
    filled = for_axes(channels)
    _check_columns(path, filled)
    _check_timing(path, filled)
    _check_text_options(path, filled)


def _check_placeholders(path: Path, channels: IngestMap) -> None:
    for name, column in channels.columns.items():
        here = has_placeholder(name)
        there = has_placeholder(column.source) or has_placeholder(column.index)
        if here != there:
            side = "its source and index do not" if here else "columns name no {n}"
            msg = f"{path}: columns.{shown(name)}: {{n}} stands on one side only; {side} hold it"
            raise ConfigError(msg)
    if channels.axes is not None and not any(has_placeholder(name) for name in channels.columns):
        msg = f"{path}: axes is {channels.axes}, but no column holds {{n}}, such as axis{{n}}_a"
        raise ConfigError(msg)


def _check_columns(path: Path, channels: IngestMap) -> None:
    for name, column in channels.columns.items():
        if not COLUMN.fullmatch(name):
            known = ", ".join(f"axisN_{channel}" for channel in CHANNELS)
            msg = (
                f"{path}: columns.{name} is not a column of a run; known: {known} with N from 1, "
                "or {n} for all axes"
            )
            raise ConfigError(msg)
        quantity = quantity_of(name)
        if conversion(column.unit, quantity) is None:
            rated = "; for per cent write A or Nm and scale: rated / 100, or A and scale: 0.01 if "
            rated += "the rated one is not known: what is compared is relative"
            msg = (
                f"{path}: columns.{name}.unit is {column.unit!r}; "
                f"units of a {quantity}: {known_units(quantity)}"
                f"{rated if column.unit == '%' else ''}"
            )
            raise ConfigError(msg)
        if column.unwrap is True and quantity != "position":
            msg = f"{path}: columns.{name}.unwrap: true is for positions, {name} is a {quantity}"
            raise ConfigError(msg)
    _check_sources(path, channels)
    _check_currents(path, channels)


def _check_sources(path: Path, channels: IngestMap) -> None:
    """Refuse a channel that two columns are made from; one thermometer may serve all joints."""
    used: dict[tuple[object, object], str] = {}
    for name, column in channels.columns.items():
        if column.scale == 0:
            msg = f"{path}: columns.{name}.scale is 0, which leaves nothing of the channel"
            raise ConfigError(msg)
        first = used.setdefault((column.source, column.index), name)
        if first != name and quantity_of(name) != "temperature":
            msg = f"{path}: columns.{first} and columns.{name} are both of {column.source!r}"
            raise ConfigError(msg)


def _check_currents(path: Path, channels: IngestMap) -> None:
    currents = [name for name in channels.columns if quantity_of(name) == "current"]
    if not currents:
        msg = (
            f"{path}: columns names no current; a run needs axis1_a (axis1_b, axis1_c) "
            "or axis1_current"
        )
        raise ConfigError(msg)
    torques = [name for name in currents if is_torque(channels.columns[name].unit)]
    if any(not name.endswith("_current") for name in torques):
        msg = f"{path}: columns.{torques[0]} is in Nm; a torque stands for axisN_current alone"
        raise ConfigError(msg)
    if torques and len(torques) < len(currents):
        other = next(name for name in currents if name not in torques)
        msg = (
            f"{path}: columns.{torques[0]} is a torque, columns.{other} a current; "
            "a run holds the one or the other"
        )
        raise ConfigError(msg)


def _check_timing(path: Path, channels: IngestMap) -> None:
    time, rate = channels.time, channels.sampling_rate_hz
    if time is None and rate is None:
        msg = f"{path}: no sampling_rate_hz and no time column; give one of the two"
        raise ConfigError(msg)
    if isinstance(rate, RateMap) and rate_kind(rate) is None:
        msg = (
            f"{path}: sampling_rate_hz.unit is {rate.unit!r}; "
            "a rate is in Hz or kHz, a period in s, ms, us or ns"
        )
        raise ConfigError(msg)
    if time is None:
        return
    if time.unit not in (SAMPLES, ISO8601) and conversion(time.unit, "time") is None:
        msg = f"{path}: time.unit is {time.unit!r}; units of time: {known_units('time')}"
        raise ConfigError(msg)
    if time.unit == SAMPLES and rate is None:
        msg = f"{path}: time counts samples, so sampling_rate_hz must say how many make a second"
        raise ConfigError(msg)


def _check_text_options(path: Path, channels: IngestMap) -> None:
    given = sorted(CSV_KEYS & channels.model_fields_set)
    if channels.format not in (None, "csv") and given:
        msg = f"{path}: {given[0]} is for csv, the map's format is {channels.format}"
        raise ConfigError(msg)
    if channels.separator == channels.decimal:
        msg = (
            f"{path}: separator and decimal are both {channels.decimal!r}; "
            "a file with decimal commas separates by ';' or 'tab'"
        )
        raise ConfigError(msg)
    try:
        codecs.lookup(channels.encoding)
    except LookupError as error:
        msg = f"{path}: encoding is {channels.encoding!r}; use utf-8, latin-1, cp1252 or utf-16"
        raise ConfigError(msg) from error
    if channels.format in (None, "csv") and not channels.header:
        for name, column in channels.columns.items():
            if isinstance(column.source, str):
                msg = (
                    f"{path}: columns.{name}.source is {column.source!r}; without a header line "
                    "columns are numbered from 0"
                )
                raise ConfigError(msg)
