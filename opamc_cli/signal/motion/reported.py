"""Motions told from a joint's velocity, where the drive reports torque current only."""

from collections.abc import Iterator, Sequence
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

MOVING_SHARE = 0.3  # of the largest speed: clearly on its way
PROBE = 1 << 20

LEAST_WINDOW = 5
"""Samples of the local parabola in a slow log: three follow the angle's noise, of a motion of 40
samples five blur nothing."""

OVERSHOOT_SHARE = 0.01
"""Of the largest size: what a cubic between samples overshoots by where a modulus touches zero was
up to 0.2 % of it, of some ten samples in a recording."""

UNSIGNED_LEAVES, SIGNED_LEAVES = 0.9, 1.5
"""What the speed's growth leaves of the squares that the acceleration leaves: below and above.

Of simulated joints whose rest did not tell 0.08 to 0.80 of a modulus and 1.9 to 58 of a loaded
current; of the ball screw's, a modulus of hardly any inertia, up to 1.15.
"""

EXACT = 1e-9
"""Of the current's square: what is left is rounding."""

BLOCKS = 8
DRIVEN_T = 4.0
"""Errors over blocks of time by which a friction that drives is certain: of 37 measured joints' the
least certain friction resists by 0.6 (an arm that moves all joints), two of opposite sign drive by
8 and 20."""
DRIVEN_HZ = 100.0
"""At which a friction is told from the load: a motion has some 50 samples a stroke."""

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
    angle = np.asarray(position_rad, dtype=np.float64)
    known = np.flatnonzero(np.isfinite(angle))
    if not known.size:
        return np.full(angle.size, np.nan)
    # one missing angle would spoil every angle behind it when turns are undone
    angle = np.interp(np.arange(angle.size), known, np.unwrap(angle[known]))
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
    # A shift's worth of samples is thinned for the quantile, and probed for its noise.
    fastest = float(np.quantile(np.abs(velocity[:: 1 + velocity.size // PROBE]), 0.999))
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


def lacks_sign(current: NDArray[np.floating], velocity_rad_s: NDArray[np.floating]) -> bool | None:
    """Tell whether a current was logged without its sign.

    Parameters
    ----------
    current : array, shape (n,), A
        Reported current.
    velocity_rad_s : array, shape (n,), rad/s
        Joint velocity.

    Returns
    -------
    bool or None
        False where it has both signs, the joint does not reverse, or it accelerates or rests as
        under a load. None where the joint reverses under a current of one sign and neither tells.

    Notes
    -----
    Inertia draws current along the acceleration, its modulus along the speed's growth; a joint
    that a position loop holds against its own friction may draw as much at rest as on its way, so
    rest is asked only where the acceleration does not tell. Friction draws current either way, so
    that its modulus is larger in both directions than at rest; a constant load that outweighs
    friction adds to one direction what it takes off the other.
    """
    x = np.asarray(current, dtype=np.float64)
    v = np.asarray(velocity_rad_s, dtype=np.float64)
    known = np.isfinite(x) & np.isfinite(v)
    if not known.any() or _has_both_signs(x[known]):
        return False
    fastest = float(np.quantile(np.abs(v[known]), 0.99))
    forth, back = known & (v > MOVING_SHARE * fastest), known & (v < -MOVING_SHARE * fastest)
    if min(np.count_nonzero(part) for part in (forth, back)) < FEWEST_SAMPLES:
        return False
    growing = _grows_with_the_speed(np.abs(x), v, forth | back)
    if growing is not None:
        return growing
    rest = known & (np.abs(v) < OFF_SHARE * fastest)
    if np.count_nonzero(rest) < FEWEST_SAMPLES:
        return None
    at_rest = float(np.median(np.abs(x[rest])))
    return at_rest < min(float(np.median(np.abs(x[part]))) for part in (forth, back))


def _has_both_signs(x: NDArray[np.float64]) -> bool:
    """Tell a signed current from a modulus that resampling made overshoot at its corner."""
    lowest, highest = float(x.min()), float(x.max())
    return min(-lowest, highest) > OVERSHOOT_SHARE * max(-lowest, highest)


def _grows_with_the_speed(
    x: NDArray[np.float64], v: NDArray[np.float64], moving: NDArray[np.bool_]
) -> bool | None:
    """Tell whether a current follows the growth of the speed, not the acceleration; None: neither.

    Friction and a constant load, of either kind, are fitted beside both.
    """
    acceleration = np.gradient(v)
    way = moving & np.isfinite(acceleration)
    along = np.sign(v)
    others = np.column_stack([np.ones(x.size), along, v, np.abs(v)])[way]

    def left(inertia: NDArray[np.float64]) -> float:
        design = np.column_stack([others, inertia[way]])
        error = x[way] - design @ np.linalg.lstsq(design, x[way], rcond=None)[0]
        return float(error @ error)

    signed, growing = left(acceleration), left(acceleration * along)
    if max(signed, growing) < EXACT * float(x[way] @ x[way]):
        return None
    if growing < UNSIGNED_LEAVES * signed:
        return True
    return False if growing > SIGNED_LEAVES * signed else None


def signed_by_speed(
    current: NDArray[np.floating], velocity_rad_s: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Give a current that was logged without its sign that of the speed.

    Parameters
    ----------
    current : array, shape (n,), A
        Reported current that `lacks_sign`.
    velocity_rad_s : array, shape (n,), rad/s
        Joint velocity.

    Returns
    -------
    array, shape (n,), A
        Fading to zero where the joint stands. While it brakes it may draw current against its
        speed: there the sign is wrong.
    """
    x = np.abs(np.asarray(current, dtype=np.float64))
    v = np.asarray(velocity_rad_s, dtype=np.float64)
    slow = OFF_SHARE * float(np.nanquantile(np.abs(v), 0.99))
    return np.asarray(x * np.clip(v / max(slow, 1e-12), -1.0, 1.0))


def friction_drives(
    recordings: Sequence[tuple[NDArray[np.floating], NDArray[np.floating]]], fs_hz: float
) -> bool:
    """Tell whether a current was logged with the opposite sign of the motion.

    Parameters
    ----------
    recordings : sequence of pairs of arrays, shape (n,) each, A and rad
        Signed current and joint angle of each recording.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    bool
        True where friction, fitted beside gravity, inertia and a constant, drives the joint, by
        four times its error over eight blocks of time. False where it does not move both ways.
    """
    designs, currents = zip(*(_rigid(*one, fs_hz) for one in recordings), strict=True)
    design, x = np.concatenate(designs), np.concatenate(currents)
    v = design[:, 1]
    fastest = float(np.quantile(np.abs(v), 0.99)) if v.size else 0.0
    moving = np.flatnonzero(np.abs(v) > MOVING_SHARE * fastest)
    ways = [np.count_nonzero(way * v[moving] > 0) for way in (1, -1)]
    if min(ways) < BLOCKS * FEWEST_SAMPLES:
        return False
    usual = float(np.median(np.abs(v[moving])))
    drags = []
    for block in np.array_split(moving, BLOCKS):
        rest = np.setdiff1d(moving, block)
        dry, viscous, *_ = np.linalg.lstsq(design[rest], x[rest], rcond=None)[0]
        drags.append(dry + usual * viscous)
    # The jackknife's error: each is of seven blocks of eight.
    error = float(np.std(drags)) * float(np.sqrt(BLOCKS - 1))
    return float(np.mean(drags)) < -DRIVEN_T * error


def _rigid(
    current: NDArray[np.floating], position_rad: NDArray[np.floating], fs_hz: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Regressors of a rigid joint, (m, 6), friction's first, and its current, (m,), averaged."""
    every = max(int(fs_hz // DRIVEN_HZ), 1)
    v = velocity_from_position(position_rad, fs_hz)
    used = v.size // every * every
    logged = np.stack([current, position_rad, v, np.gradient(v)])[:, :used]
    x, q, v, a = logged.reshape(4, -1, every).mean(axis=2)
    design = np.column_stack([np.sign(v), v, a, np.cos(q), np.sin(q), np.ones(v.size)])
    known = np.isfinite(x) & np.isfinite(design).all(axis=1)
    return design[known], x[known]
