"""Correction for having asked about several joints at once."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def holm(p_values: ArrayLike) -> NDArray[np.float64]:
    """Adjust p-values so that the chance of any false alarm stays below the level.

    Parameters
    ----------
    p_values : array_like, shape (J,)
        One p-value per joint; NaN entries stay NaN and do not count.

    Returns
    -------
    ndarray, shape (J,)
        Adjusted p-values, at most 1, valid under any dependence between the joints.

    Notes
    -----
    S. Holm, Scand. J. Statist. 6 (1979) 65-70.
    """
    p = np.asarray(p_values, dtype=np.float64)
    adjusted = np.full(p.shape, np.nan)
    known = np.flatnonzero(np.isfinite(p))
    order = known[np.argsort(p[known], kind="stable")]
    factors = len(order) - np.arange(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted
