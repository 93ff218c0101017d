"""Motions told from a joint's velocity, where the drive reports torque current only."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyfit, polyval
from numpy.typing import NDArray

from opamc_cli.signal.motion.noise import noise_level
from opamc_cli.signal.motion.segmentation import hysteresis

ON_SHARE = 0.05  # of the largest speed
OFF_SHARE = 0.02
SETTLING_SHARE = 0.02
"""Of the way of a motion: what swings back by less at once after it is its settling, which is there
in one recording and not in the next."""

PROBE = 1 << 20

LEAST_WINDOW = 5
"""Samples of the local parabola in a slow log: three follow the angle's noise, of a motion of 40
samples five blur nothing."""

FEWEST_SAMPLES = 10
"""Of a motion: at the slowest log's 10 Hz a second."""


@dataclass(frozen=True)
class JointMotion:
    """A motion told from velocity."""

    start: int
    stop: int
    """With `start`: samples, half-open."""
    direction: int
    """Sign of the velocity, 1 or -1."""
    speed_rad_s: float
    """Largest speed of the joint that lasted, rad/s."""


def unwrapped(position_rad: NDArray[np.floating]) -> NDArray[np.float64]:
    """Undo an angle's jumps by a whole turn.

    Parameters
    ----------
    position_rad : array, shape (n,), rad
        Joint angle; NaN where unknown.

    Returns
    -------
    array, shape (n,), rad
        The same to the last digit where nothing jumps.
    """
    angle = np.array(position_rad, dtype=np.float64)
    # one missing angle would spoil every angle behind it
    known = np.isfinite(angle)
    angle[known] = np.unwrap(angle[known])
    return angle


def velocity_from_position(
    position_rad: NDArray[np.floating], fs_hz: float, window_s: float = 0.05
) -> NDArray[np.float64]:
    """Velocity from position by local parabolas, since differences of quantised angles are noise.

    Parameters
    ----------
    position_rad : array, shape (n,), rad
        Joint angle; jumps by a whole turn are undone.
    fs_hz : float
        Sampling rate, Hz.
    window_s : float
        Length of the local fit, s.

    Returns
    -------
    array, shape (n,), rad/s
        Zero for fewer than three samples, NaN if no angle is known.

    Notes
    -----
    Savitzky and Golay, 1964. Edge rule: the first and the last parabola are evaluated up to the
    ends. NaN rule: missing angles are bridged by a straight line.
    """
    angle = unwrapped(position_rad)
    known = np.flatnonzero(np.isfinite(angle))
    if not known.size:
        return np.full(angle.size, np.nan)
    angle = np.interp(np.arange(angle.size), known, angle[known])
    wanted = max(LEAST_WINDOW, round(window_s * fs_hz) | 1)
    window = min(wanted, angle.size - 1 + angle.size % 2)
    if window < 3:
        return np.zeros(angle.size)
    # As `scipy.signal.savgol_filter`, whose package takes as long to load as all else together.
    half = window // 2
    places = np.arange(-half, half + 1) / fs_hz
    velocity: NDArray[np.float64] = np.convolve(angle, -places / (places @ places), "same")
    first, last = (polyder(polyfit(places, part, 2)) for part in (angle[:window], angle[-window:]))
    velocity[:half] = polyval(places[:half], first)
    velocity[-half:] = polyval(places[-half:], last)
    return velocity


SLOWEST_WINDOW_S = 0.2
"""Longest local parabola. With 0.4 s slow programs gain nothing, but the settling of a positioning
drive becomes a motion of its own."""


def quiet_velocity(position_rad: NDArray[np.floating], fs_hz: float) -> NDArray[np.float64]:
    """Velocity whose noise does not hide the slow parts of a motion.

    Parameters
    ----------
    position_rad : array, shape (n,), rad
        Joint angle.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    array, shape (n,), rad/s
        As `velocity_from_position`, its window doubled from 0.05 s until four standard deviations
        of the noise are below what counts as standstill, or to `SLOWEST_WINDOW_S`. Otherwise a
        slow part of a program is a motion in one recording and none in the next.
    """
    window_s = 0.05
    while True:
        velocity = velocity_from_position(position_rad, fs_hz, window_s)
        probe = np.nan_to_num(_probe(velocity))
        if not probe.size or window_s >= SLOWEST_WINDOW_S:
            return velocity
        fastest = float(np.quantile(np.abs(probe), 0.999))
        if 4 * noise_level(probe) <= OFF_SHARE * fastest:
            return velocity
        window_s *= 2


def hides_motions(velocity_rad_s: NDArray[np.floating]) -> bool:
    """Whether the noise of a logged speed, (n,), is above what a motion of its joint reaches.

    Of 38 logs' speeds four standard deviations are 1.5 % of the largest speed at most, but for
    those of a direct drive (6 %), a humanoid's joint and three screws and eccentrics (9 to 76 %):
    of these a logged position tells 39 motions where the speeds tell 27.
    """
    velocity = np.nan_to_num(np.asarray(velocity_rad_s, dtype=np.float64))
    if not velocity.size:
        return False
    return 4 * noise_level(_probe(velocity)) > ON_SHARE * _fastest(velocity)


