"""ASAM MDF 3 and 4 files of measurement and calibration tools.

Channels are named as in the file, or ``GROUP/name`` with the group's number where several groups
have one of that name. Every group has its own clock, ``time`` or ``GROUP/time``, in seconds from
the start of the measurement, which is ``@start_time``.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import (
    BLOCK_ROWS,
    Array,
    Block,
    Listed,
    Name,
    Selection,
    check_lengths,
    check_mark,
    missing_channel,
    missing_library,
)

CLOCK = "time"
MARKS = (b"MDF     ", b"UnFinMF ")


@contextmanager
def open_mdf(path: Path) -> Iterator["MdfSource"]:
    """Open an MDF file.

    Raises
    ------
    InputError
        If asammdf is not installed or it is not MDF.
    """
    check_mark(path, MARKS, "an MDF file")
    try:
        from asammdf import MDF
        from asammdf.blocks.utils import MdfException
    except ImportError as error:
        raise missing_library(path, "asammdf", "mdf") from error
    try:
        with MDF(path) as file:
            yield MdfSource(path, file)
    except MdfException as error:
        reason = " ".join(str(error).split())[:120]
        msg = f"{path}: cannot be read as MDF ({reason}); the file is damaged"
        raise InputError(msg) from error


class MdfSource:
    """An open MDF file; channels are read part by part."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file
        places: dict[str, list[tuple[int, int]]] = {}
        self._units: dict[tuple[int, int], str | None] = {}
        self._clocks: set[tuple[int, int]] = set()
        for group, content in enumerate(file.groups):
            clock = file.masters_db.get(group)
            for index, channel in enumerate(content.channels):
                name = CLOCK if index == clock else str(channel.name)
                places.setdefault(name, []).append((group, index))
                self._units[group, index] = str(getattr(channel, "unit", "") or "") or None
            if clock is not None:
                self._clocks.add((group, clock))
        self._place: dict[str, tuple[int, int]] = {}
        for name, found in places.items():
            for group, index in found:
                self._place[name if len(found) == 1 else f"{group}/{name}"] = (group, index)

    def channels(self) -> list[Listed]:
        """Return the channels that hold numbers."""
        listed = []
        for name, (group, index) in self._place.items():
            first = self._part(group, index, 0, 1)
            if first.dtype.kind in "fiu" and first.ndim == 1 and first.size:
                unit = "s" if (group, index) in self._clocks else self._units[group, index]
                rows = int(self._file.groups[group].channel_group.cycles_nr)
                listed.append(Listed(name, unit=unit, rows=rows))
        return listed

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected channels block by block."""
        places = {name: self._find(selection.source) for name, selection in selections.items()}
        lengths: dict[Name, int] = {}
        for name, (group, _) in places.items():
            lengths[selections[name].source] = self._file.groups[group].channel_group.cycles_nr
        n_samples = check_lengths(self.path, lengths)
        for start in range(0, n_samples, BLOCK_ROWS):
            block: Block = {}
            for name, (group, index) in places.items():
                values = self._part(group, index, start, BLOCK_ROWS)
                if values.dtype.kind not in "fiub" or values.ndim != 1:
                    source = selections[name].source
                    msg = f"{self.path}: {source!r} holds {values.dtype}, numbers are needed"
                    raise InputError(msg)
                block[name] = values.astype(np.float64)
            yield block

    def value(self, source: Name) -> object:
        """Return ``@start_time``, or a channel's first value."""
        if source == "@start_time":
            start: object = self._file.start_time
            return start
        group, index = self._find(source)
        values = self._part(group, index, 0, 1)
        if not values.size:
            msg = f"{self.path}: channel {source!r} is empty where a value is needed"
            raise InputError(msg)
        return values[0]

    def _find(self, source: Name) -> tuple[int, int]:
        if str(source) not in self._place:
            raise missing_channel(self.path, source, list(self._place))
        return self._place[str(source)]

    def _part(self, group: int, index: int, start: int, count: int) -> Array:
        if (group, index) in self._clocks:
            clock = self._file.get_master(group, record_offset=start, record_count=count)
            return np.asarray(clock)
        found = self._file.get(
            group=group, index=index, record_offset=start, record_count=count, raw=False
        )
        return np.asarray(found.samples)
