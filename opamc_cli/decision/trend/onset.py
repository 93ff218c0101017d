"""Since when: the night from which a joint's distances are no longer those of before."""

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.trend.median import median

FloatArray = NDArray[np.float64]

LEAST_ERROR = 1e-9
"""Of exact series all errors below this are none."""

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
        The night before which a step, a rise at constant speed, or one whose speed grows evenly
        has as likely begun as after it; 0 for fewer than two nights.

    Notes
    -----
    All forms have the same number of constants, so that the errors can be compared. Absolute, not
    squared: one odd night must not be taken for the change. With noise of that kind, whose size
    nobody knows, beginning and form are as likely as the error to the power of minus the nights.
    Where a slow change begins, many beginnings fit nearly as well, and most of them are earlier
    than the best one: of eleven virtual joints that wear (benchmarks/year.py, seeds 51000, 53000,
    52000) the middle is right within five nights for 6, the best for 4.
    """
    n = len(values)
    if n < 2:
        return 0
    starts, errors = [], []
    for start in range(1, n):
        before, after = values[:start], values[start:]
        level = median(before)
        below = float(np.abs(before - level).sum())
        step = float(np.abs(after - median(after)).sum())
        time = nights[start:] - nights[start - 1]
        for of_form in (step, *(_misfit(after - level, time**power) for power in RISES)):
            starts.append(start)
            errors.append(below + of_form)
    likely = (max(min(errors), LEAST_ERROR) / np.maximum(errors, LEAST_ERROR)) ** n
    return int(_weighted_median(np.array(starts), likely))


def _misfit(rise: FloatArray, course: FloatArray) -> float:
    # the weighted median of the ratios is the least absolute error of a multiple of the course
    speed = _weighted_median(rise / course, course)
    return float(np.abs(rise - speed * course).sum())


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(reached, reached[-1] / 2)])
