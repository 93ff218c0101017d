"""The course of a current over a motion: its mean in parts of the way, and what repeats of it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LEAST_SAMPLES = 2
"""Samples of a part: with fewer, what one sample of lag moves is as large as the course."""

SAME_END = 0.01
"""Of the whole way: strokes are of a kind where both their ends are as near. Two of a simulated
arm, under different loads, ended 0.008 of the way apart; a stroke's repetitions, 0.0006."""

LEAST_WEIGHT = 1.0
"""Samples that a corner of a course needs; what hangs on fewer is not known."""


def mean_course(current: NDArray[np.floating], parts: int) -> NDArray[np.float64]:
    """Mean of a current in each of equal parts.

    Parameters
    ----------
    current : ndarray, shape (n,)
        Samples of one motion; NaN is passed over.
    parts : int
        Parts wanted; fewer are made rather than shorter ones than `LEAST_SAMPLES`.

    Returns
    -------
    ndarray, shape (m,)
        m at most `parts`; NaN where a part has no known sample, empty without any part.

    Notes
    -----
    Edge rule: part k holds samples ceil(k n/m) to ceil((k+1) n/m), half-open, so that every sample
    counts once.
    """
    m = min(parts, current.size // LEAST_SAMPLES)
    if m < 1:
        return np.empty(0)
    x = np.asarray(current, dtype=np.float64)
    known = np.isfinite(x)
    starts = -(-np.arange(m) * x.size // m)
    total = np.add.reduceat(np.where(known, x, 0.0), starts)
    count = np.add.reduceat(known.astype(np.float64), starts)
    return np.asarray(np.divide(total, count, out=np.full(m, np.nan), where=count > 0))


def repeated_course(
    angle: NDArray[np.floating],
    values: NDArray[np.floating],
    strokes: Sequence[tuple[int, int]],
    unit: NDArray[np.integer],
    source: NDArray[np.bool_],
    spacing: float,
) -> NDArray[np.float64]:
    """Mean course of a signal over the angle along each kind of stroke, of other units.

    Parameters
    ----------
    angle, values : ndarray, shape (n,)
        Where the joint is, and the signal; NaN is passed over.
    strokes : sequence of pairs of int
        Half-open spans of one way, each within a unit.
    unit : ndarray, shape (n,)
        What each sample is of.
    source : ndarray, shape (n,)
        Samples that a course may be taken from; whole units.
    spacing : float
        Angle between the corners of the polygon that a course is: of what changes faster, a ripple
        of a whole number of cycles per spacing above all, hardly any is in a course.

    Returns
    -------
    ndarray, shape (n,)
        By least squares over the strokes that begin and end alike and are of the source and of
        another unit; NaN where there is none, and outside the strokes.
    """
    near = SAME_END * float(np.ptp(angle)) if angle.size else 0.0
    kinds: list[list[tuple[int, int]]] = []
    for start, stop in strokes:
        ends = angle[[start, stop - 1]]
        for kind in kinds:
            first, last = kind[0]
            if np.all(np.abs(angle[[first, last - 1]] - ends) <= near):
                kind.append((start, stop))
                break
        else:
            kinds.append([(start, stop)])
    course = np.full(angle.size, np.nan)
    for kind in kinds:
        spans = [start + np.flatnonzero(np.isfinite(values[start:stop])) for start, stop in kind]
        rows = np.concatenate(spans)
        if rows.size:
            course[rows] = _of_other_units(
                angle[rows], values[rows], unit[rows], source[rows], spacing
            )
    return course


def _of_other_units(
    angle: NDArray[np.floating],
    values: NDArray[np.floating],
    unit: NDArray[np.integer],
    source: NDArray[np.bool_],
    spacing: float,
) -> NDArray[np.float64]:
    """Course of the strokes of one kind at each of their samples."""
    place = (angle - angle.min()) / spacing
    corner = place.astype(np.intp)
    # A sample lies between two corners of the polygon, and weighs on both.
    sides = ((corner, 1.0 - (place - corner)), (corner + 1, place - corner))
    size = int(corner.max()) + 2
    sums = {}
    for one in np.unique(unit):
        own = unit == one
        gram, moment = np.zeros((size, size)), np.zeros(size)
        for k, weight in sides:
            moment += np.bincount(k[own], (weight * values)[own], size)
            for beside, other in sides:
                np.add.at(gram, (k[own], beside[own]), (weight * other)[own])
        sums[one] = gram, moment
    sources = set(unit[source].tolist())
    course = np.full(angle.size, np.nan)
    for one in sums:
        others = sources - {one}
        if others:
            gram = np.sum([sums[other][0] for other in others], axis=0)
            moment = np.sum([sums[other][1] for other in others], axis=0)
            found = np.linalg.lstsq(gram, moment, rcond=1e-9)[0]
            found[gram.sum(axis=0) < LEAST_WEIGHT] = np.nan
            own = unit == one
            # An unknown corner of no weight is none.
            course[own] = sum(
                np.where(weight[own] > 0, weight[own] * found[k[own]], 0.0) for k, weight in sides
            )
    return course
