"""Angle and speed from three phase currents alone.

When the torque changes sign, the current vector's angle jumps by pi; the angle of its square
does not. Half of that angle is the electrical angle, and the current along it has a sign.
"""

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.least_squares import solve
from opamc_cli.joint.motion.phases.angle_filter import (
    acceleration_noise,
    clean_bandwidth,
    smoothed_angle,
    smoothing_kernel,
    widest_bandwidth,
)
from opamc_cli.joint.motion.phases.half_turns import bridged
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.smoothing import derivatives
from opamc_cli.joint.motion.track import Bools, Floats

STRONG = 5.0
"""A current vector counts where it is longer than this many times its noise."""

WEAKEST_SHARE = 0.02
"""Nor does one count that is shorter than this share of the longest."""

AVERAGE_S = 0.008
UNLIKELY = 4.0
"""A weaker current counts where the mean of its square, turned back by the angle followed so far,
over 8 ms is this many times what noise makes of it."""

CLEANING_ROUNDS = 5
"""At most. An angle that was followed beside a sensor's zero error tells a part of that error; the
angle that is followed without that part tells more: three tell a third of the current."""
BRIDGE_ROUNDS = 2
BANDWIDTH_ROUNDS = 2
CARRIER_OVER_BANDWIDTH = 2.0
FEWEST_FAST_SAMPLES = 200

NOISIEST_SHARE = 0.1
"""Noise of the acceleration, relative to the acceleration, up to which a sample counts."""


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
    """Follow the current vector's angle, modulo pi, through zeros and reversals of the current.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Finite phase currents, n > 16; the electrical frequency below a quarter of the rate.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    PhaseAngle
        Smoothed by `smoothed_angle`.
    """
    vector = current_vector(phases_a)
    length = np.abs(vector)
    # The third harmonic-free sum of three phases is noise alone where sensors have no offset;
    # fourth differences of the vector's length hold no carrier either way.
    noise = float(np.median(np.abs(np.diff(length, 4)))) / 0.6745 / np.sqrt(70.0)
    floor = WEAKEST_SHARE * float(np.quantile(length, 0.95))
    bandwidth = widest_bandwidth(rate_hz)
    for _ in range(CLEANING_ROUNDS):
        length = np.abs(vector)
        strong = length > max(STRONG * noise, floor)
        rough, coherence = _turning(vector, rate_hz)
        sure = (coherence > 0.9) & strong
        local = np.sqrt(np.maximum(_centred_mean(length**2 + 0j, 15).real, 1e-300))
        spread = None
        if strong.any():
            spread = np.maximum(float(np.median(local[strong])) / local, 1.0) ** 2
        measured = np.angle(vector)
        angle, velocity = bridged(measured, strong, rough, sure, spread, rate_hz, bandwidth)
        fast = strong & (np.abs(velocity) > CARRIER_OVER_BANDWIDTH * 2 * np.pi * bandwidth)
        before, vector = vector, without_sensor_errors(vector, angle, fast)
        if float(np.median(np.abs(vector - before))) <= noise:
            break
    for _ in range(BRIDGE_ROUNDS):
        strong, measured = averaged_angle(vector, angle, noise, floor, rate_hz)
        angle, velocity = bridged(measured, strong, rough, sure, spread, rate_hz, bandwidth)
    measured = angle + _halved(measured - angle)
    angle, velocity, acceleration = smoothed_angle(
        measured, strong, rough, sure, rate_hz, bandwidth, turn_rad=0.0
    )
    angle_noise = noise / np.maximum(_centred_mean(length.astype(np.complex128), 15).real, 1e-300)
    typical = float(np.median(angle_noise[strong])) if strong.any() else 0.0
    for _ in range(BANDWIDTH_ROUNDS):
        followed = float(np.var(acceleration[strong])) if strong.any() else 0.0
        followed -= acceleration_noise(typical, rate_hz, bandwidth) ** 2
        narrower = clean_bandwidth(typical, np.sqrt(max(followed, 0.0)), rate_hz)
        if narrower > 0.9 * bandwidth:
            break
        bandwidth = narrower
        angle, velocity, acceleration = smoothed_angle(
            measured, strong, rough, sure, rate_hz, bandwidth, turn_rad=0.0
        )
    limit = NOISIEST_SHARE * float(np.std(acceleration[strong])) if strong.any() else 0.0
    per_radian = acceleration_noise(1.0, rate_hz, bandwidth)
    clear = strong & (per_radian * angle_noise <= limit)
    window = int(rate_hz / bandwidth) | 1
    path = np.where(strong, measured, angle)
    blur = np.stack(
        [
            derivatives(path, rate_hz, min(size, (path.size - 1) | 1), 2) - acceleration
            for size in (int(rate_hz / bandwidth / 2) | 1, int(2 * rate_hz / bandwidth) | 1)
        ],
        axis=1,
    )
    kernel = smoothing_kernel(rate_hz, bandwidth)
    return PhaseAngle(angle, velocity, acceleration, strong, clear, window, kernel, blur)


