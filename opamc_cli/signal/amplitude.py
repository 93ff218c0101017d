"""How large a current is, in three numbers."""

import numpy as np
from numpy.typing import NDArray

FLOOR_A = 1e-6
"""Stands for none, A: below any sensor's resolution."""


def log_amplitudes(current: NDArray[np.floating]) -> NDArray[np.float64]:
    """Logarithms of three sizes of a current.

    Parameters
    ----------
    current : ndarray, shape (n,)
        Samples of one motion, A.

    Returns
    -------
    ndarray, shape (3,)
        Of its root mean square, that of the differences of successive samples, and its mean size;
        empty for fewer than two samples, or with one that is unknown: another part of the motion
        has another size.
    """
    x = np.asarray(current, dtype=np.float64)
    if x.size < 2 or not np.isfinite(x).all():
        return np.empty(0)
    sizes = [np.sqrt(np.mean(x**2)), np.sqrt(np.mean(np.diff(x) ** 2)), np.mean(np.abs(x))]
    return np.log(np.maximum(sizes, FLOOR_A))
