"""The median of a few numbers."""

import numpy as np
from numpy.typing import NDArray


def median(values: NDArray[np.float64]) -> float:
    """Return the median of values, shape (n,) with n from 1 on, all of them finite.

    As `numpy.median`, which loads numpy's masked arrays first: a hundredth of a lone night.
    """
    ordered = np.sort(values)
    return float(ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