def find_joint_motions(
    velocity_rad_s: NDArray[np.floating],
    fs_hz: float,
    min_motion_s: float,
    min_still_s: float,
    min_speed_rad_s: float = 0.01,
) -> list[JointMotion]:
    """Motions of a joint from its velocity, by hysteresis on each sign by itself.

    A motion reaches 5 % of the largest speed of the recording and lasts while the speed stays
    above 2 % of it, or above four standard deviations of the velocity's noise if that is more. What
    follows it before a standstill and goes 2 % of its way at most is its settling, and no motion.

    Parameters
    ----------
    velocity_rad_s : array, shape (n,), rad/s
        Joint velocity; NaN counts as standstill.
    fs_hz : float
        Sampling rate, Hz.
    min_motion_s, min_still_s : float
        Shorter motions, and those of fewer than `FEWEST_SAMPLES`, are dropped; shorter
        standstills between motions of the same direction bridged, s.
    min_speed_rad_s : float
        A joint that never reaches this speed stands still: what is left is its controller's
        quiver, rad/s.

    Returns
    -------
    list of JointMotion
        In order, not overlapping.
    """
    velocity = np.nan_to_num(np.asarray(velocity_rad_s, dtype=np.float64))
    if not velocity.size:
        return []
    fastest = _fastest(velocity)
    if fastest < min_speed_rad_s:
        return []
    off = max(OFF_SHARE * fastest, 4 * noise_level(_probe(velocity)))
    on = max(ON_SHARE * fastest, 2 * off)
    signed = sorted(
        (start, stop, sign)
        for sign in (1, -1)
        for start, stop in hysteresis(sign * velocity, on, off)
    )
    joined: list[tuple[int, int, int]] = []
    for start, stop, sign in signed:
        if joined and sign == joined[-1][2] and start - joined[-1][1] < min_still_s * fs_hz:
            joined[-1] = (joined[-1][0], stop, sign)
        else:
            joined.append((start, stop, sign))
    return [
        JointMotion(a, b, sign, float(np.quantile(np.abs(velocity[a:b]), 0.99)))
        for a, b, sign in _without_settling(joined, velocity, min_still_s * fs_hz)
        if b - a >= max(min_motion_s * fs_hz, FEWEST_SAMPLES)
    ]


def _without_settling(
    swings: list[tuple[int, int, int]], velocity: NDArray[np.float64], still: float
) -> Iterator[tuple[int, int, int]]:
    way = last = 0.0
    for start, stop, sign in swings:
        own = float(np.abs(velocity[start:stop]).sum())
        if start - last >= still or own > SETTLING_SHARE * way:
            way = own
            yield start, stop, sign
        last = stop


def _fastest(velocity: NDArray[np.float64]) -> float:
    # A shift's worth of samples is thinned for the quantile, and probed for its noise.
    return float(np.quantile(np.abs(velocity[:: 1 + velocity.size // PROBE]), 0.999))


def _probe(velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Four stretches spread over a long series, or the whole of a short one."""
    if velocity.size <= PROBE:
        return velocity
    starts = np.linspace(0, velocity.size - PROBE // 4, 4).astype(int)
    return np.concatenate([velocity[start : start + PROBE // 4] for start in starts])


def motor_frequency(speed_rad_s: float, gear_ratio: float | None, pole_pairs: int | None) -> float:
    """Frequency that takes the carrier's place for a reported current, Hz.

    Parameters
    ----------
    speed_rad_s : float
        Joint speed, rad/s.
    gear_ratio, pole_pairs : number or None
        Of the joint. With both, the result is the electrical frequency; without pole pairs, the
        motor's revolutions; with neither, the joint's own revolutions per second.

    Returns
    -------
    float
        Hz.
    """
    return speed_rad_s / (2 * np.pi) * (gear_ratio or 1.0) * (pole_pairs or 1)


def fluctuation_frequency(current: NDArray[np.floating], fs_hz: float) -> float:
    """Frequency of a current's own fluctuations, where no carrier tells how fast they are.

    Parameters
    ----------
    current : array, shape (n,)
        Envelope of one motion; NaN is bridged by a straight line.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    float
        Hz, at most a quarter of the sampling rate: the first zero of the autocorrelation, its
        straight line taken off before, is a quarter of the period.
    """
    x = np.asarray(current, dtype=np.float64)
    known = np.flatnonzero(np.isfinite(x))
    if known.size < FEWEST_SAMPLES:
        return fs_hz / 4
    place = np.arange(x.size)
    x = np.interp(place, known, x[known])
    x = x - np.polynomial.Polynomial.fit(place, x, 1)(place)
    size = 1 << (2 * x.size - 1).bit_length()
    correlation = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[: x.size // 2]
    below = np.flatnonzero(correlation <= 0)
    quarter = int(below[0]) if below.size else x.size // 2
    return fs_hz / (4 * max(quarter, 1))
