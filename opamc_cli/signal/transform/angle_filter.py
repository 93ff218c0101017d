"""Kalman filter and smoother of an angle that is measured modulo pi, with gaps."""

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.special import beta

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

WIDEST_HZ = 30.0
NARROWEST_HZ = 6.0
NOISE_SHARE = 0.015
"""Noise of the acceleration, relative to the acceleration, that sets the bandwidth."""

ANGLE_NOISE_RAD = 0.3
FREE_RAD2 = 1e6
"""Variance of a step of the angle about which nothing is known."""

ROUGH_NOISE_RAD = 1.0
"""Error of the rough speed, as an angle over its own window of 15 samples."""

STRONG = 5.0
"""A current vector counts where it is longer than this many times its noise."""

AVERAGE_S = 0.008
UNLIKELY = 4.0
"""A weaker current counts where the mean of its square, turned back by the angle followed so far,
over 8 ms is this many times what noise makes of it."""


def widest_bandwidth(rate_hz: float) -> float:
    """Bandwidth above which errors of sensors and inverter, at the carrier, would be followed."""
    return min(WIDEST_HZ, rate_hz / 20)


def acceleration_noise(angle_noise_rad: float, rate_hz: float, bandwidth_hz: float) -> float:
    """Tell the acceleration, in rad/s^2, that white noise of the angle leaves.

    Its deviation: the root of the noise's density times the integral of ``(2 pi f)^4 / (1 + (f /
    b)^6)^2``, which is ``(2 pi)^4 b^5 B(5/6, 7/6) / 6``.
    """
    return float(
        angle_noise_rad
        * (2 * np.pi) ** 2
        * np.sqrt(2 / rate_hz * bandwidth_hz**5 * beta(5 / 6, 7 / 6) / 6)
    )


def clean_bandwidth(angle_noise_rad: float, acceleration: float, rate_hz: float) -> float:
    """Widest bandwidth at which the acceleration's noise is 1.5 % of the acceleration, in Hz.

    Of standard deviations of the measured angle per sample and of the acceleration, in rad/s^2; at
    least 6 Hz, at most 30 and a twentieth of the rate.
    """
    widest = widest_bandwidth(rate_hz)
    own = acceleration_noise(angle_noise_rad, rate_hz, widest)
    if own <= NOISE_SHARE * acceleration:
        return widest
    clean = widest * (NOISE_SHARE * acceleration / own) ** 0.4
    return float(max(clean, min(NARROWEST_HZ, widest)))


def smoothing_kernel(rate_hz: float, bandwidth_hz: float) -> Floats:
    """Weights by which the smoother averages a steady recording, odd length, sum 1.

    With ``b`` the bandwidth, the smoother's gain at frequency f is ``1 / (1 + (f / b)^6)``.
    """
    half = int(1.5 * rate_hz / bandwidth_hz)
    length = 16 * half
    frequency = np.fft.rfftfreq(length, 1 / rate_hz)
    response = np.fft.irfft(1 / (1 + (frequency / bandwidth_hz) ** 6), length)
    kernel = np.concatenate([response[-half:], response[: half + 1]])
    return np.asarray(kernel / kernel.sum())


def smoothed_angle(
    angle_rad: Floats,
    strong: Bools,
    rough_rad_s: Floats,
    sure: Bools,
    rate_hz: float,
    bandwidth_hz: float,
    *,
    spread: Floats | None = None,
    free: Bools | None = None,
    turn_rad: float = np.pi,
) -> tuple[Floats, Floats, Floats]:
    """Follow angle, speed and acceleration through a recording and back.

    The acceleration is a random walk whose size sets the smoother's bandwidth.

    Arrays are of shape (n,). The measured angle is known modulo `turn_rad`, for good where that is
    0, and counts where it is `strong`; its variance is given by `spread`, in units of the best. The
    rough speed, for the lock, counts where it is `sure`. The bandwidth is slower than an electrical
    period at working speed, so that errors of sensors and inverter are not followed. Before `free`
    samples the angle may have changed by any amount: angles on both sides do not bind each other
    there, speeds and accelerations do.

    References
    ----------
    Bierman, Automatica 9, 1973: the smoother of Bryson and Frazier, which inverts nothing.
    """
    step = 1.0 / rate_hz
    variance = ANGLE_NOISE_RAD**2
    walk = variance * step * (2 * np.pi * bandwidth_hz) ** 6
    first = np.flatnonzero(sure)
    start = float(rough_rad_s[first[0]]) if first.size and first[0] < rate_hz / 10 else 0.0
    ease = np.ones(angle_rad.size) if spread is None else spread
    jumps = np.zeros(angle_rad.size, dtype=bool) if free is None else free
    rough_variance = (ROUGH_NOISE_RAD * rate_hz / 15) ** 2
    angle, speed, acceleration = _smooth(
        angle_rad, strong, rough_rad_s, sure, step, variance, rough_variance, walk, start,
        (2 * np.pi * bandwidth_hz) ** 2, ease, jumps, turn_rad,
    )  # fmt: skip
    return angle, speed, acceleration


