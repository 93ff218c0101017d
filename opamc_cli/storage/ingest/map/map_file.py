"""The map file: which channel of a foreign recording becomes which column of a run."""

from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StrictBool

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.formats import FORMATS, format_by_ending, known_endings
from opamc_cli.storage.ingest.map.axes import at_zero, expand, has_placeholder
from opamc_cli.storage.ingest.map.units import conversion
from opamc_cli.storage.ingest.source import Listed, Name

Positive = Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]
Finite = Annotated[float, Field(ge=-1e15, le=1e15, allow_inf_nan=False)]
MOST_SKIPPED = 1_000_000
"""Lines before the data: no logger writes a longer heading."""
if TYPE_CHECKING:
    Format = str
else:
    Format = Literal[tuple(FORMATS)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ColumnMap(_Strict):
    """One channel of the source: run value = source · scale + offset, in `unit`.

    An optional one is left out where the recording has no such channel.
    """

    source: Name
    unit: str
    index: Annotated[int, Field(ge=0)] | Annotated[str, Field(pattern="^«n.*»$")] | None = None
    scale: Finite = 1.0
    offset: Finite = 0.0
    unwrap: Positive | StrictBool = False
    """True: where a turn ends, in `unit`; a number: where the source's values do, before scale."""
    optional: bool = False


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


def _no_number(value: object) -> object:
    # YAML takes 0123 for 83, and 20260301 for a day in 1970
    if isinstance(value, bool | int | float):
        msg = f"{value} is read as a number; put it in quotes"
        raise ValueError(msg)
    return value


Text = Annotated[str | ValueMap | None, BeforeValidator(_no_number)]


class MetadataMap(_Strict):
    """What a run says of itself."""

    robot: Text = None
    program: Text = None
    speed_percent: float | ValueMap | None = None
    payload_kg: float | ValueMap | None = None
    started_at: Annotated[datetime | str | ValueMap | None, BeforeValidator(_no_number)] = None
    session: Text = None


class IngestMap(_Strict):
    """The map file."""

    format: Format | None = None
    """None: by the file's ending."""
    separator: str = Field(",", min_length=1, max_length=100)
    """One or more characters, "tab" or "whitespace" (runs of blanks and tabs)."""
    decimal: Literal[".", ","] = "."
    """Decimal mark."""
    header: bool = True
    """Whether a line with column names stands before the data."""
    encoding: str = "utf-8"
    """Of the text."""
    skip_rows: Annotated[int, Field(ge=0, le=MOST_SKIPPED)] = 0
    """Lines before the header (or before the data, without one)."""
    units_rows: Annotated[int, Field(ge=0, le=MOST_SKIPPED)] = 0
    """Lines between header and data."""
    missing: tuple[str, ...] = ()
    """Texts that stand for no number, beside "", "NaN", "N/A" and the like."""
    axes: Annotated[int, Field(ge=1, le=32)] | None = None
    """For how many axes a line with `{n}` stands; None: for as many as the file has."""
    columns: dict[str, ColumnMap] = Field(min_length=1)
    """Run column by name, such as ``axis1_a``, or for all axes, ``axis{n}_a``."""
    sampling_rate_hz: Positive | RateMap | None = None
    """Samples per second, by declaration. Without `time` the rows are taken as evenly spaced."""
    resample_hz: Positive | None = None
    """Rate of the run, whatever the clock says; None: the declared rate, or else the measured."""
    time: TimeMap | None = None
    """Time stamps."""
    metadata: MetadataMap = MetadataMap()
    """What the run says of itself."""


def for_axes(
    channels: IngestMap, listed: Callable[[], Sequence[Listed]] | None = None
) -> IngestMap:
    """Return a map with a line for every axis instead of those with `{n}`.

    Parameters
    ----------
    channels
        The map.
    listed
        Returns what the recording offers: it tells the number of axes where the map does not,
        and which optional channels are there. None: as for one axis that has them all.
    """
    several = any(has_placeholder(name) for name in channels.columns)
    if not several and not any(column.optional for column in channels.columns.values()):
        return channels
    offered = {each.name: each.width for each in listed()} if listed is not None else {}

    def exists(entry: Mapping[str, Any]) -> bool:
        source, index = entry["source"], entry.get("index")
        if listed is None:
            return True
        return source in offered and (index is None or index < (offered[source] or 0))

    entries = {
        name: column.model_dump(exclude_defaults=True) for name, column in channels.columns.items()
    }
    if several:
        entries = expand(entries, channels.axes or (None if listed is not None else 1), exists)
    columns = {
        name: ColumnMap.model_validate(entry)
        for name, entry in entries.items()
        if exists(entry) or not entry.get("optional")
    }
    return channels.model_copy(update={"columns": columns})


def count_doubts(
    path: Path, channels: IngestMap, own: IngestMap, listed: Sequence[Listed]
) -> tuple[list[str], list[str]]:
    """Say where lines for all axes and the channels of a file do not count alike.

    Parameters
    ----------
    path
        The file, for the sentences.
    channels, own
        The map, and what `for_axes` made of it for this file.
    listed
        What the file offers.

    Returns
    -------
    tuple
        Sentences on axes that are missing between others, and on joints that are left out.
    """
    axes = {int(name[4 : name.index("_")]) for name in own.columns}
    gap = sorted(set(range(min(axes), max(axes))) - axes)
    gaps = (
        f"{path}: has no channel for axis {', '.join(map(str, gap))}, but for axis {max(axes)}; "
        "look for a name that differs, or write a line for each axis"
    )
    used = {column.source for column in own.columns.values()}
    used |= {own.time.source} if own.time else set()
    zero = {at_zero(column.source) for column in channels.columns.values()}
    left = [str(each.name) for each in listed if each.name in zero - used]
    lost = (
        f"{path}: {', '.join(left)} is in no run: {{n}} counts from 1; write {{n-1}} if its joints "
        "are counted from 0"
    )
    several = any(has_placeholder(name) for name in channels.columns)
    return [gaps] if gap and several else [], [lost] if left else []


def format_of(path: Path, channels: IngestMap) -> str:
    """Return the format of a file: as the map says, or by the file's ending.

    Raises
    ------
    InputError
        If neither tells.
    """
    found = channels.format or format_by_ending(path)
    if found is None:
        msg = (
            f"{path}: its ending does not tell the format; set format in the map; "
            f"known: {known_endings()}"
        )
        raise InputError(msg)
    return found


def rate_kind(rate: RateMap) -> str | None:
    """Return whether a unit is one of a rate or of a time (a period), None if of neither."""
    for quantity in ("rate", "time"):
        if conversion(rate.unit, quantity) is not None:
            return quantity
    return None


def rate_hz(rate: RateMap, value: float) -> float:
    """Return the sampling rate that a rate or period in the source stands for."""
    quantity = rate_kind(rate) or "rate"
    known = conversion(rate.unit, quantity)
    scaled = value * (known.factor if known else 1.0)
    return scaled if quantity == "rate" else 1.0 / scaled
