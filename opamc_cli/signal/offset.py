"""What current sensors add to a current vector, told from the parts in which it turns."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

PIECE_S = 0.25
TURNS = 4.0
"""Fewest turns of a piece: a tapered mean over them holds less than 1 % of a steady carrier."""
TURNS_AT_TOP_SPEED = 12.0
"""Fewest turns that a motion would make at its highest frequency, for its tapered mean to hold 2 to
3 % of the current (it makes half of them to two thirds)."""


def turns(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Net turns of a vector along its last axis, shape (..., n) to (...)."""
    # the square's angle does not jump where torque changes its sign
    squared = z * z
    advance = np.angle(squared[..., 1:] * squared[..., :-1].conj()).sum(axis=-1)
    return np.asarray(np.abs(advance) / (4 * np.pi))


def mean_over_motions(vectors: Iterable[NDArray[np.complexfloating]]) -> complex:
    """Offset of the current vector from whole motions: their tapered mean.

    A motion begins and ends slowly: without a taper its first and last turn weigh as much as all
    others, and the mean is off by 5 % of the current where 150 turns are known, with it by 0.4 %
    (36 joints of the testbed).

    Parameters
    ----------
    vectors : iterable of array, shape (n,), A
        Current vector of each motion, see `TURNS_AT_TOP_SPEED`; NaN are passed over.

    Returns
    -------
    complex
        In ampere; 0 without a sample.
    """
    total, weight = 0j, 0.0
    for vector in vectors:
        finite = np.isfinite(vector)
        taper = np.hanning(vector.size + 2)[1:-1][finite]
        total += complex(vector[finite].astype(np.complex128) @ taper)
        weight += float(taper.sum())
    return total / weight if weight else 0j


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
