"""Two joints' currents exchanged, told by their courses: where sizes are alike, no rule sees it."""

import math
from collections.abc import Collection, Mapping
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.stages.chain.compared.side import Sides
from opamc_cli.storage.schemas import files

Courses = dict[int, dict[int, npt.NDArray[np.float64]]]
"""Mean current in the parts of a motion, by axis and motion; NaN where a part holds no number."""

NEARER = 0.85
"""Of its distance from its own baseline and every third axis's: that from the other's, where two
are exchanged (0.78 in the samples, since motions are synchronised by the wrong reference, and 0.66
where by the current's course, which hides what they differ by). A fault
takes a joint away from its own course, not both to each other's: 0.97 at least of 5000 pairs of two
simulators' joints, healthy and at fault."""


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
    news: dict[str, Courses] = {}
    found: dict[int, tuple[str, ...]] = {}
    for pair in combinations(sorted(known), 2):
        if not bad & set(pair):
            continue
        # one night alone may have them exchanged
        runs = min((targets[axis] for axis in pair if axis in targets), key=len)
        news |= {run: _courses(tables[1], run) for run in runs if run not in news}
        alike = [_exchanged(news[run], known, pair) for run in runs]
        if sum(alike) > len(alike) / 2:
            why = (
                f"The target's currents of axes {pair[0]} and {pair[1]} each follow the other's "
                "course: are the two exchanged?"
            )
            found |= dict.fromkeys(pair, (why,))
    return found


def _exchanged(new: Courses, known: Courses, pair: tuple[int, int]) -> bool:
    """Tell whether each of two axes follows the other's course, and no third one's as well."""
    for one, other in (pair, pair[::-1]):
        away = {axis: _away(new, one, known, axis) for axis in known}
        across, own = away.pop(other), away[one]
        # what is not known is not far: it makes no other course the nearer one
        if math.isnan(across) or math.isnan(own):
            return False
        if across > NEARER * np.nanmin(list(away.values())):
            return False
    return True


def _courses(table: pa.Table, run: str | None = None) -> Courses:
    rows: dict[tuple[int, int], list[npt.NDArray[np.float64]]] = {}
    for row in table.select(["run", "axis", "motion", "current_a"]).to_pylist():
        if row["motion"] >= 0 and run in (None, row["run"]):
            course = np.array(row["current_a"], dtype=np.float64)
            rows.setdefault((row["axis"], row["motion"]), []).append(course)
    found: Courses = {}
    for (axis, motion), own in rows.items():
        if len({course.size for course in own}) == 1:
            # a lost sample takes a part of its own cycle away, not of all
            mean = np.ma.masked_invalid(own).mean(axis=0)
            found.setdefault(axis, {})[motion] = np.ma.filled(mean, np.nan)
    return found


def _away(new: Courses, axis: int, known: Courses, other: int) -> float:
    """Return the root mean square by which an axis is away from one's baseline; NaN if unknown."""
    squares = []
    for motion, course in new.get(axis, {}).items():
        their = known.get(other, {}).get(motion)
        if their is not None and their.size == course.size:
            difference = course - their
            heard = np.isfinite(difference)
            if heard.any():
                squares.append(float(np.mean(difference[heard] ** 2)))
    return math.sqrt(np.mean(squares)) if squares else math.nan
