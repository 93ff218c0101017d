"""Rows of a witness's table by motion and session."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.stages.recordings.sessions import Sessions

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Names:
    """Sessions of one axis."""

    sessions: tuple[Sequence[str], Sequence[str]]
    """Of either side, in the order in which the decision numbers them."""
    of_side: tuple[Sessions, Sessions]
    """Session by run, of either side."""


@dataclass(frozen=True)
class MotionRows:
    """One motion's rows of both sides."""

    key: tuple[int, ...]
    """The motion, then the table's columns of shape."""
    values: Floats
    """Shape (C, F): one row per cycle without unknown numbers, sessions in order."""
    session: npt.NDArray[np.int64]
    """Shape (C,): number of each row's session, baseline first."""
    n_sessions: int
    """How many there are on both sides."""
    first: dict[str, Any]
    """Columns of the first row."""

    def means(self) -> tuple[Floats, Floats]:
        """Return each session's mean, NaN without any row, and the number of rows behind it."""
        counts = np.bincount(self.session, minlength=self.n_sessions).astype(np.float64)
        sums = np.zeros((self.n_sessions, self.values.shape[1]))
        np.add.at(sums, self.session, self.values)
        with np.errstate(invalid="ignore"):
            return sums / np.where(counts > 0, counts, np.nan)[:, np.newaxis], counts


def rows_by_motion(
    baseline: pa.Table,
    target: pa.Table,
    axis: int,
    names: Names,
    value: str,
    shape: Sequence[str],
) -> list[MotionRows]:
    """Return the motions that both sides have in the same shape.

    Parameters
    ----------
    baseline, target
        Tables of a witness.
    axis
        Counted from 1.
    names
        Sessions of the axis.
    value
        Column of lists.
    shape
        Columns whose product is a list's length.
    """
    sides = [_of_axis(table, axis, value, shape) for table in (baseline, target)]
    numbers = [
        {name: k + offset for k, name in enumerate(own)}
        for own, offset in zip(names.sessions, (0, len(names.sessions[0])), strict=True)
    ]
    found = []
    for key in sorted(set(sides[0]) & set(sides[1])):
        values, sessions = [], []
        for side, number, of_run in zip(sides, numbers, names.of_side, strict=True):
            runs, own, _ = side[key]
            place = np.array([number.get(of_run.of_run.get(run, run), -1) for run in runs.tolist()])
            known = np.isfinite(own).all(axis=1) & (place >= 0)
            order = np.argsort(place[known], kind="stable")
            values.append(own[known][order])
            sessions.append(place[known][order])
        if not sum(len(own) for own in values):
            continue
        found.append(
            MotionRows(
                key,
                np.concatenate(values),
                np.concatenate(sessions).astype(np.int64),
                len(numbers[0]) + len(numbers[1]),
                sides[0][key][2],
            )
        )
    return found


def _of_axis(
    table: pa.Table, axis: int, value: str, shape: Sequence[str]
) -> dict[tuple[int, ...], tuple[npt.NDArray[np.str_], Floats, dict[str, Any]]]:
    """Return run names, values and the first row's columns, by motion and shape."""
    columns = {name: table[name].to_numpy() for name in ("axis", "motion", *shape)}
    runs = table["run"].to_numpy(zero_copy_only=False).astype(str)
    lists = table[value].combine_chunks()
    first = lists.offsets.to_numpy()
    cells = lists.values.to_numpy(zero_copy_only=False)
    keys = np.stack([columns[name] for name in ("motion", *shape)], axis=1).astype(np.int64)
    of_axis = columns["axis"] == axis
    found = {}
    for key in np.unique(keys[of_axis], axis=0).tolist():
        rows = np.flatnonzero(of_axis & (keys == key).all(axis=1))
        length = int(np.prod(key[1:]))
        own = cells[first[rows][:, np.newaxis] + np.arange(length)].astype(np.float64)
        others = [name for name in table.column_names if name != value]
        first_row = table.select(others).slice(int(rows[0]), 1).to_pylist()[0]
        found[tuple(key)] = (runs[rows], own, first_row)
    return found
