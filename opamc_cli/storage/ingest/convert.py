"""Channels of a foreign recording in the units of the run format."""

import math
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from opamc_cli.storage.ingest.map.map_file import ColumnMap, IngestMap
from opamc_cli.storage.ingest.map.units import conversion
from opamc_cli.storage.ingest.source import Block
from opamc_cli.storage.schemas.channels import quantity_of

Float = npt.NDArray[np.float64]


def convert(blocks: Iterable[Block], channels: IngestMap) -> Iterator[Block]:
    """Yield the blocks in A, rad, rad/s and °C, positions unwrapped where the map says so."""
    unwrapped = {
        name: _Turns(2 * math.pi if column.unwrap is True else column.unwrap)
        for name, column in channels.columns.items()
        if column.unwrap
    }
    for block in blocks:
        converted: Block = {}
        for name, values in block.items():
            column = channels.columns.get(name)
            turns = unwrapped.get(name)
            before = turns is not None and column is not None and column.unwrap is not True
            read = turns.unwrap(values) if turns is not None and before else values
            scaled = read if column is None else _scaled(read, name, column)
            converted[name] = scaled if turns is None or before else turns.unwrap(scaled)
        yield converted


def _scaled(values: Float, name: str, column: ColumnMap) -> Float:
    unit = conversion(column.unit, quantity_of(name))
    factor, offset = (unit.factor, unit.offset) if unit else (1.0, 0.0)
    # exact where nothing is to be done: 1 · x + 0 would turn -0.0 into 0.0
    if column.scale != 1.0 or column.offset != 0.0:
        values = values * column.scale + column.offset
    return values if factor == 1.0 and offset == 0.0 else values * factor + offset


class _Turns:
    """Unwraps an angle block by block: a jump of more than half of where it wraps is one.

    Missing values stay missing; the jump is looked for between the values beside them.
    """

    def __init__(self, turn: float) -> None:
        self._turn = turn
        self._last = math.nan
        self._turns = 0.0

    def unwrap(self, wrapped: Float) -> Float:
        known = np.flatnonzero(np.isfinite(wrapped))
        if known.size == 0:
            return wrapped
        angle = wrapped[known]
        first = angle[0] if math.isnan(self._last) else self._last
        jumps = -np.round(np.diff(angle, prepend=first) / self._turn)
        turns = self._turns + np.cumsum(jumps)
        self._last, self._turns = float(angle[-1]), float(turns[-1])
        result = wrapped.copy()
        result[known] = angle + turns * self._turn
        return result
