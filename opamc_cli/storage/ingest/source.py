"""What a foreign recording offers, whatever its format."""

import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.map import IngestMap, Name, format_of

Array = npt.NDArray[Any]
Block = dict[str, Array]

BLOCK_ROWS = 1 << 16
"""Rows that are in memory at a time: 10 MB for 20 channels."""

LIBRARY_ERRORS = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    struct.error,
    zlib.error,
)
"""What h5py, scipy and npTDMS raise on damaged files, for want of errors of their own."""


@dataclass(frozen=True)
class Selection:
    """One channel to be read.

    Attributes
    ----------
    source
        Its number or name in the file.
    index
        Column of a two-dimensional dataset.
    dates
        It holds dates and times as text.
    """

    source: Name
    index: int | None = None
    dates: bool = False


class Source(Protocol):
    """An open foreign recording."""

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


@contextmanager
def open_source(path: Path, channels: IngestMap) -> Iterator[Source]:
    """Open a foreign recording.

    Raises
    ------
    InputError
        If it is missing, damaged or not of its format, or a library to read it is not installed.
    """
    if path.is_dir():
        msg = f"{path}: is a folder where a recording is needed; name the files in it"
        raise InputError(msg)
    if not path.exists():
        msg = f"{path}: no such file; check the path"
        raise InputError(msg)
    if path.stat().st_size == 0:
        msg = f"{path}: is empty (0 bytes); record it again"
        raise InputError(msg)
    with ExitStack() as stack:
        with _readable(path):
            source = stack.enter_context(_opened(path, channels))
        yield _Guarded(path, source)


def _opened(path: Path, channels: IngestMap) -> AbstractContextManager[Source]:
    # each format's library is imported only where that format is read
    match format_of(path, channels):
        case "csv":
            from opamc_cli.storage.ingest.csv import CsvSource

            return CsvSource(path, channels)
        case "mat":
            from opamc_cli.storage.ingest.mat import open_mat

            return open_mat(path)
        case "hdf5":
            from opamc_cli.storage.ingest.hdf5 import open_hdf5

            return open_hdf5(path)
        case _:
            from opamc_cli.storage.ingest.tdms import open_tdms

            return open_tdms(path)


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        yield
    except LIBRARY_ERRORS as error:
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        msg = f"{path}: cannot be read ({reason}); it is damaged, or format in the map is wrong"
        raise InputError(msg) from error


class _Guarded:
    """A source whose library's errors name the file."""

    def __init__(self, path: Path, source: Source) -> None:
        self._path = path
        self._source = source

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        blocks = self._source.blocks(selections)
        while True:
            with _readable(self._path):
                block = next(blocks, None)
            if block is None:
                return
            yield block

    def value(self, source: Name) -> object:
        with _readable(self._path):
            return self._source.value(source)


def missing_channel(path: Path, source: Name, known: list[str]) -> InputError:
    """Return the error for a channel that is not in the file."""
    shown = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
    return InputError(f"{path}: no channel {source!r}; the file has {shown or 'none'}")


def missing_library(path: Path, name: str) -> InputError:
    """Return the error for a format whose library is not installed."""
    return InputError(
        f"{path}: reading this format needs {name}; install it with pip install 'opamc[ingest]'"
    )


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
