"""From the tables of both sides to what the decision knows of each axis."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from opamc_cli.decision.judge import Bundle
from opamc_cli.decision.witnesses.patterns import Cell
from opamc_cli.stages.chain.compared.pattern_rows import Key, PatternRows, common_keys, cycle_counts
from opamc_cli.stages.chain.compared.side import Sides
from opamc_cli.stages.chain.witnesses import WITNESSES
from opamc_cli.stages.chain.witnesses.kept_rows import Names

Floats = npt.NDArray[np.float64]


def bundles(sides: Sides) -> dict[int, Bundle]:
    """Gather what is known of every axis of either side.

    Returns
    -------
    dict of int to Bundle
        Without cells where the two sides have nothing in common.
    """
    result = {}
    for axis, cells in cells_by_axis(sides).items():
        names = Names(session_names(axis, *sides.rows), sides.sessions)
        witnesses = {}
        for witness in WITNESSES:
            tables = [
                side.witnesses.get(witness.FILE_NAME) for side in (sides.baseline, sides.target)
            ]
            if tables[0] is not None and tables[1] is not None:
                evidence = witness.evidence(tables[0], tables[1], axis, names)
                if evidence.cells:
                    witnesses[witness.NAME] = evidence
        result[axis] = Bundle(cells, witnesses, names.sessions[1], tuple(names.sessions[0]))
    return result


def cells_by_axis(sides: Sides) -> dict[int, list[Cell]]:
    """Pool the segments of each session, for every axis, motion and order.

    Sessions in which an axis does not move are none of that axis.

    Returns
    -------
    dict of int to list of Cell
        Every axis of either side; an empty list where the two have nothing in common.
    """
    baseline, target = sides.rows
    keys = common_keys(baseline, target)
    result: dict[int, list[Cell]] = {key[0]: [] for key in sorted({*baseline, *target})}
    for axis in result:
        own = [key for key in keys if key[0] == axis]
        names = session_names(axis, baseline, target)
        for key in own:
            target_cycles, of_cycle = cycle_counts(target[key])
            number = np.searchsorted(names[1], np.unique(target[key].sessions))
            result[axis].append(
                Cell(
                    motion=key[1],
                    order=key[2],
                    tau=key[3],
                    baseline=_by_session(baseline[key], names[0]),
                    target=_by_session(target[key], names[1]),
                    cycles=sides.baseline_cycles[key][0],
                    target_cycles=target_cycles,
                    inflation=sides.inflations[key],
                    session_of_target_cycle=number[of_cycle],
                )
            )
    return result


def session_names(
    axis: int, baseline: Mapping[Key, PatternRows], target: Mapping[Key, PatternRows]
) -> tuple[list[str], list[str]]:
    """Return the sessions of each side in which an axis moves, in the order of its cells."""
    keys = [key for key in common_keys(baseline, target) if key[0] == axis]
    own, other = (
        sorted({str(name) for key in keys for name in side[key].sessions})
        for side in (baseline, target)
    )
    return own, other


def _by_session(part: PatternRows, names: Sequence[str]) -> Floats:
    counts = np.zeros((len(names), part.counts.shape[1]))
    np.add.at(counts, np.searchsorted(names, part.sessions), part.counts)
    return counts
