"""Zero errors and unequal gains of the phase currents' sensors."""

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.transform.least_squares import solve

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FEWEST_FAST_SAMPLES = 200
"""Fewer that turn faster than the follower tell nothing of the sensors."""
ROUNDS_TO_CIRCLE = 8
"""Of a gain of four times the others' (the smooth simulator, seed 10000059) nothing is left."""


def current_vector(phases_a: Floats) -> NDArray[np.complex128]:
    """Clarke vector, amplitude-invariant, of phase currents of shape (n, 3)."""
    turn, (a, b, c) = np.exp(2j * np.pi / 3), phases_a.T
    return np.asarray(2 / 3 * (a + turn * b + np.conj(turn) * c))


def rounded(vector: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Make a circle about zero of the ellipse that zero errors and unequal gains have made of one.

    No angle is needed: a Clarke vector that turns often has no mean, and no mean square, where its
    samples count by the squares of their steps, so that rests do not. Of one that turns less than
    some ten times the result means nothing.
    """
    for _ in range(ROUNDS_TO_CIRCLE):
        steps = np.abs(np.diff(vector, append=vector[-1:])) ** 2
        weights = steps / max(float(steps.sum()), 1e-300)
        vector = vector - weights @ vector
        skew = complex(weights @ vector**2) / max(float(weights @ np.abs(vector) ** 2), 1e-300)
        imbalance = skew / (1 + np.sqrt(max(1 - abs(skew) ** 2, 0.0)))
        vector = vector - imbalance * np.conj(vector)
    return vector


def without_sensor_errors(
    vector: NDArray[np.complex128], angle_rad: Floats, fast: Bools
) -> NDArray[np.complex128]:
    """Take zero errors and unequal gains of the sensors out of a current vector, (n,).

    Both show in the flux current, once and twice per electrical revolution; at a low speed the
    followed angle, modulo pi, would sway with them. At fast samples the carrier is faster than the
    follower; where these are too few, the vector stays as it is.
    """
    if np.count_nonzero(fast) < FEWEST_FAST_SAMPLES:
        return vector
    rotated = vector[fast] * np.exp(-1j * angle_rad[fast])
    torque, flux, angle = rotated.real, rotated.imag, angle_rad[fast]
    once, twice = np.exp(1j * angle), torque * np.exp(2j * angle)
    columns = np.stack((-once.imag, once.real, -twice.imag, twice.real, angle**0), axis=1)
    found = solve(columns.T @ columns, columns.T @ flux)
    offset, imbalance = complex(found[0], found[1]), complex(found[2], found[3])
    return vector - offset - imbalance * np.conj(vector)
