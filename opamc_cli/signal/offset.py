"""What current sensors add to a current vector, told from the parts in which it turns."""

import numpy as np
from numpy.typing import NDArray

PIECE_S = 0.25
TURNS = 4.0
"""Fewest turns of a piece: a tapered mean over them holds less than 1 % of a steady carrier."""


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
    # The square's angle does not jump where torque changes its sign.
    squared = pieces * pieces
    turns = np.abs(np.angle(squared[:, 1:] * squared[:, :-1].conj()).sum(axis=1)) / (4 * np.pi)
    taper = np.hanning(length)
    means: NDArray[np.complex128] = (pieces[turns >= TURNS] * taper).sum(axis=1) / taper.sum()
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
