"""What a foreign recording offers, whatever its format."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.formats import FORMATS

Name = int | str
"""A channel: column number from 0 or name (CSV), "struct.field" (MAT), "group/dataset" (HDF5),
"group/channel" (TDMS), "/topic/joint/effort" (ROS); docs/formats.md has them all."""

Array = npt.NDArray[Any]
Block = dict[str, Array]

RATE_NAMES = frozenset(["fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency"])
"""What the samples per second are called in files, but for case, marks and a unit's "Hz"."""

BLOCK_ROWS = 1 << 16
"""Rows that are in memory at a time: 10 MB for 20 channels."""


@dataclass(frozen=True)
class Selection:
    """One channel to be read."""

    source: Name
    """Its number or name in the file."""
    index: int | None = None
    """Column of a two-dimensional dataset."""
    dates: bool = False
    """It holds dates and times as text."""


@dataclass(frozen=True)
class Rate:
    """Where a file holds the rate of a channel."""

    hz: float
    """Samples per second."""
    source: str
    """What a map calls the value."""
    unit: str
    """Its unit: a period's where it is one."""


@dataclass(frozen=True)
class Listed:
    """A channel that a recording offers."""

    name: Name
    """What a map calls it."""
    width: int | None = None
    """Columns of a two-dimensional one, which the map picks by `index`; None: it has one."""
    unit: str | None = None
    """As the file declares it, None where it does not."""
    dates: bool = False
    """It holds dates and times."""
    repeated: str | None = None
    """The name that it shares with others, where it is called by its number for that."""
    rows: int | None = None
    """How many values it has, None where all channels have as many."""
    labels: tuple[str, ...] = ()
    """What each column of a two-dimensional one is, such as the names of joints."""
    rate: Rate | None = None
    """As the file declares it, None where it does not."""


class Source(Protocol):
    """An open foreign recording."""

    def channels(self) -> list[Listed]:
        """Return the channels that hold numbers or dates, in the file's order."""
        ...

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected channels block by block, in the file's order.

        Numbers are float64 in the file's unit, with NaN where a value is missing; dates are
        datetime64[us], with NaT. All channels of a block have equal length.

        Raises
        ------
        InputError
            If a channel is not there or holds something else.
        """
        ...

    def value(self, source: Name) -> object:
        """Return a single value: a channel's first, or an attribute."""
        ...

    @property
    def remarks(self) -> list[str]:
        """Sentences on what was left out while reading."""
        ...


def declared_rate(values: Mapping[str, Any], place: str = "") -> Rate | None:
    """Find the samples per second among values of a file, by their names.

    `place` is what comes before a name to make it a source.

    Examples
    --------
    >>> declared_rate({"unit": "A", "SampleRate_Hz": 2000}, "motor@")
    Rate(hz=2000.0, source='motor@SampleRate_Hz', unit='Hz')
    """
    for name, value in values.items():
        plain = re.sub(r"[^a-z]", "", name.lower()).removesuffix("hz")
        found = np.ravel(np.asarray(value))
        if plain in RATE_NAMES and found.size == 1 and found.dtype.kind in "fiu" and found[0] > 0:
            return Rate(float(found[0]), place + name, "Hz")
    return None


def missing_channel(path: Path, source: Name, known: list[str]) -> InputError:
    """Return the error for a channel that is not in the file."""
    shown = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
    return InputError(f"{path}: no channel {source!r}; the file has {shown or 'none'}")


def missing_library(path: Path, name: str, format_name: str) -> InputError:
    """Return the error for a format whose library is not installed."""
    extra = FORMATS[format_name].extra
    return InputError(
        f"{path}: reading this format needs {name}; install it with pip install 'opamc[{extra}]'"
    )


def check_mark(path: Path, marks: Sequence[bytes], kind: str) -> None:
    """Refuse a file that does not begin with one of some marks of equal length.

    Raises
    ------
    InputError
        Naming what it begins with.
    """
    with path.open("rb") as handle:
        mark = handle.read(len(marks[0]))
    if mark not in marks:
        msg = f"{path}: is not {kind} (it starts with {mark!r}); check format in the map"
        raise InputError(msg)


def samples_of(
    path: Path, source: Name, index: int | None, shape: tuple[int, ...]
) -> tuple[int, int | None]:
    """Return (samples, which dimension holds them) of a dataset of one or two dimensions.

    In two dimensions the longer one is time; None stands for a dataset of one dimension.

    Raises
    ------
    InputError
        If the shape and the index do not name one channel.
    """
    shown = "x".join(map(str, shape)) or "a single value"
    long = [size for size in shape if size > 1]
    if len(shape) == 1 or (len(shape) == 2 and len(long) <= 1 and index is None):
        if index is not None:
            msg = f"{path}: {source!r} has one dimension ({shown}); drop its index in the map"
            raise InputError(msg)
        return max(shape), None if len(shape) == 1 else int(np.argmax(shape))
    if len(shape) != 2:
        msg = f"{path}: {source!r} has shape {shown}; a channel has one dimension, or two"
        raise InputError(msg)
    time = int(np.argmax(shape))
    if index is None or not index < shape[1 - time]:
        msg = (
            f"{path}: {source!r} holds {shape[1 - time]} channels ({shown}), index is {index}; "
            f"set index to 0..{shape[1 - time] - 1} in the map"
        )
        raise InputError(msg)
    return shape[time], time


def width_of(shape: tuple[int, ...]) -> int | Literal[False] | None:
    """Return how many channels a dataset holds: None for a single one, False where it has none.

    Examples
    --------
    >>> width_of((5000,)), width_of((1, 5000)), width_of((5000, 6)), width_of((1, 1))
    (None, None, 6, False)
    """
    long = [size for size in shape if size > 1]
    if not long or len(shape) > 2:
        return False
    return None if len(long) == 1 else min(long)


def check_lengths(path: Path, lengths: Mapping[Name, int]) -> int:
    """Return the common length of some channels.

    Raises
    ------
    InputError
        If they differ.
    """
    first, n_first = next(iter(lengths.items()))
    for name, n in lengths.items():
        if n != n_first:
            msg = (
                f"{path}: {name!r} has {n} samples, {first!r} has {n_first}; "
                "the channels of a run have equal length"
            )
            raise InputError(msg)
    return n_first
