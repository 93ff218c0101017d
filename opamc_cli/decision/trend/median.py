"""The median, without numpy's: that loads arrays with masks, 40 ms of a lone night's 2 s."""

import numpy as np
from numpy.typing import NDArray


def median(values: NDArray[np.float64]) -> float:
    """Return the middle value, of an even number the mean of the two in the middle.

    Parameters
    ----------
    values : ndarray, shape (N,)
        Finite, one at least.

    Returns
    -------
    float
        That of `numpy.median`, to the last digit.
    """
    ordered, half = np.sort(values), len(values) // 2
    return float(ordered[half] if len(values) % 2 else (ordered[half - 1] + ordered[half]) / 2)
