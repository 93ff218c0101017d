"""The current along the torque axis, and on which side of that axis it lies."""

import numpy as np

from opamc_cli.joint.least_squares import solve
from opamc_cli.joint.motion.phases.following import current_vector
from opamc_cli.joint.motion.phases.half_turns import stretches
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.track import Floats

SIDE_ROUNDS = 8
SLOWEST_SHARE = 0.05
"""Of the top speed: slower, friction has no certain direction."""


def torque_current(
    phases_a: Floats, electrical_rad: Floats, velocity: Floats, position_rad: Floats
) -> tuple[Floats, Floats]:
    """Split the current along and across the electrical angle.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Phase currents.
    electrical_rad : array of shape (n,)
        Electrical angle of the torque axis.
    velocity, position_rad : array of shape (n,)
        Of the motion, in any unit. The sign is taken so that friction resists: of the torque, what
        depends on the direction and the speed, beside a smooth function of the position, does
        work. The whole torque need not, where gravity is large and the path is not closed.

    Returns
    -------
    torque_a, flux_a : arrays of shape (n,)
    """
    rotated = current_vector(phases_a) * np.exp(-1j * electrical_rad)
    torque = rotated.real
    speeds = np.abs(velocity)
    moving = speeds > SLOWEST_SHARE * float(np.quantile(speeds, 0.98))
    columns = np.concatenate([_frictions(velocity), _powers(position_rad)], axis=1)[moving]
    friction = _frictions(velocity)[moving] @ _fitted(columns, torque[moving])[:2]
    side = 1.0 if float(np.dot(friction, velocity[moving])) >= 0 else -1.0
    return side * torque, side * rotated.imag


def _frictions(velocity: Floats) -> Floats:
    """Dry and lubricant friction."""
    return np.stack([np.sign(velocity), velocity], axis=1)


def _powers(position: Floats) -> Floats:
    """Lowest powers of the position, for whatever holds the joint in place."""
    place = position / max(float(np.ptp(position)), 1e-9) * 2
    place = place - place.mean()
    return np.stack([place**k for k in range(4)], axis=1)


def _fitted(columns: Floats, values: Floats) -> Floats:
    """Least squares, whatever the columns' units are."""
    scale = np.sqrt(np.mean(columns**2, axis=0)) if columns.size else np.ones(columns.shape[1])
    scaled = columns / (scale + 1e-300)
    return solve(scaled.T @ scaled, scaled.T @ values) / (scale + 1e-300)


def side_of_torque(torque_a: Floats, angle: PhaseAngle, rate_hz: float) -> Floats:
    """Find on which side of the torque axis every stretch of current lies.

    Between stretches, where the current is too small to be followed, the angle may slip by pi.
    The sides are those that fit best to dry and lubricant friction, inertia and a smooth function
    of the position: starting from the sides on which the current does work, and from those as
    followed, one stretch after the other is turned where that lowers the squared error.

    Parameters
    ----------
    torque_a : array of shape (n,)
        Current along the followed angle.
    angle : PhaseAngle
        The followed angle.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    array of shape (n,)
        +1 or -1.
    """
    pieces = stretches(angle.strong, rate_hz)
    if not pieces:
        return np.ones(torque_a.size)
    speed = angle.velocity_rad_s
    slowest = SLOWEST_SHARE * float(np.quantile(np.abs(speed), 0.98))
    moving = angle.strong & (np.abs(speed) > slowest)
    inertia = angle.acceleration_rad_s2[:, None]
    columns = np.concatenate([_frictions(speed), inertia, _powers(angle.angle_rad)], axis=1)
    columns /= np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    sides = []
    grams, moments = [], []
    for start, stop in pieces:
        rows = slice(start, stop)
        part = columns[rows][moving[rows]]
        values = torque_a[rows][moving[rows]]
        work = float(np.dot(values, part[:, 0])) if values.size else 0.0
        sides.append(1.0 if work >= 0 else -1.0)
        grams.append(part.T @ part)
        moments.append(part.T @ values)
    gram, moment = np.array(grams), np.array(moments)
    starts = (np.array(sides), np.ones(len(sides)))
    signs = max((_turned(start, gram, moment) for start in starts), key=lambda found: found[0])[1]
    side = np.ones(torque_a.size)
    for (start, _), sign in zip(pieces, signs, strict=True):
        side[start:] = sign
    return side


def _turned(signs: Floats, gram: Floats, moment: Floats) -> tuple[float, Floats]:
    """Turn one stretch after the other while that explains more; also how much is explained."""
    signs = signs.copy()
    total = gram.sum(axis=0)
    for _ in range(SIDE_ROUNDS):
        turned = False
        for k in range(signs.size):
            coefficients = solve(total - gram[k], signs @ moment - signs[k] * moment[k])
            better = 1.0 if float(coefficients @ moment[k]) >= 0 else -1.0
            turned |= better != signs[k]
            signs[k] = better
        if not turned:
            break
    joint = signs @ moment
    explained = float(solve(total, joint) @ joint)
    # Friction resists: of two mirror images only one has it positive.
    return explained, signs if solve(total, joint)[0] >= 0 else -signs
