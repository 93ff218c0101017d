"""What the basic parts of a joint leave of its current, beside another motion than the logged one.

Friction, inertia, gravity and a constant are fitted by least squares, in milliseconds: far too
little for a model of the joint, and enough to tell that current and motion are not of one joint, of
one clock or in one unit.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion.reported import LEAST_WINDOW, velocity_from_position

Floats = NDArray[np.float64]

FIT_HZ = 100.0
"""At which the parts are told apart: a motion has some 50 samples a stroke."""
WINDOW_S = 0.05
"""Over which an angle is differentiated."""
FEWEST_ROWS = 200
"""Two seconds, or four strokes."""
MOST_ROWS = 5000
"""Evenly taken of a longer recording: eight coefficients need no more."""
SAME = 3e-4
"""Of the largest singular value: what differs by less is the same regressor."""
FOLLOWS, RUBS_NOT = 0.8, 0.02
"""Share of what gravity and inertia of all joints leave that another joint's friction takes, at the
least, and this joint's own, at the most, where the two are of one joint: only its own motion rubs
in a joint. Of exchanged ones another's took 0.97 to 0.99."""
SLOWER = 0.1
"""Times as fast that the slower of the two is at the least: what a joint that is held draws goes
with the direction of one that it carries, by 0.66 in a Kinova's log."""

STRETCHES = 4
LONGEST_LAG_S = 2.0
"""Delays up to here are looked for."""
DRIFTED_S, LATE_S = 0.015, 0.1
"""Delays from which clocks differ, and a joint's motion is logged late: 15 ms is a sample and a
half of the fit, and `time_delay` begins to look for less than 64 ms. Of 308 right recordings of ten
sources none has either."""
SHARPLY = 0.5
"""Share of the square that another delay leaves, where there is one."""

LARGER, OTHER_SCALE = 3.0, 0.2
"""Times by which another scale of the angle is larger or smaller, as far as it is asked, and share
of the square that it leaves where it is right."""
MOVING_SHARE = 0.15
"""Of the largest speed: slower, dry friction tells nothing of gravity."""
LARGEST_SCALE, SCALES = 400.0, 61
MOST_TRAVEL_RAD, FASTEST_RAD_S = 4 * np.pi, 60.0
"""Of a joint in another scale: robots' joints turn by one revolution either way, and see
`quality.LIMITS`."""


