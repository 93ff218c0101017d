"""What a course over the nights owes to the temperature."""

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.trend.median import median
from opamc_cli.decision.trend.slope import robust_slope

FloatArray = NDArray[np.float64]

LEAST_NIGHTS = 10
"""Nights with a temperature from which a course is told from it: of fewer, either may be the
other."""

LEAST_RANGE_K = 2.0
"""Between the coldest and the warmest: less is as well the sensor's own."""

TIMES = 2
"""Rounds in which the course and the temperature are told apart."""

APART_K = 1e-9
"""Nights of one temperature are this far from each other: pairs of them say all or nothing, as
often one as the other."""


def without_temperature(
    nights: FloatArray, values: FloatArray, temperatures: FloatArray, usual: float
) -> FloatArray:
    """Take off what a course owes to the temperature, if that is sure.

    Parameters
    ----------
    nights : ndarray, shape (T,)
        Times in nights, ascending.
    values : ndarray, shape (T,)
        Of each night.
    temperatures : ndarray, shape (T,)
        In degrees Celsius; NaN where not logged.
    usual : float
        Temperature at which the values are wanted.

    Returns
    -------
    ndarray, shape (T,)
        The values at the usual temperature; as they were with fewer than `LEAST_NIGHTS` nights
        with a temperature, or where the interval of what a degree does holds 0.

    Notes
    -----
    Both lines are Theil's and Sen's, one after the other: what is left of the values by that over
    the nights, against what is left of the temperature: a season that goes with the wear is told
    from it by the mornings that are colder or warmer than their season.
    """
    known = np.isfinite(temperatures)
    if known.sum() < LEAST_NIGHTS or np.ptp(temperatures[known]) < LEAST_RANGE_K:
        return values
    warmth = temperatures[known] - usual
    own = _flat(nights[known], warmth)
    order = np.argsort(own, kind="stable")
    apart = own[order] + APART_K * np.arange(len(order))
    owed = np.zeros(len(values))
    for _ in range(TIMES):
        left = owed[known] + _flat(nights[known], (values - owed)[known])
        of_a_degree = robust_slope(apart, left[order])
        if of_a_degree is None or of_a_degree.low <= 0 <= of_a_degree.high:
            return values
        owed[known] = of_a_degree.per_night * warmth
    return values - owed


def _flat(nights: FloatArray, values: FloatArray) -> FloatArray:
    """Return what is left of values by their line over the nights."""
    line = robust_slope(nights, values)
    return values if line is None else values - line.per_night * (nights - median(nights))
