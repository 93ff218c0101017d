"""The three numbers by which two groups of divergences are compared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Features:
    """Statistical distance between baseline and target divergences."""

    delta_mu: float
    """Mean of the target minus mean of the baseline."""
    delta_var: float
    """Sample variance of the target minus that of the baseline."""
    ks: float
    """Two-sample Kolmogorov-Smirnov statistic, 0..1."""


def _finite(values: ArrayLike) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    flat = np.asarray(values, dtype=np.float64).ravel()
    return flat[np.isfinite(flat)]


def ks_statistic(baseline: ArrayLike, target: ArrayLike) -> float:
    """Two-sample Kolmogorov-Smirnov statistic (thesis 2021, equation 2-10).

    Parameters
    ----------
    baseline, target : array_like, shapes (n,) and (m,)
        Divergences; entries that are not finite are passed over.

    Returns
    -------
    float
        Largest distance between the two empirical distribution functions, 0..1; NaN if either
        group is empty.
    """
    b, t = np.sort(_finite(baseline)), np.sort(_finite(target))
    if not b.size or not t.size:
        return float("nan")
    points = np.concatenate([b, t])
    below_b = np.searchsorted(b, points, side="right") / b.size
    below_t = np.searchsorted(t, points, side="right") / t.size
    return float(np.abs(below_b - below_t).max())


def compare(baseline: ArrayLike, target: ArrayLike) -> Features:
    """All three features of one axis and order (thesis 2021, 4.3.2).

    Parameters
    ----------
    baseline, target : array_like, shapes (n,) and (m,)
        Divergences of the two groups; entries that are not finite are passed over.

    Returns
    -------
    Features
        NaN where a group is empty; the variances (divisor n-1) need two entries.
    """
    b, t = _finite(baseline), _finite(target)
    least, unknown = min(b.size, t.size), float("nan")
    return Features(
        delta_mu=float(t.mean() - b.mean()) if least else unknown,
        delta_var=float(t.var(ddof=1) - b.var(ddof=1)) if least > 1 else unknown,
        ks=ks_statistic(b, t),
    )
