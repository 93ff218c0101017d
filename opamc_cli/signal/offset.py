"""What current sensors add to a current vector, told from the parts in which it turns."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

PIECE_S = 0.25
TURNS = 4.0
"""Fewest turns of a piece: a tapered mean over them holds less than 1 % of a steady carrier."""


MANY_TURNS = 50.0
"""Fewest turns of whole motions: fewer leave more of the vector than of the offset."""


def turns(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Net turns of a vector along its last axis, shape (..., n) to (...)."""
    # the square's angle does not jump where torque changes its sign
    squared = z * z
    advance = np.angle(squared[..., 1:] * squared[..., :-1].conj()).sum(axis=-1)
    return np.asarray(np.abs(advance) / (4 * np.pi))


def mean_over_turns(vectors: Iterable[NDArray[np.complexfloating]]) -> complex:
    """Offset of the current vector from whole motions: its mean over many turns.

    Parameters
    ----------
    vectors : iterable of array, shape (n,), A
        Current vector of each motion; NaN are passed over.

    Returns
    -------
    complex
        In ampere; 0 for fewer than fifty turns in all.
    """
    total, count, n_turns = 0j, 0, 0.0
    for vector in vectors:
        z = vector[np.isfinite(vector)].astype(np.complex128)
        if z.size > 1:
            n_turns += float(turns(z))
            total += complex(z.sum())
            count += z.size
    return total / count if n_turns >= MANY_TURNS else 0j


def turning_means(z: NDArray[np.complexfloating], fs_hz: float) -> NDArray[np.complex128]:
    """Tapered means of the current vector over short pieces in which it turns.

    The vector turns, its sensors' offset stands still. While the robot stands the mean is a
    holding torque, so those pieces are passed over.

    Parameters
    ----------
    z : array, shape (n,), A
        Current vector; pieces with NaN are passed over.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    array, shape (k,), A
        One mean per piece of 0.25 s that holds at least four turns.
    """
    length = max(2, round(PIECE_S * fs_hz))
    count = z.size // length
    pieces = z[: count * length].reshape(count, length).astype(np.complex128)
    pieces = pieces[np.isfinite(pieces).all(axis=1)]
    taper = np.hanning(length)
    means: NDArray[np.complex128] = (pieces[turns(pieces) >= TURNS] * taper).sum(
        axis=1
    ) / taper.sum()
    return means


def turning_offset(means: NDArray[np.complex128]) -> complex:
    """Offset of the current vector from its means over pieces: their median by component.

    Parameters
    ----------
    means : array, shape (k,), A
        Of `turning_means`.

    Returns
    -------
    complex
        In ampere; 0 for fewer than four pieces, which could not outvote an odd one.
    """
    if means.size < 4:
        return 0j
    return complex(np.median(means.real), np.median(means.imag))
