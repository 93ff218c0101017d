"""Rows of a pattern table, grouped by what can be compared and labelled by session."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.errors import InputError


@dataclass(frozen=True)
class PatternRows:
    """Identified rows of a pattern table that share axis, motion, order and delay."""

    rows: Mapping[str, npt.NDArray[Any]]
    """The table's columns but `counts`."""
    counts: npt.NDArray[np.float64]
    """Pattern counts of each segment; shape (S, order!)."""
    sessions: npt.NDArray[Any]
    """Name of the recording session of each; shape (S,)."""

    @property
    def runs(self) -> npt.NDArray[Any]:
        """Name of the recording of each segment."""
        return self.rows["run"]

    @property
    def cycles(self) -> npt.NDArray[Any]:
        """Label of the cycle of each segment, unique over recordings."""
        return np.array(
            [f"{run}\n{c}" for run, c in zip(self.runs, self.rows["cycle"], strict=True)]
        )


Key = tuple[int, int, int, int]
"""Axis, motion, order, tau."""

KEY_COLUMNS = ("axis", "motion", "order", "tau")


def group_patterns(
    table: pa.Table, name: str = "patterns", session_of_run: Mapping[str, str] | None = None
) -> dict[Key, PatternRows]:
    """Group the identified rows of a pattern table by axis, motion, order and delay.

    An error calls the table `name`; without sessions each run is one.

    Raises
    ------
    InputError
        If a row's counts do not fit its order.
    """
    columns = {
        column: table[column].to_numpy(zero_copy_only=False)
        for column in table.column_names
        if column != "counts"
    }
    lists = table["counts"].combine_chunks()
    first = lists.offsets.to_numpy()
    cells = lists.values.to_numpy(zero_copy_only=False)
    length = np.diff(first)
    named = session_of_run or {}
    sessions = np.array([named.get(run, run) for run in columns["run"].tolist()], dtype=str)
    used = np.flatnonzero((columns["motion"] >= 0) & (columns["n_patterns"] > 0))
    keys = np.stack([columns[part][used].astype(np.int64) for part in KEY_COLUMNS], axis=1)
    found, place = np.unique(keys, axis=0, return_inverse=True)
    result = {}
    for number, key in enumerate(found):
        rows = used[place.ravel() == number]
        axis, motion, order, tau = (int(part) for part in key)
        if len(set(length[rows].tolist())) > 1:
            msg = f"{name}: axis {axis}: counts of order {order} differ in length; make it again"
            raise InputError(msg)
        counts = cells[first[rows][:, np.newaxis] + np.arange(length[rows[0]])]
        result[axis, motion, order, tau] = PatternRows(
            {column: values[rows] for column, values in columns.items()},
            counts.astype(np.float64),
            sessions[rows],
        )
    return result


def common_keys(
    baseline: Mapping[Key, PatternRows], target: Mapping[Key, PatternRows]
) -> list[Key]:
    """Return the keys that both sides have, in ascending order."""
    return sorted(set(baseline) & set(target))


def cycle_counts(
    part: PatternRows,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Pool the segments of each cycle.

    Returns
    -------
    counts : ndarray, shape (C, K)
    session : ndarray, shape (C,)
        Index of each cycle's session among the sorted names.
    """
    labels, place = np.unique(part.cycles, return_inverse=True)
    counts = np.zeros((len(labels), part.counts.shape[1]))
    np.add.at(counts, place, part.counts)
    _, session = np.unique(part.sessions, return_inverse=True)
    of_cycle = np.zeros(len(labels), dtype=np.int64)
    of_cycle[place] = session
    return counts, of_cycle