def _turning(vector: NDArray[np.complex128], rate_hz: float) -> tuple[Floats, Floats]:
    """Angular speed in rad/s from sample to sample, averaged, and how far neighbours agree."""
    turns = vector[1:] * np.conj(vector[:-1])
    smooth = _centred_mean(turns, 15)
    weight = _centred_mean(np.abs(turns).astype(np.complex128), 15).real
    coherence = np.abs(smooth) / np.maximum(weight, 1e-300)
    speed: Floats = np.concatenate([[0.0], np.angle(smooth)]) * rate_hz
    return speed, np.concatenate([[0.0], coherence])


def averaged_angle(
    vector: NDArray[np.complex128], angle_rad: Floats, noise: float, floor: float, rate_hz: float
) -> tuple[Bools, Floats]:
    """Measure the angle of weak currents over several samples, along the followed angle.

    Parameters
    ----------
    vector : complex array of shape (n,)
        Clarke vector.
    angle_rad : array of shape (n,)
        Followed angle, modulo pi.
    noise : float
        Standard deviation of each of the vector's components.
    floor : float
        Length below which a vector never counts.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    strong : bool array of shape (n,)
        Samples that, alone or averaged, tell an angle.
    measured : array of shape (n,)
        Angle modulo pi.
    """
    length = np.abs(vector)
    alone = length > max(STRONG * noise, floor)
    width = max(int(AVERAGE_S * rate_hz), 1) | 1
    square = _centred_mean((vector * np.exp(-1j * angle_rad)) ** 2, width)
    # Of noise alone the mean square is of this size.
    chance = noise**2 * np.sqrt(8 / width)
    together = np.abs(square) > max(UNLIKELY * chance, floor**2)
    measured = np.where(alone, np.angle(vector), angle_rad + 0.5 * np.angle(square))
    return alone | together, measured


def _halved(angle_rad: Floats) -> Floats:
    """Angle modulo pi, between -pi/2 and pi/2."""
    halved: Floats = angle_rad - np.pi * np.round(angle_rad / np.pi)
    return halved


def without_sensor_errors(
    vector: NDArray[np.complex128], angle_rad: Floats, fast: Bools
) -> NDArray[np.complex128]:
    """Take zero errors and unequal gains of the sensors out of a current vector.

    Both show in the flux current, once and twice per electrical revolution; at a low speed the
    followed angle would sway with them.

    Parameters
    ----------
    vector : complex array of shape (n,)
        Clarke vector.
    angle_rad : array of shape (n,)
        Followed angle of the torque axis, modulo pi.
    fast : bool array of shape (n,)
        Samples at which the carrier is faster than the follower.

    Returns
    -------
    complex array of shape (n,)
        The vector itself where too few samples are fast.
    """
    if np.count_nonzero(fast) < FEWEST_FAST_SAMPLES:
        return vector
    rotated = vector[fast] * np.exp(-1j * angle_rad[fast])
    torque, flux, angle = rotated.real, rotated.imag, angle_rad[fast]
    columns = np.stack(
        [
            -np.sin(angle),
            np.cos(angle),
            -torque * np.sin(2 * angle),
            torque * np.cos(2 * angle),
            np.ones(angle.size),
        ],
        axis=1,
    )
    found = solve(columns.T @ columns, columns.T @ flux)
    offset, imbalance = complex(found[0], found[1]), complex(found[2], found[3])
    clean: NDArray[np.complex128] = vector - offset - imbalance * np.conj(vector)
    return clean


def _centred_mean(values: NDArray[np.complex128], width: int) -> NDArray[np.complex128]:
    sums = np.cumsum(np.concatenate([np.zeros(width // 2 + 1), values, np.zeros(width // 2)]))
    means: NDArray[np.complex128] = (sums[width:] - sums[:-width]) / width
    return means
