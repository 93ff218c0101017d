"""From grouped pattern rows to the sessions that the decision compares."""

from collections.abc import Mapping

import numpy as np

from opamc_cli.stages.score import Key, PatternRows, common_keys, cycle_counts
from opamc_cli.stats.sessions import Cell, inflation_within_sessions


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
        names = {
            role: sorted({str(run) for key in own for run in side[key].sessions})
            for role, side in (("baseline", baseline), ("target", target))
        }
        for key in own:
            cycles, session = cycle_counts(baseline[key])
            result[axis].append(
                Cell(
                    motion=key[1],
                    order=key[2],
                    tau=key[3],
                    baseline=_by_session(baseline[key], names["baseline"]),
                    target=_by_session(target[key], names["target"]),
                    cycles=cycles,
                    target_cycles=cycle_counts(target[key])[0],
                    inflation=inflation_within_sessions(cycles, session),
                )
            )
    return result


def _by_session(
    part: PatternRows, names: list[str]
) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    counts = np.zeros((len(names), part.counts.shape[1]))
    np.add.at(counts, np.searchsorted(names, part.sessions.astype(str)), part.counts)
    return counts
