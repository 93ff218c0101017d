"""The baseline's own spread, from few sessions, and how unlikely a value beyond it is."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import t as student_t

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """A standard deviation and how much it can be relied on.

    Attributes
    ----------
    scale : float
        Standard deviation.
    dof : float
        Degrees of freedom behind it.
    """

    scale: float
    dof: float


BETWEEN_SESSIONS = Spread(0.3, 3.0)
"""Spread of the log divergence of healthy sessions where nothing else is known.

A session's divergence is a mean, over motions and orders, of sums of squares of independent
influences: in simulation 0.06 (counting noise alone) to 0.6 (one influence that moves everything).
Three degrees of freedom keep false alarms at 1 % up to twice this spread.
"""


def moderated_spread(variance: float, dof: float, prior: Spread = BETWEEN_SESSIONS) -> Spread:
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
    The moderated variance of G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004), article 3.
    """
    total = prior.dof + dof
    own = variance * dof if dof > 0 else 0.0
    return Spread(float(np.sqrt((prior.dof * prior.scale**2 + own) / total)), total)


def shared_prior(variances: ArrayLike, dof: float, prior: Spread = BETWEEN_SESSIONS) -> Spread:
    """Spread to be expected of one joint, from its siblings.

    Parameters
    ----------
    variances : array_like, shape (J,)
        Sample variances of the siblings; NaN where unknown.
    dof : float
        Degrees of freedom of each.
    prior : Spread
        Spread expected before the siblings are seen.

    Returns
    -------
    Spread
        Blend of `prior` with the siblings' median variance, which one odd sibling cannot move.
        Half of the siblings' degrees of freedom are counted, because joints differ in spread.
    """
    values = np.asarray(variances, dtype=np.float64)
    values = values[np.isfinite(values)]
    if not values.size or dof <= 0:
        return prior
    # the median of a chi-square over its degrees of freedom is about (1 - 2/9ν)³
    median = float(np.median(values)) / (1 - 2 / (9 * dof)) ** 3
    return moderated_spread(median, 0.5 * dof * values.size, prior)


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
    return float(student_t.sf(distance / spread.scale, spread.dof))


def spliced_p_value(distances: ArrayLike, observed: float, spread: Spread) -> float:
    """P-value that is a rank where ranks reach and a parametric tail beyond.

    Parameters
    ----------
    distances : array_like, shape (n,)
        Reference values, as distances above their mean.
    observed : float
        The value in question, on the same scale.
    spread : Spread
        For the parametric tail.

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
    values = np.asarray(distances, dtype=np.float64)
    above = values[values >= observed]
    below = values[values < observed]
    tail = upper_tail(observed, spread)
    upper = upper_tail(float(below.max()), spread) if below.size else 1.0
    lower = upper_tail(float(above.min()), spread) if above.size else 0.0
    width = upper - lower
    share = float(np.clip((tail - lower) / width, 0.0, 1.0)) if width > 0 else 0.5
    return float(np.clip((above.size + share) / (values.size + 1), 1e-300, 1.0))
