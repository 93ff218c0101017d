"""Angle, speed and torque current from three phase currents alone.

When the torque changes sign, the current vector's angle jumps by pi; the angle of its square
does not. Half of that angle is the electrical angle, and the current along it has a sign.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from opamc_cli.joint.track import Floats

PERIODS_PER_WINDOW = 2.0
SHORTEST_WINDOW_S = 0.01
LONGEST_WINDOW_S = 0.12


@dataclass(frozen=True)
class PhaseAngle:
    """Smoothed electrical angle of one recording, and its derivatives."""

    angle_rad: Floats
    velocity_rad_s: Floats
    acceleration_rad_s2: Floats
    window: int

    def aligned_with(self, position_rad: Floats, ratio: float | None) -> Floats:
        """Electrical angle from the logged position, with ratio and zero taken from the phases.

        Parameters
        ----------
        position_rad : array of shape (n,)
            Joint angle.
        ratio : float or None
            Electrical radians per joint radian, if known.

        Returns
        -------
        array of shape (n,)
            The phases' own angle where the position does not follow it within half a radian.
        """
        centred = position_rad - position_rad.mean()
        slope = float(np.dot(centred, self.angle_rad) / max(np.dot(centred, centred), 1e-300))
        if ratio is not None:
            slope = float(np.copysign(ratio, slope))
        rest = self.angle_rad - slope * position_rad
        if np.std(rest) > 0.5:
            return self.angle_rad
        return slope * position_rad + float(np.mean(rest))


def current_vector(phases_a: Floats) -> NDArray[np.complex128]:
    """Clarke vector, amplitude-invariant.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Phase currents a, b, c.

    Returns
    -------
    complex array of shape (n,)
    """
    turn = np.exp(2j * np.pi / 3)
    vector: NDArray[np.complex128] = (
        2 / 3 * (phases_a[:, 0] + turn * phases_a[:, 1] + np.conj(turn) * phases_a[:, 2])
    )
    return vector


def follow_phases(phases_a: Floats, rate_hz: float) -> PhaseAngle:
    """Follow the angle of the squared current vector through zeros of the current.

    Increments of the angle are averaged with the square's power as weight over about two
    electrical periods (10 to 120 ms), so that moments without current lean on their neighbours;
    then the remaining phase error, which is slow, is taken out.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Finite phase currents, n > 16.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    PhaseAngle
    """
    square = current_vector(phases_a) ** 2
    turns = square[1:] * np.conj(square[:-1])
    strong = np.abs(square) > np.quantile(np.abs(square), 0.5)
    steps = np.abs(np.angle(turns[strong[1:]]))
    moving = steps[steps > np.quantile(steps, 0.5)] if steps.size else steps
    typical = float(np.median(moving)) / 2 if moving.size else 0.1
    period = 2 * np.pi / max(typical, 1e-6)
    length = np.clip(
        PERIODS_PER_WINDOW * period, SHORTEST_WINDOW_S * rate_hz, LONGEST_WINDOW_S * rate_hz
    )
    window = min(max(int(length) | 1, 7), (phases_a.shape[0] - 1) | 1)
    kernel = np.hanning(window + 2)[1:-1]
    kernel /= kernel.sum()
    mean_turn = np.convolve(turns, kernel, mode="same")
    increments = np.concatenate([[0.0], np.angle(mean_turn)])
    angle = np.cumsum(increments)
    rest = np.convolve(square * np.exp(-1j * angle), kernel, mode="same")
    angle = (angle + np.unwrap(np.angle(rest))) / 2
    return PhaseAngle(
        angle,
        savgol_filter(angle, window, 3, deriv=1, delta=1 / rate_hz),
        savgol_filter(angle, window, 3, deriv=2, delta=1 / rate_hz),
        window,
    )


def torque_current(
    phases_a: Floats, electrical_rad: Floats, velocity: Floats
) -> tuple[Floats, Floats]:
    """Split the current along and across the electrical angle.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Phase currents.
    electrical_rad : array of shape (n,)
        Electrical angle of the torque axis.
    velocity : array of shape (n,)
        Speed; the sign is taken so that the current does work on average: friction resists.

    Returns
    -------
    torque_a, flux_a : arrays of shape (n,)
    """
    rotated = current_vector(phases_a) * np.exp(-1j * electrical_rad)
    torque = rotated.real
    side = 1.0 if float(np.dot(torque, np.sign(velocity))) >= 0 else -1.0
    return side * torque, side * rotated.imag
