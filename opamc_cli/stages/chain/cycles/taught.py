"""Whether a program's points were taught anew, by the places that its motions lead to."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from opamc_cli.signal.cycles.identification import UNIDENTIFIED
from opamc_cli.stages.chain.cycles.axis import Axis
from opamc_cli.stages.chain.cycles.reference import Reference
from opamc_cli.storage.tables import record_at

PLACES = "places"
"""Where a motion table's record has what `displacements` found."""

LEAST = 1e-3
"""Rad by which places differ at least that were taught anew. Of a stranger's five robots (140
targets) no fault and no weather moved them by more than 0.73 mrad but on a quill that scatters by
1.5; four mrad of touched-up points moved all joints by 4.0 to 8.6."""

TIMES = 10.0
"""Of what the baseline's own recordings differ by at most, beyond which one differs: of those
faults 13 times on one joint, of the taught points 24 to 600 times."""

FEWEST = 2
"""Joints that have to move: a fault may move the places of its own, a program is all joints'."""


def displacements(
    motions: pa.Table, parts: Sequence[Axis], references: Mapping[int, Reference]
) -> dict[str, dict[str, float]]:
    """Return by axis and run how far its motions lead, at most, from where the reference's do.

    In rad, by the median over cycles of each motion's begin and end; nothing of an axis without a
    logged position.
    """
    found: dict[str, dict[str, float]] = {}
    runs, axes, numbers = (np.asarray(motions[name]) for name in ("run", "axis", "motion"))
    for part in parts:
        known = references[part.axis].features if part.axis in references else None
        rows = np.flatnonzero((runs == part.source.name) & (axes == part.axis))
        places, motion = part.features.places_rad, numbers[rows]
        if known is None or known.places_rad is None or places is None:
            continue
        away = [
            places[motion == number] - known.places_rad[number]
            for number in np.unique(motion[motion > UNIDENTIFIED])
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a motion whose places are all lost
            middle = np.array([np.nanmedian(one, axis=0) for one in away])
        if np.isfinite(middle).any():
            moved = float(np.nanmax(np.abs(middle)))
            found.setdefault(str(part.axis), {})[part.source.name] = moved
    return found


def taught_anew(baseline: Path, target: Path) -> dict[int, float]:
    """Return the axes of which points were taught anew, and how far these lie, rad.

    Parameters
    ----------
    baseline, target
        Tables of stage `identify`, with the same reference.

    Returns
    -------
    dict of int to float
        Empty where no more than half of the robot's joints have moved, or fewer than `FEWEST`:
        that is none of the program's.
    """
    usual, now = (record_at(path).get(PLACES, {}) for path in (baseline, target))
    known = [axis for axis in now if axis in usual]
    moved = {}
    for axis in known:
        away = float(np.median(list(now[axis].values())))
        if away > max(LEAST, TIMES * max(usual[axis].values())):
            moved[int(axis)] = away
    return moved if len(moved) >= FEWEST and len(moved) > len(known) / 2 else {}
