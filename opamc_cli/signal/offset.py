"""What current sensors add to a current vector, told from the parts in which it turns."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion.rotation import turning_parts

PIECE_S = 0.25
TURNS = 4.0
"""Fewest turns of a piece: a tapered mean over them holds less than 1 % of a steady carrier."""
TURNS_AT_TOP_SPEED = 12.0
"""Fewest turns that a motion would make at its highest frequency, for its mean to hold 4 % of the
offset and 0.1 % of the current (it makes half of them to two thirds)."""


def turns(z: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Net turns of a vector along its last axis, shape (..., n) to (...)."""
    # the square's angle does not jump where torque changes its sign
    squared = z * z
    advance = np.angle(squared[..., 1:] * squared[..., :-1].conj()).sum(axis=-1)
    return np.asarray(np.abs(advance) / (4 * np.pi))


def mean_over_turns(
    motions: Iterable[tuple[NDArray[np.complexfloating], float]], fs_hz: float
) -> complex:
    """Offset of the current vector from whole motions: their tapered mean over what they turn by.

    Over time the slow turns of both ends outweigh all others, and the holding current of a joint
    that settles all of them: of an offset of 40 mA beside currents of an ampere the tapered mean
    over time is off by 5 to 12 mA where a motion of 12 to 150 turns ends with 0.12 s at rest, by 25
    to 33 mA with 0.3 s; over turns by 0.4 to 0.9 mA (root mean squares, 60 made-up joints each).

    Parameters
    ----------
    motions : iterable of (array, shape (n,), A; float, Hz)
        Current vector of each motion, see `TURNS_AT_TOP_SPEED`, and the highest frequency at which
        it turns; NaN are passed over.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    complex
        In ampere; 0 of what does not turn.
    """
    total, weight = 0j, 0.0
    for vector, f_max_hz in motions:
        parts, turns = turning_parts(vector, f_max_hz, fs_hz)
        way = np.abs(turns)
        middle = np.cumsum(way) - way / 2
        taper = way * np.sin(np.pi * middle / max(way.sum(), 1e-12)) ** 2
        total += complex(parts @ taper)
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
