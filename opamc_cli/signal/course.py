"""The course of a current over a motion: its mean in equal parts of the way."""

import numpy as np
from numpy.typing import NDArray

LEAST_SAMPLES = 2
"""Samples of a part: with fewer, what one sample of lag moves is as large as the course."""


def mean_course(current: NDArray[np.floating], parts: int) -> NDArray[np.float64]:
    """Mean of a current in each of equal parts.

    Parameters
    ----------
    current : ndarray, shape (n,)
        Samples of one motion; NaN is passed over.
    parts : int
        Parts wanted; fewer are made rather than shorter ones than `LEAST_SAMPLES`.

    Returns
    -------
    ndarray, shape (m,)
        m at most `parts`; NaN where a part has no known sample, empty without any part.

    Notes
    -----
    Edge rule: part k holds samples ceil(k n/m) to ceil((k+1) n/m), half-open, so that every sample
    counts once.
    """
    m = min(parts, current.size // LEAST_SAMPLES)
    if m < 1:
        return np.empty(0)
    x = np.asarray(current, dtype=np.float64)
    known = np.isfinite(x)
    starts = -(-np.arange(m) * x.size // m)
    total = np.add.reduceat(np.where(known, x, 0.0), starts)
    count = np.add.reduceat(known.astype(np.float64), starts)
    return np.asarray(np.divide(total, count, out=np.full(m, np.nan), where=count > 0))
