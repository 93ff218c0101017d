"""Sums of products of signals over ranges of samples: what least squares by parts is made of."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NARROW = 16
"""Signals up to which loops are faster than BLAS, whose call costs more than a thousand products:
one by one by ten, 70 by eight by a quarter, 70 by 70 not at all (`benchmarks/chain/kernels.py`)."""


def products_over(ranges: Ints, left: Floats, right: Floats) -> Floats:
    """Sum ``left.T @ right`` over each of some ranges.

    Parameters
    ----------
    ranges : int array of shape (p, 2)
        Half-open, of samples that both have.
    left, right : arrays of shape (n, k) and (n, m)
        Signals side by side; fastest where each is contiguous.

    Returns
    -------
    array of shape (p, k, m)
    """
    if left.shape[1] < right.shape[1]:
        return np.swapaxes(products_over(ranges, right, left), 1, 2)
    found = np.empty((len(ranges), left.shape[1], right.shape[1]))
    if right.shape[1] <= NARROW and left.flags.f_contiguous and right.flags.f_contiguous:
        _by_loops(ranges, left.T, right.T, found)
        return found
    for (start, stop), own in zip(ranges, found, strict=True):
        own[:] = left[start:stop].T @ right[start:stop]
    return found


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz", "contract"})
def _by_loops(ranges: Ints, wide: Floats, narrow: Floats, found: Floats) -> None:
    """Four by two, so that each wide signal is read from memory once; the last may be met again."""
    last, least = len(wide) - 1, len(narrow) - 1
    for p in range(len(ranges)):
        start, stop = ranges[p]
        for i in range(0, last + 1, 4):
            i1, i2, i3 = min(i + 1, last), min(i + 2, last), min(i + 3, last)
            a, b = wide[i, start:stop], wide[i1, start:stop]
            c, d = wide[i2, start:stop], wide[i3, start:stop]
            for j in range(0, least + 1, 2):
                j1 = min(j + 1, least)
                x, y = narrow[j, start:stop], narrow[j1, start:stop]
                ax = ay = bx = by = cx = cy = dx = dy = 0.0
                for n in range(stop - start):
                    ax += a[n] * x[n]
                    ay += a[n] * y[n]
                    bx += b[n] * x[n]
                    by += b[n] * y[n]
                    cx += c[n] * x[n]
                    cy += c[n] * y[n]
                    dx += d[n] * x[n]
                    dy += d[n] * y[n]
                found[p, i, j], found[p, i, j1] = ax, ay
                found[p, i1, j], found[p, i1, j1] = bx, by
                found[p, i2, j], found[p, i2, j1] = cx, cy
                found[p, i3, j], found[p, i3, j1] = dx, dy
