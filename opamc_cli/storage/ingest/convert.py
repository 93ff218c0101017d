"""Channels of a foreign recording in the units of the run format."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.map.map_file import ColumnMap, IngestMap
from opamc_cli.storage.ingest.map.units import conversion
from opamc_cli.storage.ingest.source import Block
from opamc_cli.storage.schemas.channels import quantity_of

Float = npt.NDArray[np.float64]

UNSIGNED = {0, 3}
"""Of `quarters_of`: what signed numbers of 16 bits are when read as unsigned."""


def convert(path: Path, blocks: Iterable[Block], channels: IngestMap) -> Iterator[Block]:
    """Yield the blocks of a file in A, rad, rad/s and °C, unwrapped where the map says so.

    Raises
    ------
    InputError
        After the last block, if negative currents or speeds were logged as unsigned numbers.
    """
    unwrapped = {
        name: _Turns(
            2 * math.pi if column.unwrap is True else column.unwrap,
            math.nan if quantity_of(name) == "position" else 0.0,
        )
        for name, column in channels.columns.items()
        if column.unwrap
    }
    quarters: dict[str, set[int]] = {
        name: set()
        for name, column in channels.columns.items()
        if not column.unwrap and quantity_of(name) in ("current", "velocity")
    }
    for block in blocks:
        for name, seen in quarters.items():
            if -1 not in seen:
                seen |= quarters_of(block[name])
        converted: Block = {}
        for name, values in block.items():
            column = channels.columns.get(name)
            turns = unwrapped.get(name)
            before = turns is not None and column is not None and column.unwrap is not True
            read = turns.unwrap(values) if turns is not None and before else values
            scaled = read if column is None else _scaled(read, name, column)
            converted[name] = scaled if turns is None or before else turns.unwrap(scaled)
        yield converted
    for name, seen in quarters.items():
        if seen == UNSIGNED:
            msg = (
                f"{path}: column {name} (source {channels.columns[name].source!r}): negative "
                "numbers seem to be 65536 too large; write unwrap: 65536 in the map"
            )
            raise InputError(msg)


def quarters_of(values: Float) -> set[int]:
    """Return which quarters of the range of unsigned numbers of 16 bits are met; -1 is outside.

    Small signed numbers that were written as unsigned ones are near 0 and near 65 536, and none is
    in between: quarters 0 and 3.
    """
    known = values[np.isfinite(values)]
    if not known.size:
        return set()
    inside = known.min() >= 0 and known.max() < 1 << 16
    if not inside or np.any(known != np.round(known)):
        return {-1}
    return set(np.unique(known // (1 << 14)).astype(int).tolist())


def _scaled(values: Float, name: str, column: ColumnMap) -> Float:
    unit = conversion(column.unit, quantity_of(name))
    factor, offset = (unit.factor, unit.offset) if unit else (1.0, 0.0)
    # exact where nothing is to be done: 1 · x + 0 would turn -0.0 into 0.0
    if column.scale != 1.0 or column.offset != 0.0:
        values = values * column.scale + column.offset
    return values if factor == 1.0 and offset == 0.0 else values * factor + offset


class _Turns:
    """Unwraps an angle block by block: a jump of more than half of where it wraps is one.

    Missing values stay missing; the jump is looked for between the values beside them, the first
    one from `start`, if that is known.
    """

    def __init__(self, turn: float, start: float) -> None:
        self._turn = turn
        self._last = start
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
