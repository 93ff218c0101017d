"""A control chart over a joint's nights: a shift that lasts, seen before any one night is sure.

An exponentially weighted moving average (S. W. Roberts, Technometrics 1, 1959) of each night's log
distance from the baseline, in units of what healthy nights differ by.
"""

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA
from opamc_cli.decision.trend.median import median

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

WEIGHT = 0.5
"""Of the newest night: an average over some three nights. The usual 0.2 would find the smallest
shifts soonest (J. M. Lucas and M. S. Saccucci, Technometrics 32, 1990), which seasons have too."""

MOST = 3.0
"""Standard deviations that one night may count for: one odd night is no trend."""

LIMIT = 4.0
"""Standard deviations of the average that count as a signal. Chosen with the weight on 18 virtual
robots over half a year (benchmarks/year.py, first seed 51000): 3.75 gave two false alarms, 4 and
4.25 none; those that wear were alarmed 25.5, 25.2 and 25 nights (mean) before half their damage. A
weight of 0.2 with 4.5 gave none, and 24.8 nights; a weight of 1, no average, eight with 3.5."""

CALM = 2.5
"""Up to this an alarm may end: at the limit itself those of slight changes come and go with the
weather. Of 80 made-up joints that changed slightly, 60 instead of 82 alarms came back within ten
nights of their end, of 40 that wear slowly 7 instead of 20. The healthy ones of ten virtual robots
(benchmarks/year.py, 61000, 62000) had no alarm; by a limit of 3, five of 16 nights either way."""

USUAL_SPREAD, USUAL_NIGHTS = 0.13, 4.0
"""Standard deviation of healthy nights' log distances on the virtual testbed (0.09 to 0.16), and
the nights that it counts for: with few nights, their own spread is chance."""


def control_chart(values: FloatArray, healthy: BoolArray, n_baseline: int) -> FloatArray:
    """Chart a series of nights, each judged by nothing that came after it.

    Parameters
    ----------
    values : ndarray, shape (T,)
        Log distance of each night in time order; NaN where unknown. 0 is where the baseline's own
        nights lie.
    healthy : ndarray, shape (T,)
        Whether a night's own verdict is healthy.
    n_baseline : int
        Nights of the baseline: they count as nights at 0.

    Returns
    -------
    ndarray, shape (T,)
        Weighted average up to each night of its distance from where usual nights lie, in the
        average's own standard deviations; NaN where the night has no value.

    Notes
    -----
    A baseline of a few nights lies off by chance, and every later night with it. All healthy nights
    so far that did not lie above the limit correct for that, with the baseline's own at 0 beside
    them; the reference's own uncertainty is part of the average's standard deviation. The first
    nights alone would not do: they are those of one season, and a joint's nights move with it. A
    night above the limit is left out, or a change that lasts would be taken for the usual.
    """
    average = np.full(len(values), np.nan)
    usual: list[float] = []
    smoothed, share = 0.0, 0.0
    for t, value in enumerate(values):
        if not np.isfinite(value):
            continue
        reference = np.array(usual)
        centre, spread = usual_nights(reference, n_baseline)
        shift = float(np.clip((value - centre) / spread, -MOST, MOST))
        smoothed = (1 - WEIGHT) * smoothed + WEIGHT * shift
        share = (1 - WEIGHT) ** 2 * share + WEIGHT**2
        # one more night than there is: the reference's own spread is not known exactly either
        scale = np.sqrt(share + 1 / (n_baseline + len(reference) + 1))
        average[t] = smoothed / scale
        if healthy[t] and average[t] <= LIMIT:
            usual.append(float(value))
    return average


def usual_nights(reference: FloatArray, n_baseline: int) -> tuple[float, float]:
    """Return where healthy nights lie, and their standard deviation.

    Parameters
    ----------
    reference : ndarray, shape (N,)
        Log distances of healthy nights.
    n_baseline : int
        Nights of the baseline: they count as nights at 0.
    """
    n = len(reference)
    if not n:
        return 0.0, USUAL_SPREAD
    middle = median(reference)
    own = (MAD_TO_SIGMA * median(np.abs(reference - middle))) ** 2
    variance = (USUAL_NIGHTS * USUAL_SPREAD**2 + n * own) / (USUAL_NIGHTS + n)
    return n * middle / (n_baseline + n), float(np.sqrt(variance))
