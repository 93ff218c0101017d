"""The map file: which channel of a foreign recording becomes which column of a run."""

import codecs
import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from opamc_cli.config.files import read_values, validate
from opamc_cli.errors import ConfigError, InputError
from opamc_cli.storage.ingest.units import (
    ISO8601,
    QUANTITY_OF_KIND,
    SAMPLES,
    conversion,
    known_units,
)

FORMAT_OF_ENDING = {
    ".csv": "csv",
    ".txt": "csv",
    ".tsv": "csv",
    ".dat": "csv",
    ".mat": "mat",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
    ".tdms": "tdms",
}
CSV_KEYS = frozenset({"separator", "decimal", "header", "encoding", "skip_rows", "units_rows"})

_COLUMN = re.compile(r"axis[1-9][0-9]*_(a|b|c|current|position|velocity|temperature)")

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Name = int | str
"""A channel: column number from 0 or name (CSV), "struct.field" (MAT), "group/dataset" (HDF5),
"group/channel" (TDMS)."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ColumnMap(_Strict):
    """One channel of the source: run value = source · scale + offset, in `unit`."""

    source: Name
    unit: str
    index: Annotated[int, Field(ge=0)] | None = None
    scale: Annotated[float, Field(allow_inf_nan=False)] = 1.0
    offset: Annotated[float, Field(allow_inf_nan=False)] = 0.0
    unwrap: bool = False


class TimeMap(_Strict):
    """The column of time stamps, and what to do where they are uneven."""

    source: Name
    unit: str
    index: Annotated[int, Field(ge=0)] | None = None
    interpolation: Literal["cubic", "linear"] = "cubic"
    max_gap_samples: Annotated[float, Field(ge=1.5, le=1000)] = 2.5


class RateMap(_Strict):
    """A sampling rate (Hz, kHz) or period (s, ms, us, ns) that the source itself holds."""

    source: Name
    unit: str


class ValueMap(_Strict):
    """A value that the source itself holds, in its first row or as an attribute."""

    source: Name


class MetadataMap(_Strict):
    """What a run says of itself."""

    robot: str | ValueMap | None = None
    program: str | ValueMap | None = None
    speed_percent: float | ValueMap | None = None
    payload_kg: float | ValueMap | None = None
    started_at: datetime | str | ValueMap | None = None


class IngestMap(_Strict):
    """The map file.

    Attributes
    ----------
    format
        None: by the file's ending.
    separator
        One or more characters, "tab" or "whitespace" (runs of blanks and tabs).
    decimal
        Decimal mark.
    header
        Whether a line with column names stands before the data.
    encoding
        Of the text.
    skip_rows
        Lines before the header (or before the data, without one).
    units_rows
        Lines between header and data.
    columns
        Run column by name, such as ``axis1_a``.
    sampling_rate_hz
        Samples per second. With `time` it is the rate to resample to; without `time` the rows
        are taken as evenly spaced.
    time
        Time stamps.
    metadata
        What the run says of itself.
    """

    format: Literal["csv", "mat", "hdf5", "tdms"] | None = None
    separator: str = Field(",", min_length=1)
    decimal: Literal[".", ","] = "."
    header: bool = True
    encoding: str = "utf-8"
    skip_rows: Annotated[int, Field(ge=0)] = 0
    units_rows: Annotated[int, Field(ge=0)] = 0
    columns: dict[str, ColumnMap] = Field(min_length=1)
    sampling_rate_hz: Positive | RateMap | None = None
    time: TimeMap | None = None
    metadata: MetadataMap = MetadataMap()


def load_map(path: Path, overrides: Sequence[str] = ()) -> IngestMap:
    """Return a map file, with `key=value` overrides applied.

    Raises
    ------
    ConfigError
        If it cannot be read, or a key, column name, unit or combination is not allowed.
    """
    channels = validate(IngestMap, read_values(path, overrides), str(path))
    _check_columns(path, channels)
    _check_timing(path, channels)
    _check_text_options(path, channels)
    return channels


def format_of(path: Path, channels: IngestMap) -> str:
    """Return the format of a file: as the map says, or by the file's ending.

    Raises
    ------
    InputError
        If neither tells.
    """
    suffixes = [suffix.lower() for suffix in path.suffixes if suffix.lower() != ".gz"]
    found = channels.format or FORMAT_OF_ENDING.get(suffixes[-1] if suffixes else "")
    if found is None:
        msg = (
            f"{path}: its ending does not tell the format; "
            "set format to csv, mat, hdf5 or tdms in the map"
        )
        raise InputError(msg)
    return found


def quantity_of(column: str) -> str:
    """Return the quantity of a run's column.

    Examples
    --------
    >>> quantity_of("axis2_b")
    'current'
    """
    return QUANTITY_OF_KIND[column.partition("_")[2]]


def _check_columns(path: Path, channels: IngestMap) -> None:
    for name, column in channels.columns.items():
        if not _COLUMN.fullmatch(name):
            msg = (
                f"{path}: columns.{name} is not a column of a run; known: axisN_a, axisN_b, "
                "axisN_c, axisN_current, axisN_position, axisN_velocity, axisN_temperature "
                "with N from 1"
            )
            raise ConfigError(msg)
        quantity = quantity_of(name)
        if conversion(column.unit, quantity) is None:
            msg = (
                f"{path}: columns.{name}.unit is {column.unit!r}; "
                f"units of a {quantity}: {known_units(quantity)}"
            )
            raise ConfigError(msg)
        if column.unwrap and quantity != "position":
            msg = f"{path}: columns.{name}.unwrap is for positions, {name} is a {quantity}"
            raise ConfigError(msg)
    if not any(quantity_of(name) == "current" for name in channels.columns):
        msg = (
            f"{path}: columns names no current; a run needs axis1_a (axis1_b, axis1_c) "
            "or axis1_current"
        )
        raise ConfigError(msg)


def _check_timing(path: Path, channels: IngestMap) -> None:
    time, rate = channels.time, channels.sampling_rate_hz
    if time is None and rate is None:
        msg = f"{path}: no sampling_rate_hz and no time column; give one of the two"
        raise ConfigError(msg)
    if isinstance(rate, RateMap) and _rate_kind(rate) is None:
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


def _rate_kind(rate: RateMap) -> str | None:
    for quantity in ("rate", "time"):
        if conversion(rate.unit, quantity) is not None:
            return quantity
    return None


def rate_hz(rate: RateMap, value: float) -> float:
    """Return the sampling rate that a rate or period in the source stands for."""
    quantity = _rate_kind(rate) or "rate"
    known = conversion(rate.unit, quantity)
    scaled = value * (known.factor if known else 1.0)
    return scaled if quantity == "rate" else 1.0 / scaled


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
