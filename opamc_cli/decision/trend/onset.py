"""Since when: the night from which a joint's distances are no longer those of before."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST_AFTER = 2
"""Nights that a change must have lasted to have a beginning."""


def onset(nights: FloatArray, values: FloatArray) -> int:
    """Return the index of the first night of a change.

    Parameters
    ----------
    nights : ndarray, shape (T,)
        Times in nights, ascending.
    values : ndarray, shape (T,)
        Finite; a level, and from some night on a rise or another level.

    Returns
    -------
    int
        Where a step, or a rise at constant speed, fits best by least absolute error; 0 for fewer
        than four nights.

    Notes
    -----
    Both forms have the same number of constants, so that the errors can be compared. Absolute, not
    squared: one odd night must not be taken for the change.
    """
    n = len(values)
    if n < 2 * LEAST_AFTER:
        return 0
    best, place = np.inf, 0
    for start in range(1, n - LEAST_AFTER + 1):
        before, after = values[:start], values[start:]
        level = float(np.median(before))
        below = float(np.abs(before - level).sum())
        step = float(np.abs(after - np.median(after)).sum())
        time = nights[start:] - nights[start - 1]
        # the weighted median of the slopes is the least absolute error of a line through a point
        slope = _weighted_median((after - level) / time, time)
        rise = float(np.abs(after - level - slope * time).sum())
        error = below + min(step, rise)
        if error < best:
            best, place = error, start
    return place


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, reached[-1] / 2)])
