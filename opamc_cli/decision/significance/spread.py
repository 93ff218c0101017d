"""The baseline's own spread, from few sessions, and how unlikely a value beyond it is."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import digamma, fdtrc, polygamma, stdtr

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """A standard deviation and how much it can be relied on."""

    scale: float
    """Standard deviation."""
    dof: float
    """Degrees of freedom behind it."""


LEAST_VARIANCE = 1e-6
"""Of a log distance: those that agree to a thousandth agree."""

BETWEEN_SESSIONS = Spread(0.3, 3.0)
"""Spread of the log distance of healthy sessions where nothing else is known.

A session's distance is a mean, over motions and orders, of sums of squares of independent
influences: in simulation 0.06 (counting noise alone) to 0.6 (one influence that moves everything).
Three degrees of freedom keep false alarms at 1 % up to twice this spread.
"""

EXPECTED = Spread(BETWEEN_SESSIONS.scale, 1.0)
"""The same where labellings speak for themselves: then it counts for one value only."""


def moderated_spread(variance: float, dof: float, prior: Spread = EXPECTED) -> Spread:
    """Blend a variance from few values with what is known of such variances.

    Parameters
    ----------
    variance : float
        Sample variance; ignored if `dof` is zero.
    dof : float
        Its degrees of freedom, not negative.
    prior : Spread
        Spread expected beforehand.

    Returns
    -------
    Spread

    Notes
    -----
    Moderation as in G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3, but of the
    logarithms, without bias: spreads differ by factors, and a mean of the variances would let a
    large prior outweigh any number of small ones.
    """
    if dof <= 0:
        return prior
    total = prior.dof + dof
    own = np.log(max(variance, LEAST_VARIANCE)) - (digamma(dof / 2) - np.log(dof / 2))
    log_variance = (prior.dof * 2 * np.log(prior.scale) + dof * own) / total
    return Spread(float(np.exp(log_variance / 2)), total)


def spread_among_siblings(
    variance: float, siblings: ArrayLike, dof: float, expected: Spread, *, alike: bool = False
) -> Spread:
    """Spread of one joint's healthy sessions, from its own and its siblings'.

    Parameters
    ----------
    variance : float
        Sample variance of the joint's own sessions.
    siblings : array_like, shape (J,)
        Those of the other joints; NaN where unknown.
    dof : float
        Degrees of freedom of each, positive.
    expected : Spread
        Spread expected beforehand.
    alike : bool
        Whether joints are known to vary alike.

    Returns
    -------
    Spread
        Of the joint's own, the siblings' median, which one odd sibling cannot move, and what is
        expected.

    Notes
    -----
    Joints of one robot need not vary alike. The siblings are worth what their sessions are, but
    no more than `2 / u`, where u is the variance of the joints' log variances beyond that of a
    sample, trigamma(dof / 2) (Smyth, 2004): about that many degrees of freedom have a log variance
    that varies by u.
    """
    values = np.asarray(siblings, dtype=np.float64)
    values = values[np.isfinite(values)]
    prior = expected
    if values.size:
        logs = np.log(np.maximum([variance, *values], LEAST_VARIANCE))
        unlike = 0.0 if alike else max(float(logs.var(ddof=1) - polygamma(1, dof / 2)), 0.0)
        shared = 1 / (1 / (dof * values.size) + unlike / 2)
        median = moderated_spread(float(np.median(values)), dof, Spread(1.0, 0.0))
        share = prior.dof / (prior.dof + shared)
        scale = prior.scale**share * median.scale ** (1 - share)
        prior = Spread(scale, prior.dof + shared)
    return moderated_spread(variance, dof, prior)


def upper_tail(distance: float, spread: Spread) -> float:
    """Probability of a value at least `distance` above the mean.

    Parameters
    ----------
    distance : float
        Same unit as the spread.
    spread : Spread
        Standard deviation of the distance if nothing has changed.

    Returns
    -------
    float
        One-sided Student t probability, 0..1.
    """
    return float(stdtr(spread.dof, -distance / spread.scale))


def tail_of_influences(log_ratio: float, dof: float, dof_healthy: float) -> float:
    """Probability of a squared distance that is made of as many influences.

    Parameters
    ----------
    log_ratio : float
        Log of the distance over that of a healthy session.
    dof : float
        Number of influences.
    dof_healthy : float
        That times the healthy sessions less one.

    Returns
    -------
    float
        That of an F ratio: of one influence, of a Student t whose square it is.
    """
    return float(fdtrc(dof, dof_healthy, math.exp(min(log_ratio, 100.0))))


def spliced_p_value(
    distances: ArrayLike,
    observed: float,
    spread: Spread,
    n_above: int | None = None,
    below: Spread | None = None,
) -> float:
    """P-value that is a rank where ranks reach and a parametric tail beyond.

    Parameters
    ----------
    distances : array_like, shape (n,)
        Reference values, as distances above their mean.
    observed : float
        The value in question, on the same scale.
    spread : Spread
        For the parametric tail.
    n_above : int, optional
        How many reference values are at least as large; counted from `distances` by default.
    below : Spread, optional
        For the other side of the mean; the same by default.

    Returns
    -------
    float
        In (0, 1].

    Notes
    -----
    If all n + 1 values are exchangeable the observed one is exceeded by exactly k of the others
    with probability 1/(n+1) for each k, whatever their distribution. The parametric tail places
    it within its step, so that p is continuous, and below the last step, where ranks alone say
    no more than p ≤ 1/(n+1).
    """
    values = np.sort(np.asarray(distances, dtype=np.float64))[::-1]
    above = int((values >= observed).sum()) if n_above is None else n_above

    def beyond(value: float) -> float:
        return upper_tail(value, spread if value > 0 or below is None else below)

    tail = beyond(observed)
    upper = beyond(float(values[above])) if above < values.size else 1.0
    lower = beyond(float(values[above - 1])) if above else 0.0
    width = upper - lower
    share = float(np.clip((tail - lower) / width, 0.0, 1.0)) if width > 0 else 0.5
    return float(np.clip((above + share) / (values.size + 1), 1e-300, 1.0))