def parts(position_rad: Floats, fs_hz: float) -> tuple[Floats, Floats, Floats]:
    """Return friction's, inertia's and gravity's regressors, (m, 2), (m, 1), (m, 3), at 100 Hz."""
    every = max(int(fs_hz // FIT_HZ), 1)
    v = velocity_from_position(position_rad, fs_hz, WINDOW_S)
    used = v.size // every * every
    logged = np.stack([position_rad, v, np.gradient(v)])[:, :used]
    q, v, a = logged.reshape(3, used // every, every).mean(axis=2)
    slow = 0.02 * float(np.nanquantile(np.abs(v), 0.99)) if v.size else 0.0
    friction = np.column_stack([np.clip(v / max(slow, 1e-12), -1.0, 1.0), v])
    return friction, a[:, None], np.column_stack([np.cos(q), np.sin(q), q])


def averaged(current: Floats, fs_hz: float) -> Floats:
    """Return a current, (n,), at the rate of `parts`, (m,), as smooth as the speed.

    Else corners are left.
    """
    half = max(LEAST_WINDOW, round(WINDOW_S * fs_hz) | 1) // 2
    weights = 1.0 - (np.arange(-half, half + 1) / (half + 1)) ** 2  # Of a parabola's slope.
    current = np.convolve(np.pad(current, half, mode="edge"), weights / weights.sum(), "valid")
    every = max(int(fs_hz // FIT_HZ), 1)
    used = current.size // every * every
    return np.asarray(current[:used].reshape(-1, every).mean(axis=1))


def left(x: Floats, *regressors: Floats, constant: bool = True) -> float:
    """Return what is left of the mean square of a current, (m,), in its unit squared.

    Beside regressors, (m, k) or (m,), and a constant; NaN where fewer than FEWEST_ROWS are known.
    """
    design = np.column_stack([np.ones(x.size)] * constant + list(regressors))
    known = np.isfinite(x) & np.isfinite(design).all(axis=1)
    if np.count_nonzero(known) < FEWEST_ROWS:
        return np.nan
    every = np.count_nonzero(known) // MOST_ROWS + 1
    design, x = design[known][::every], x[known][::every]
    scale = np.linalg.norm(design, axis=0)
    design = design / np.where(scale > 0, scale, 1.0)
    error = x - design @ np.linalg.lstsq(design, x, rcond=SAME)[0]
    return float(error @ error) / x.size


def follows(
    current: Floats, positions: Mapping[int, Floats], axis: int, fs_hz: float
) -> int | None:
    """Tell which other joint's motion the friction in a current is of.

    Parameters
    ----------
    current : array, shape (n,), A
        Signed current of a joint.
    positions : dict of int to array, shape (n,), rad
        Joint angles by axis, its own among them.
    axis : int
        Its own axis.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    int or None
        None where it is its own, or nobody's. Gravity and inertia of all joints are fitted beside:
        a joint carries and moves others, too.
    """
    x = averaged(current, fs_hz)
    of = {other: parts(position, fs_hz) for other, position in positions.items()}
    load = [one for _, inertia, gravity in of.values() for one in (inertia, gravity)]
    rest = left(x, *load)
    # Rounding alone is nobody's.
    if not rest > 1e-9 * float(np.nanvar(x)):
        return None
    rubbing = {other: friction for other, (friction, *_) in of.items()}
    speed = {other: float(np.nanstd(friction[:, 1])) for other, friction in rubbing.items()}
    near = [other for other in of if SLOWER < speed[other] / max(speed[axis], 1e-9) < 1 / SLOWER]
    taken = {other: 1.0 - left(x, *load, rubbing[other]) / rest for other in {axis, *near}}
    best = max(taken, key=lambda other: taken[other])
    return best if taken[best] > FOLLOWS and taken[axis] < RUBS_NOT else None


def lags(current: Floats, position_rad: Floats, fs_hz: float) -> list[float] | None:
    """Tell by how much a current's clock differs from that of the motion, at four times.

    Parameters
    ----------
    current, position_rad : array, shape (n,)
        Signed current of a joint, A or Nm, and its angle.
    fs_hz : float
        Sampling rate.

    Returns
    -------
    list of float, s, or None
        By which the position is logged later than the current, in each of four stretches of equal
        motion. None where the two clocks are one, the basic parts tell no delay, or the shortest
        delay that can be told is less than `DRIFTED_S`.
    """
    x = averaged(current, fs_hz)
    friction, inertia, gravity = parts(position_rad, fs_hz)
    design = np.column_stack([np.ones(x.size), friction, inertia, gravity])
    known = np.isfinite(x) & np.isfinite(design).all(axis=1)
    moving = known & (np.abs(friction[:, 0]) >= 1)  # What dry friction holds at rest is anything.
    rate = fs_hz / max(int(fs_hz // FIT_HZ), 1)
    reach = int(LONGEST_LAG_S * rate)
    way = np.cumsum(np.where(known, np.abs(friction[:, 0]), 0.0))
    if x.size < STRETCHES * FEWEST_ROWS + 2 * reach or way[-1] <= 0:
        return None
    x = np.interp(np.arange(x.size), np.flatnonzero(known), x[known])
    edges = np.searchsorted(way, np.linspace(0, way[-1], STRETCHES + 1)[1:-1])
    found, tried = [], []
    for stretch in np.split(np.arange(x.size), edges):
        inside = stretch[moving[stretch] & (stretch >= reach) & (stretch < x.size - reach)]
        if inside.size < FEWEST_ROWS:
            return None
        inside = inside[:: inside.size // MOST_ROWS + 1]
        ways, sizes, _ = np.linalg.svd(
            design[inside] / np.maximum(np.linalg.norm(design[inside], axis=0), 1e-12),
            full_matrices=False,
        )
        ways = ways[:, sizes > SAME * sizes[0]]
        shifted = x[inside[:, None] - np.arange(-reach, reach + 1)]
        left_over = (shifted**2).sum(axis=0) - ((ways.T @ shifted) ** 2).sum(axis=0)
        # A current that stands still for a while leaves nothing, at whatever delay.
        power = np.maximum(shifted.var(axis=0), 1e-12) * inside.size
        shares = np.maximum(left_over / power, 1e-12)
        best = int(np.argmin(shares))
        if best in (0, 2 * reach):
            return None
        below, at, above = shares[best - 1 : best + 2]
        bend = below - 2 * at + above
        finer = 0.5 * (below - above) / bend if bend > 0 else 0.0
        found.append(float(best - reach + finer) / rate)
        tried.append(shares)
    return _certain(found, tried, reach, rate)


def _certain(
    found: list[float], tried: Sequence[Floats], reach: int, rate: float
) -> list[float] | None:
    """Return delays that are there, all in all or in one stretch beside another."""
    spread = max(found) - min(found)
    together = float(np.min(np.mean([one / one.min() for one in tried], axis=0)))
    steps = np.diff(found)
    if spread > max(DRIFTED_S, 1.5 / rate) and (steps > 0).all() | (steps < 0).all():
        return found if together > 1.0 / SHARPLY else None
    late = abs(float(np.median(found))) > max(LATE_S, 1.5 / rate) and spread < LATE_S / 4
    gained = all(one.min() < SHARPLY * one[reach] for one in tried)
    return found if late and gained else None


def other_scale(current: Floats, position_rad: Floats, fs_hz: float) -> float | None:
    """Tell how many times as large an angle is by the gravity in a current.

    Parameters
    ----------
    current, position_rad, fs_hz
        As of `lags`.

    Returns
    -------
    float or None
        None where the angle's own scale tells as much, to a fifth of the square left, or no robot's
        joint turned as far or as fast in the other.
    """
    x = averaged(current, fs_hz)
    friction, inertia, gravity = parts(position_rad, fs_hz)
    q = gravity[:, 2]
    speeds = np.abs(friction[:, 1])
    if not np.isfinite(speeds).any() or not np.isfinite(x).any():
        return None
    x = np.where(speeds > MOVING_SHARE * np.nanmax(speeds, initial=0.0), x, np.nan)
    travel, speed = float(np.ptp(q[np.isfinite(q)])), float(np.nanmax(speeds))
    scales = np.geomspace(LARGER, LARGEST_SCALE, SCALES)
    scales = np.concatenate([1.0 / scales[::-1], scales])
    possible = (scales * travel < MOST_TRAVEL_RAD) & (scales * speed < FASTEST_RAD_S)

    def told(k: float, beside: Sequence[Floats]) -> float:
        return left(x, friction, inertia, np.cos(k * q), np.sin(k * q), *beside, constant=False)

    # Of a wide angle that is taken for a narrower one the waves are a constant and a line, which a
    # joint may have. Of a narrow one they hold what a wider one's hold, but for a constant.
    best, scale = np.inf, 1.0
    for larger, beside in ((True, ()), (False, (q, np.ones(q.size)))):
        own = told(1.0, beside)
        for k in scales[possible & ((scales > 1.0) == larger)].tolist():
            share = told(k, beside) / own if own > 1e-9 * float(np.nanvar(x)) else np.inf
            best, scale = min((best, scale), (share, k))
    return scale if best < OTHER_SCALE else None
