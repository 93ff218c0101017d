"""Sign and unit of what was logged: of a current by the motion, of a speed by the position."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion.reported import FEWEST_SAMPLES, OFF_SHARE, velocity_from_position

MOVING_SHARE = 0.3  # of the largest speed: clearly on its way

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
"""Errors over blocks of time by which a friction that drives is certain: of 52 measured joints
four, of opposite sign, drive by 8 to 389; the least certain other one, of an arm, by 0.3."""
DRIVEN_HZ = 100.0
"""At which a friction is told from the load: a motion has some 50 samples a stroke."""
RATIO_BLOCK_S = 0.1
FEWEST_BLOCKS = 20
SAME_MOTION, UNRELATED = 0.98, 0.3
"""Correlation of a logged speed with the rate of change of a logged position, from which they are
one motion, and up to which they are two. Between, one of them may be late or filtered."""
LEAST_SPEED_RAD_S = 0.01
"""Root mean square below which either is noise about a standstill."""


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
        False where it has both signs, the joint does not reverse, it never comes near zero, or it
        accelerates or rests as under a load. None where the joint reverses under a current of one
        sign and neither tells.

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
    if _keeps_off_zero(np.abs(x), forth.astype(int) - back):
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


def _keeps_off_zero(size: NDArray[np.float64], way: NDArray[np.int_]) -> bool:
    """Tell whether to change its sign a current had to step farther than it ever does.

    Of 576 signed currents of an arm's simulator, at 25 to 500 Hz, twice the smallest size was 0.2
    of the largest step of their modulus at most; of 126 under a load that outweighs all else, 0.67
    to 5.6. Friction may take such a load near zero once; a modulus comes there wherever the joint
    turns: half of the times within 0.65 steps (130 files of a screw, 25 Hz; 0.01 at 60 to 125 Hz),
    three loaded joints of two arms within 1.07 to 7.
    """
    step = float(np.nanmax(np.abs(np.diff(size)), initial=0.0))
    moving = np.flatnonzero(way)
    turns = np.flatnonzero(np.diff(way[moving]))
    at_turns = [np.nanmin(size[moving[k] : moving[k + 1] + 1]) for k in turns]
    return 2.0 * float(np.nanmin(size)) > step or float(np.median(at_turns)) > step


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
    x, q, v, a = logged.reshape(4, used // every, every).mean(axis=2)
    design = np.column_stack([np.sign(v), v, a, np.cos(q), np.sin(q), np.ones(v.size)])
    known = np.isfinite(x) & np.isfinite(design).all(axis=1)
    return design[known], x[known]


def speed_ratio(
    position_rad: NDArray[np.floating], velocity_rad_s: NDArray[np.floating], rate_hz: float
) -> float | None:
    """How many times the rate of change of a logged position a logged speed is, both (n,).

    1 where the units agree; None where the two do not tell, or have nothing to do with one another.
    """
    power, both, other = _squares(position_rad, velocity_rad_s, rate_hz)
    if power <= 0 or both**2 < SAME_MOTION**2 * power * other:
        return None
    return both / power


def another_motion(
    position_rad: NDArray[np.floating], velocity_rad_s: NDArray[np.floating], rate_hz: float
) -> bool:
    """Whether a position and a speed, both (n,), both move and hardly ever in time."""
    power, both, other = _squares(position_rad, velocity_rad_s, rate_hz)
    return min(power, other) > LEAST_SPEED_RAD_S**2 and both**2 < UNRELATED**2 * power * other


def _squares(
    position_rad: NDArray[np.floating], velocity_rad_s: NDArray[np.floating], rate_hz: float
) -> tuple[float, float, float]:
    """Mean squares of a position's rate of change, of it times a speed, of the speed; in blocks."""
    length = max(int(RATIO_BLOCK_S * rate_hz), 1)
    edges = np.arange(0, position_rad.size, length)
    if edges.size < FEWEST_BLOCKS:
        return 0.0, 0.0, 0.0
    change = np.diff(position_rad[edges]) * rate_hz / length
    sums = np.concatenate([[0.0], np.cumsum(velocity_rad_s)])
    speed = np.diff(sums[edges]) / length
    good = np.isfinite(change) & np.isfinite(speed)
    change, speed = change[good], speed[good]
    count = max(change.size, 1)
    return (
        float(change @ change) / count,
        float(change @ speed) / count,
        float(speed @ speed) / count,
    )
