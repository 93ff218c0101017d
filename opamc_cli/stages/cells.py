"""From the rows of the pattern and spectrum tables to the sessions that the decision compares."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.stages.score import Key, PatternRows, common_keys, cycle_counts
from opamc_cli.stats.sessions import Cell, inflation_within_sessions
from opamc_cli.stats.spectra import SpectrumCell, variance_within_sessions

Floats = npt.NDArray[np.float64]


def cells_by_axis(
    baseline: Mapping[Key, PatternRows], target: Mapping[Key, PatternRows]
) -> dict[int, list[Cell]]:
    """Pool the segments of each session, for every axis, motion and order.

    A session is one recording. Sessions in which an axis does not move are none of that axis.

    Returns
    -------
    dict of int to list of Cell
        Every axis of either side; an empty list where the two have nothing in common.
    """
    keys = common_keys(baseline, target)
    result: dict[int, list[Cell]] = {key[0]: [] for key in sorted({*baseline, *target})}
    for axis in result:
        own = [key for key in keys if key[0] == axis]
        names = session_names(axis, baseline, target)
        for key in own:
            cycles, session = cycle_counts(baseline[key])
            result[axis].append(
                Cell(
                    motion=key[1],
                    order=key[2],
                    tau=key[3],
                    baseline=_by_session(baseline[key], names[0]),
                    target=_by_session(target[key], names[1]),
                    cycles=cycles,
                    target_cycles=cycle_counts(target[key])[0],
                    inflation=inflation_within_sessions(cycles, session),
                )
            )
    return result


def session_names(
    axis: int, baseline: Mapping[Key, PatternRows], target: Mapping[Key, PatternRows]
) -> tuple[list[str], list[str]]:
    """Return the recordings of each side in which an axis moves, in the order of its cells."""
    keys = [key for key in common_keys(baseline, target) if key[0] == axis]
    own, other = (
        sorted({str(run) for key in keys for run in side[key].sessions})
        for side in (baseline, target)
    )
    return own, other


def spectrum_cells(
    baseline: pa.Table, target: pa.Table, axis: int, names: tuple[list[str], list[str]]
) -> list[SpectrumCell]:
    """Average the log power of each session's cycles, for every motion of an axis.

    Parameters
    ----------
    baseline, target
        Spectrum tables of stage `patterns`.
    axis
        Counted from 1.
    names
        Sessions of baseline and target, in the order of `Cell.baseline` and `Cell.target`.

    Returns
    -------
    list of SpectrumCell
        Motions that both sides have with the same frames and bins.
    """
    sides = [_spectra_of(table, axis) for table in (baseline, target)]
    cells = []
    for key in sorted(set(sides[0]) & set(sides[1])):
        means: list[Floats] = []
        counts: list[int] = []
        rows: list[Floats] = []
        for side, own_names in zip(sides, names, strict=True):
            runs, power, bin_hz = side[key]
            for name in own_names:
                own = power[runs == name]
                known = own[np.isfinite(own).all(axis=1)]
                means.append(known.mean(axis=0) if len(known) else np.full(own.shape[1], np.nan))
                counts.append(len(known))
                rows.append(known)
        labels = np.repeat(np.arange(len(counts)), counts)
        # of all sessions: of the baseline's alone it would tell the target from them
        within = variance_within_sessions(np.concatenate(rows), labels)
        cells.append(
            SpectrumCell(
                motion=key[0],
                sessions=np.array(means),
                cycles=np.array(counts, dtype=np.float64),
                within=within,
                frames=key[1],
                bins=key[2],
                bin_hz=bin_hz,
            )
        )
    return cells


def _spectra_of(
    table: pa.Table, axis: int
) -> dict[tuple[int, int, int], tuple[npt.NDArray[np.str_], Floats, float]]:
    """Return run names, log power and width of a bin by motion, frames and bins."""
    names = ("axis", "motion", "frames", "bins")
    columns = {name: table[name].to_numpy() for name in names}
    runs = table["run"].to_numpy(zero_copy_only=False).astype(str)
    lists = table["log_power"].combine_chunks()
    first = lists.offsets.to_numpy()
    values = lists.values.to_numpy(zero_copy_only=False)
    found = {}
    of_axis = columns["axis"] == axis
    keys = np.stack([columns[name] for name in names[1:]], axis=1)
    for key in np.unique(keys[of_axis], axis=0).tolist():
        rows = np.flatnonzero(of_axis & (keys == key).all(axis=1))
        length = key[1] * key[2]
        power = values[first[rows][:, np.newaxis] + np.arange(length)].astype(np.float64)
        bin_hz = float(table["bin_hz"][int(rows[0])].as_py())
        found[key[0], key[1], key[2]] = (runs[rows], power, bin_hz)
    return found


def _by_session(part: PatternRows, names: list[str]) -> Floats:
    counts = np.zeros((len(names), part.counts.shape[1]))
    np.add.at(counts, np.searchsorted(names, part.sessions.astype(str)), part.counts)
    return counts
