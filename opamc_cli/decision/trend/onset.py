"""Since when: the night from which a joint's distances are no longer those of before."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LEAST_AFTER = 2
"""Nights that a change must have lasted to have a beginning."""

RISES = (1, 2)
"""Powers of the time: wear shows late and then ever faster, since distances grow with the square of
the damage or more. At the alarms of twelve virtual joints that wear (benchmarks/year.py, seeds
44000 and 45000) the beginning is right within five nights for 11, with lines alone for 7; a third
power is worse for plain rises."""


def onset(nights: FloatArray, values: FloatArray) -> int:
    """Return the index of the first night of a change.

    Parameters
    ----------
    nights : ndarray, shape (T,)
        Times in nights, ascending.
    values : ndarray, shape (T,)
        Finite; a level, and from some night on a rise or another level. Nights long after the
        beginning say how it went on, not when it began: leave them out.

    Returns
    -------
    int
        Where a step, a rise at constant speed, or one whose speed grows evenly fits best by least
        absolute error; 0 for fewer than four nights.

    Notes
    -----
    All forms have the same number of constants, so that the errors can be compared. Absolute, not
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
        error = below + min(step, *(_misfit(after - level, time**power) for power in RISES))
        if error < best:
            best, place = error, start
    return place


def _misfit(rise: FloatArray, course: FloatArray) -> float:
    # the weighted median of the ratios is the least absolute error of a multiple of the course
    speed = _weighted_median(rise / course, course)
    return float(np.abs(rise - speed * course).sum())


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, reached[-1] / 2)])
