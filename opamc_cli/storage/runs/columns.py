"""The columns that a run holds for each axis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from opamc_cli.config.reading import shown
from opamc_cli.errors import InputError
from opamc_cli.storage.files.parquet import shown_line
from opamc_cli.storage.schemas.channels import (
    COLUMN,
    CURRENTS,
    NEARLY_COLUMN,
    PHASES,
)

MOST_AXES = 999


@dataclass(frozen=True)
class AxisChannels:
    """Names of the columns that a run holds for one axis."""

    axis: int
    """Counted from 1."""
    columns: Mapping[str, str]
    """By channel, see `schemas.channels`."""

    @property
    def phases(self) -> tuple[str, ...]:
        """Those of its phase currents."""
        return tuple(self.columns[name] for name in PHASES if name in self.columns)

    @property
    def current(self) -> str | None:
        """That of the reported current."""
        return self.columns.get("current")

    @property
    def position(self) -> str | None:
        """That of the angle."""
        return self.columns.get("position")

    @property
    def velocity(self) -> str | None:
        """That of the speed."""
        return self.columns.get("velocity")


_COUNTED = "{}: column {}: axes count from 1 to " + str(MOST_AXES)


def axis_channels(path: Path, schema: pa.Schema) -> dict[int, AxisChannels]:
    """Return the columns of each axis that has a current, ascending.

    Raises
    ------
    InputError
        If no axis has one, or if one is no number, misspelt or of an axis 0 or beyond 999.
    """
    by_axis: dict[int, set[str]] = {}
    for field in schema:
        match = COLUMN.fullmatch(field.name)
        if match is None and field.name != "time_s":
            _refuse_misspelt(path, field.name, schema.names)
            continue
        if not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type)):
            msg = f"{path}: column {field.name} has type {field.type}; it must hold numbers"
            raise InputError(msg)
        if match is not None:
            if len(match[1]) > len(str(MOST_AXES)) or int(match[1]) > MOST_AXES:
                raise InputError(_COUNTED.format(path, shown(field.name)))
            by_axis.setdefault(int(match[1]), set()).add(match[2])
    channels = {}
    for axis in sorted(by_axis):
        have = by_axis[axis]
        if have.intersection(CURRENTS):
            channels[axis] = AxisChannels(axis, {name: f"axis{axis}_{name}" for name in have})
    if not channels:
        names = ", ".join(map(shown_line, schema.names[:8]))
        msg = (
            f"{path}: no current column among [{names}]; a run needs axis1_a (axis1_b, axis1_c) "
            "or axis1_current, counted from axis 1; rename with `opamc ingest --map`"
        )
        raise InputError(msg)
    return channels


def _refuse_misspelt(path: Path, name: str, names: Sequence[str]) -> None:
    """Refuse a column that is nearly an axis's: an axis left out on both sides is never missed."""
    match = NEARLY_COLUMN.fullmatch(name)
    if match and match[1] == "0":
        raise InputError(_COUNTED.format(path, shown(name)))
    meant = match and f"axis{match[1]}_{match[2].lower()}"
    if meant and meant not in names:
        msg = f"{path}: column {shown(name)}: is it {meant}? Rename it"
        raise InputError(msg)
