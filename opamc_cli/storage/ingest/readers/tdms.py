"""TDMS files of LabVIEW and its data acquisition; channels are named ``group/channel``."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import (
    BLOCK_ROWS,
    Block,
    Listed,
    Name,
    Rate,
    Selection,
    check_lengths,
    check_mark,
    missing_channel,
    missing_library,
)
from opamc_cli.storage.ingest.time.dates import parse_dates

STEP = "wf_increment"
"""Property of a channel: seconds from sample to sample."""


@contextmanager
def open_tdms(path: Path) -> Iterator["TdmsSource"]:
    """Open a TDMS file.

    Raises
    ------
    InputError
        If it is not TDMS or npTDMS is not installed.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise missing_library(path, "npTDMS", "tdms") from error
    check_mark(path, (b"TDSm",), "a TDMS file")
    with TdmsFile.open(path) as file:
        yield TdmsSource(path, file)


class TdmsSource:
    """An open TDMS file; channels are read slice by slice."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file

    def channels(self) -> list[Listed]:
        """Return the channels that hold numbers or time stamps."""
        listed = []
        for group in self._file.groups():
            for channel in group.channels():
                kind = np.dtype(channel.dtype).kind
                if kind in "fiuM" and len(channel):
                    name, own = f"{group.name}/{channel.name}", channel.properties
                    step_s = float(own.get(STEP, 0.0))
                    rate = Rate(1 / step_s, f"{name}@{STEP}", "s") if step_s > 0 else None
                    unit = own.get("unit_string")
                    listed.append(Listed(name, unit=unit, dates=kind == "M", rate=rate))
        return listed

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected channels block by block."""
        channels = {name: self._channel(s.source) for name, s in selections.items()}
        for name, selection in selections.items():
            if selection.index is not None:
                msg = f"{self.path}: {selection.source!r} has one dimension; drop its index"
                raise InputError(msg)
            kind = np.dtype(channels[name].dtype).kind
            if kind not in "fiub" and not selection.dates:
                msg = f"{self.path}: {selection.source!r} holds {kind}, numbers are needed"
                raise InputError(msg)
        lengths = {selections[name].source: len(channel) for name, channel in channels.items()}
        n_samples = check_lengths(self.path, lengths)
        for start in range(0, n_samples, BLOCK_ROWS):
            length = min(BLOCK_ROWS, n_samples - start)
            block: Block = {}
            for name, channel in channels.items():
                values = np.asarray(channel.read_data(offset=start, length=length))
                if not selections[name].dates:
                    block[name] = values.astype(np.float64)
                elif values.dtype.kind == "M":
                    block[name] = values.astype("datetime64[us]")
                else:
                    source = selections[name].source
                    block[name] = parse_dates(self.path, source, [str(v) for v in values])
            yield block

    def value(self, source: Name) -> object:
        """Return a property (``group/channel@name``), or a channel's first value."""
        place, mark, name = str(source).rpartition("@")
        if not mark:
            channel = self._channel(source)
            if not len(channel):
                msg = f"{self.path}: channel {source!r} is empty where a value is needed"
                raise InputError(msg)
            value: object = channel[0]
            return value
        owner: Any = self._file
        if place in [group.name for group in self._file.groups()]:
            owner = self._file[place]
        elif place:
            owner = self._channel(place)
        if name not in owner.properties:
            raise missing_channel(self.path, source, [f"{place}@{p}" for p in owner.properties])
        found: object = owner.properties[name]
        return found

    def _channel(self, source: Name) -> Any:
        by_name = {
            f"{group.name}/{channel.name}": channel
            for group in self._file.groups()
            for channel in group.channels()
        }
        if str(source) not in by_name:
            raise missing_channel(self.path, source, list(by_name))
        return by_name[str(source)]