@njit(cache=True, nogil=True)  # type: ignore[misc,unused-ignore]
def _smooth(  # type: ignore[no-untyped-def]
    measured, strong, rough, sure, step, variance, rough_variance, walk, start, spread, ease, free,
    turn,
):  # fmt: skip
    # Scalars throughout: three states are too few for matrix calls, which cost 20 times as much.
    n = measured.size
    x, p = np.empty((n, 3)), np.empty((n, 6))
    # Gains, and errors by their variance, of the rough speed and of the angle.
    g = np.zeros((n, 2, 4))
    h = step * step / 2
    q00, q01, q02 = walk * step**5 / 20, walk * step**4 / 8, walk * step**3 / 6
    q11, q12, q22 = walk * step**3 / 3, walk * step**2 / 2, walk * step
    a, v, c = measured[0], start, 0.0
    p00, p01, p02, p11, p12, p22 = 1.0, 0.0, 0.0, spread, 0.0, spread * spread
    for i in range(n):
        if i > 0:
            a, v = a + step * v + h * c, v + step * c
            m00 = p00 + step * p01 + h * p02
            m01 = p01 + step * p11 + h * p12
            m02 = p02 + step * p12 + h * p22
            m11 = p11 + step * p12
            m12 = p12 + step * p22
            # A long gap must not let the uncertainty grow until the numbers lose their digits.
            grow = 0.0 if p22 > spread * spread else 1.0
            p00 = m00 + step * m01 + h * m02 + grow * q00
            p01 = m01 + step * m02 + grow * q01
            p02 = m02 + grow * q02
            p11 = m11 + step * m12 + grow * q11
            p12 = m12 + grow * q12
            p22 = p22 + grow * q22
            if free[i]:
                p00 += FREE_RAD2
        if sure[i]:
            total = p11 + rough_variance
            k0, k1, k2 = p01 / total, p11 / total, p12 / total
            error = rough[i] - v
            g[i, 0] = k0, k1, k2, error / total
            a, v, c = a + k0 * error, v + k1 * error, c + k2 * error
            p00, p02, p22 = p00 - k0 * p01, p02 - k0 * p12, p22 - k2 * p12
            p01, p11, p12 = p01 - k0 * p11, p11 - k1 * p11, p12 - k1 * p12
        if strong[i]:
            total = p00 + variance * ease[i]
            k0, k1, k2 = p00 / total, p01 / total, p02 / total
            error = measured[i] - a
            if turn > 0:
                error -= turn * np.round(error / turn)
            g[i, 1] = k0, k1, k2, error / total
            a, v, c = a + k0 * error, v + k1 * error, c + k2 * error
            p11, p12, p22 = p11 - k1 * p01, p12 - k1 * p02, p22 - k2 * p02
            p00, p01, p02 = p00 - k0 * p00, p01 - k0 * p01, p02 - k0 * p02
        x[i] = a, v, c
        p[i] = p00, p01, p02, p11, p12, p22
    # Back from the end, with what all later measurements ask of the state.
    l0 = l1 = l2 = 0.0
    for i in range(n - 1, -1, -1):
        p00, p01, p02, p11, p12, p22 = p[i]
        x[i, 0] -= p00 * l0 + p01 * l1 + p02 * l2
        x[i, 1] -= p01 * l0 + p11 * l1 + p12 * l2
        x[i, 2] -= p02 * l0 + p12 * l1 + p22 * l2
        l0 -= g[i, 1, 3] + g[i, 1, 0] * l0 + g[i, 1, 1] * l1 + g[i, 1, 2] * l2
        l1 -= g[i, 0, 3] + g[i, 0, 0] * l0 + g[i, 0, 1] * l1 + g[i, 0, 2] * l2
        l1, l2 = l1 + step * l0, l2 + step * l1 + h * l0
    return x[:, 0].copy(), x[:, 1].copy(), x[:, 2].copy()


def averaged_angle(
    vector: NDArray[np.complex128], angle_rad: Floats, noise: float, floor: float, rate_hz: float
) -> tuple[Bools, Floats]:
    """Measure the angle of weak currents over several samples, along the followed angle, modulo pi.

    Returns which samples tell an angle, alone or averaged, and that angle modulo pi, both (n,). The
    noise is that of each of the vector's components; below the floor no vector counts.
    """
    alone = np.abs(vector) > max(STRONG * noise, floor)
    width = max(int(AVERAGE_S * rate_hz), 1) | 1
    turned_back = vector * np.exp(-1j * angle_rad)
    square = uniform_filter1d(turned_back**2, width, mode="constant")
    # Of noise alone the mean square is of this size.
    chance = noise**2 * np.sqrt(8 / width)
    together = np.abs(square) > max(UNLIKELY * chance, floor**2)
    measured = np.where(alone, np.angle(vector), angle_rad + 0.5 * np.angle(square))
    return alone | together, measured
