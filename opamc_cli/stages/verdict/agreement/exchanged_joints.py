"""Two joints' currents exchanged, told by their courses: where sizes are alike, no rule sees it."""

from collections.abc import Collection, Mapping
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.stages.chain.compared.side import Sides
from opamc_cli.storage.schemas import files

Courses = dict[int, dict[int, npt.NDArray[np.float64]]]
"""Mean current in the parts of a motion, by axis and motion."""

NEARER = 0.75
"""Of its distance from its own baseline: that from the other's, where two are exchanged (0.66 in
the samples, since motions are synchronised by the wrong reference). A fault takes a joint away from
its own course, not both to each other's: 0.97 at least of 5000 pairs of two simulators' joints,
healthy and at fault."""


def exchanged_joints(
    sides: Sides, targets: Mapping[int, Collection[str]], verdict: Mapping[str, Any]
) -> dict[int, tuple[str, ...]]:
    """Return pairs of axes of which each follows the other's course, with the reason.

    Parameters
    ----------
    sides
        Tables of baseline and target.
    targets
        Runs of the target by which each axis is judged.
    verdict
        Content of verdict.json: nothing is asked unless a joint is changed or at fault.
    """
    bad = {e["axis"] for e in verdict["axes"] if e["state"] in ("changed", "fault")}
    tables = [side.witnesses.get(files.PROFILES) for side in (sides.baseline, sides.target)]
    if not bad or tables[0] is None or tables[1] is None:
        return {}
    known = _courses(tables[0])
    found: dict[int, tuple[str, ...]] = {}
    for pair in combinations(sorted(known), 2):
        if not bad & set(pair):
            continue
        # one night alone may have them exchanged
        new = _courses(tables[1], min((targets[axis] for axis in pair if axis in targets), key=len))
        ways = [(_away(new, one, known, other), _away(new, one, known, one))
                for one, other in (pair, pair[::-1])]  # fmt: skip
        if all(across <= NEARER * own for across, own in ways):
            why = (
                f"The target's currents of axes {pair[0]} and {pair[1]} each follow the other's "
                "course: are the two exchanged?"
            )
            found |= dict.fromkeys(pair, (why,))
    return found


def _courses(table: pa.Table, runs: Collection[str] | None = None) -> Courses:
    rows: dict[tuple[int, int], list[npt.NDArray[np.float64]]] = {}
    for row in table.select(["run", "axis", "motion", "current_a"]).to_pylist():
        if row["motion"] >= 0 and (runs is None or row["run"] in runs):
            course = np.array(row["current_a"], dtype=np.float64)
            rows.setdefault((row["axis"], row["motion"]), []).append(course)
    found: Courses = {}
    for (axis, motion), own in rows.items():
        if len({course.size for course in own}) == 1:
            found.setdefault(axis, {})[motion] = np.mean(own, axis=0)
    return found


def _away(new: Courses, axis: int, known: Courses, other: int) -> float:
    """Return the mean square by which an axis is away from one's baseline; infinite if unknown."""
    pairs = [
        (course, known[other][motion])
        for motion, course in new.get(axis, {}).items()
        if motion in known.get(other, {}) and known[other][motion].size == course.size
    ]
    squares = [float(np.mean((one - two) ** 2)) for one, two in pairs]
    return float(np.sqrt(np.mean(squares))) if squares and np.isfinite(squares).all() else np.inf
