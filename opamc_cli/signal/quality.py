"""Signs that a channel cannot be trusted."""

import numpy as np
from numpy.typing import NDArray

MOST_BRIDGED = 3
"""Samples of a gap that is filled: a packet or two that a logger lost, less than any pattern
spans."""


def clipped_share(x: NDArray[np.floating]) -> float:
    """Share of the samples that sit at the channel's largest or smallest value, if it is clipped.

    A clipped channel reaches its extreme value far more often than the next value inside; a
    quantised crest does not. A current that rests at exactly zero is at no limit.

    Parameters
    ----------
    x : array, shape (n,)
        Samples of one channel; NaN is passed over.

    Returns
    -------
    float
        0 for a channel that does not look clipped.
    """
    known = x[np.isfinite(x)]
    if known.size < 2:
        return 0.0
    n_clipped = 0
    for extreme in (known.max(), known.min()):
        n_extreme = int(np.count_nonzero(known == extreme))
        inside = known[known != extreme]
        if extreme == 0 or n_extreme < max(10, known.size // 1000) or not inside.size:
            continue
        nearest = inside[np.argmin(np.abs(inside - extreme))]
        if n_extreme > 5 * np.count_nonzero(known == nearest):
            n_clipped += n_extreme
    return float(n_clipped / known.size)


def bridged(x: NDArray[np.floating]) -> NDArray[np.floating]:
    """Fill short gaps with a straight line between what is known.

    Parameters
    ----------
    x : array, shape (n,)
        Samples of one motion; NaN where unknown.

    Returns
    -------
    array, shape (n,)
        Gaps of more than `MOST_BRIDGED` samples, and those at an end, are left.
    """
    known = np.flatnonzero(np.isfinite(x))
    if known.size in (0, x.size):
        return x
    place = np.arange(known[0], known[-1] + 1)
    after = np.searchsorted(known, place)
    gap = known[after] - known[np.maximum(after - 1, 0)] - 1
    filled = x.copy()
    short = place[(gap > 0) & (gap <= MOST_BRIDGED)]
    filled[short] = np.interp(short, known, x[known])
    return filled


def is_constant(x: NDArray[np.floating]) -> bool:
    """Whether all known samples of a channel are equal (true if there are none)."""
    known = x[np.isfinite(x)]
    return not known.size or bool(known.min() == known.max())
