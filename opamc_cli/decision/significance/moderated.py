"""Means of two small samples compared, with a variance that borrows from elsewhere."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc, stdtr  # scipy.stats takes a second to load

Floats = NDArray[np.float64]

PRIOR_WEIGHT = 4.0
"""Degrees of freedom that the borrowed variance is worth."""


def moderated_t(
    before: Floats, after: Floats, between: float | Floats = 0.0
) -> tuple[Floats, Floats]:
    """One-sided t and p values, (k,), of k features at once; larger after is positive.

    Of the baseline's units, (n, k) with n at least 2, and of the target's, (m, k). The variance of
    each feature is drawn towards the median of all; `between` is that between sessions, which
    units of one session cannot show. Smyth, Statistical Applications in Genetics and Molecular
    Biology 3, 2004.
    """
    n, m = before.shape[0], after.shape[0]
    variance = np.var(before, axis=0, ddof=1)
    weight = n - 1 + PRIOR_WEIGHT
    variance = ((n - 1) * variance + PRIOR_WEIGHT * np.median(variance)) / weight
    t_values: Floats = (after.mean(axis=0) - before.mean(axis=0)) / np.sqrt(
        np.maximum(variance, 1e-300) * (1 / n + 1 / m) + 2 * between
    )
    return t_values, stdtr(weight, -t_values)


def moderated_covariance(sample: Floats, prior: Floats) -> Floats:
    """Covariance of a small sample, shape (n, k) with n from 1 on, drawn towards a prior one."""
    n = sample.shape[0]
    centred = sample - sample.mean(axis=0)
    found: Floats = (centred.T @ centred + PRIOR_WEIGHT * prior) / (n - 1 + PRIOR_WEIGHT)
    return found


def shift_p(shift: Floats, covariance: Floats, units: int) -> float:
    """Probability of a shift of means, shape (k,), as large as this in several directions at once.

    The shift's covariance has been told by so many of the baseline's `units`.
    """
    size = shift.size
    square = float(shift @ np.linalg.pinv(covariance, hermitian=True) @ shift)
    freedom = max(units - 1 + PRIOR_WEIGHT - size + 1, 1.0)
    scale = freedom / (units - 1 + PRIOR_WEIGHT)
    return float(fdtrc(size, freedom, square * scale / size))
