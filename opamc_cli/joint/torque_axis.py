"""The current along the torque axis, and on which side of that axis it lies."""

import numpy as np

from opamc_cli.joint.half_turns import stretches
from opamc_cli.joint.normal import solve
from opamc_cli.joint.phase_angle import PhaseAngle
from opamc_cli.joint.phases import current_vector
from opamc_cli.joint.track import Floats

SIDE_ROUNDS = 8


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
    moving = angle.strong & (np.abs(speed) > 0.05 * float(np.quantile(np.abs(speed), 0.98)))
    place = angle.angle_rad / max(float(np.ptp(angle.angle_rad)), 1e-9) * 2
    place = place - place.mean()
    columns = np.stack(
        [np.sign(speed), speed, angle.acceleration_rad_s2, *(place**k for k in range(4))], axis=1
    )
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
