"""A control chart over a joint's nights: small shifts that last, seen before any one night is sure.

An exponentially weighted moving average (S. W. Roberts, Technometrics 1, 1959) of each night's log
distance from the baseline, in units of what healthy nights differ by.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA
from opamc_cli.decision.trend.median import median

FloatArray = NDArray[np.float64]

WEIGHT = 0.2
"""Of the newest night: shifts of one standard deviation are found soonest (J. M. Lucas and
M. S. Saccucci, Technometrics 32, 1990); an average over some nine nights."""

MOST = 3.0
"""Standard deviations that one night may count for: one odd night is no trend."""

REFERENCE_NIGHTS = 20
"""First nights after the baseline that say where a healthy night of this joint lies."""

USUAL_SPREAD, USUAL_NIGHTS = 0.13, 4.0
"""Standard deviation of healthy nights' log distances on the virtual testbed (0.09 to 0.16), and
the nights that it counts for: with few nights, their own spread is chance."""

LEAST_SPREAD = 0.065
"""Half the usual: nights that agree better have not yet seen what nights differ by."""


@dataclass(frozen=True)
class Chart:
    """The chart of one series."""

    shift: FloatArray
    """Each night's distance from where healthy nights lie, in their standard deviations; shape
    (T,)."""
    average: FloatArray
    """Weighted average up to each night, in its own standard deviations; NaN where the night has no
    value; shape (T,)."""


def control_chart(values: FloatArray, n_baseline: int) -> Chart:
    """Chart a series of nights, each judged by nothing that came after it.

    Parameters
    ----------
    values : ndarray, shape (T,)
        Log distance of each night in time order; NaN where unknown. 0 is where the baseline's own
        nights lie.
    n_baseline : int
        Nights of the baseline: they count as nights at 0.

    Returns
    -------
    Chart

    Notes
    -----
    A baseline of a few nights lies off by chance, and every later night with it. The first nights
    correct for that, with the baseline's own at 0 beside them; the reference's own uncertainty is
    part of the average's standard deviation.
    """
    shift = np.full(len(values), np.nan)
    average = np.full(len(values), np.nan)
    known: list[float] = []
    smoothed, share = 0.0, 0.0
    for t, value in enumerate(values):
        if not np.isfinite(value):
            continue
        reference = np.array(known[:REFERENCE_NIGHTS])
        centre, spread = _healthy(reference, n_baseline)
        shift[t] = (value - centre) / spread
        smoothed = (1 - WEIGHT) * smoothed + WEIGHT * float(np.clip(shift[t], -MOST, MOST))
        share = (1 - WEIGHT) ** 2 * share + WEIGHT**2
        # one more night than there is: the reference's own spread is not known exactly either
        scale = np.sqrt(share + 1 / (n_baseline + len(reference) + 1))
        average[t] = smoothed / scale
        known.append(float(value))
    return Chart(shift, average)


def _healthy(reference: FloatArray, n_baseline: int) -> tuple[float, float]:
    """Return where healthy nights lie, and their standard deviation."""
    n = len(reference)
    if not n:
        return 0.0, USUAL_SPREAD
    middle = median(reference)
    own = (MAD_TO_SIGMA * median(np.abs(reference - middle))) ** 2
    variance = (USUAL_NIGHTS * USUAL_SPREAD**2 + n * own) / (USUAL_NIGHTS + n)
    return n * middle / (n_baseline + n), max(float(np.sqrt(variance)), LEAST_SPREAD)
