"""The current along the torque axis, and on which side of that axis it lies."""

import numpy as np

from opamc_cli.joint.motion.phases.half_turns import stretches
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.track import Floats
from opamc_cli.signal.plausible.sensor_errors import current_vector
from opamc_cli.signal.transform.least_squares import solve

SIDE_ROUNDS = 8
CLEARLY = 0.1
"""Share of its squared error that a stroke may keep when it is turned: where it keeps more, the
model lacks something. At 0.3 five of seven joints' hysteresis turned strokes; 0.05 does as 0.1."""

SLOWEST_SHARE = 0.05
"""Of the top speed: slower, friction has no certain direction."""


def torque_current(
    phases_a: Floats, electrical_rad: Floats, velocity: Floats, position_rad: Floats
) -> Floats:
    """Take the current of phases, (n, 3), along the electrical angle of the torque axis.

    The sign is taken so that friction resists: of the torque, what depends on the direction and the
    speed, beside a smooth function of the position, does work. The whole torque need not, where
    gravity is large and the path is not closed. Speed and position may be in any unit.
    """
    torque: Floats = (current_vector(phases_a) * np.exp(-1j * electrical_rad)).real
    speeds = np.abs(velocity)
    moving = speeds > SLOWEST_SHARE * float(np.quantile(speeds, 0.98))
    columns = _columns(velocity, position_rad)[moving]
    friction = columns[:, :2] @ solve(columns.T @ columns, columns.T @ torque[moving])[:2]
    return torque if float(np.dot(friction, velocity[moving])) >= 0 else -torque


def _columns(velocity: Floats, position: Floats, *others: Floats) -> Floats:
    """Dry and lubricant friction, others, and powers of the place for whatever holds it there."""
    place = position / max(float(np.ptp(position)), 1e-9) * 2
    place = place - place.mean()
    return np.stack([np.sign(velocity), velocity, *others, *(place**k for k in range(4))], axis=1)


def side_of_torque(torque_a: Floats, angle: PhaseAngle, rate_hz: float) -> Floats:
    """Find on which side of the torque axis every stretch of current lies: +1 or -1, (n,).

    Between stretches, with too little current to be followed, the angle may slip by pi. Of what is
    reached from the sides on which the current does work, and from those as followed, in two
    orders, the one that fits best to friction, inertia and a smooth function of the position is
    taken. At rest zero errors of the sensors turn a small current: then strokes are turned where
    that is clear.
    """
    pieces = stretches(angle.strong, rate_hz)
    if not pieces:
        return np.ones(torque_a.size)
    speed = angle.velocity_rad_s
    slowest = SLOWEST_SHARE * float(np.quantile(np.abs(speed), 0.98))
    moving = angle.strong & (np.abs(speed) > slowest)
    columns = _columns(speed, angle.angle_rad, angle.acceleration_rad_s2)
    columns /= np.sqrt(np.mean(columns**2, axis=0)) + 1e-300

    def sums(parts: list[tuple[int, int]]) -> tuple[Floats, Floats, Floats]:
        rows = [np.flatnonzero(moving[start:stop]) + start for start, stop in parts]
        gram = np.array([columns[part].T @ columns[part] for part in rows])
        moment = np.array([columns[part].T @ torque_a[part] for part in rows])
        return gram, moment, np.array([float(np.sum(torque_a[part] ** 2)) for part in rows])

    found = sums(pieces)
    starts = (np.where(found[1][:, 0] >= 0, 1.0, -1.0), np.ones(len(pieces)))
    tried = [_turned(start, *found, order=order) for start in starts for order in (-1, 0)]
    _, signs, resists = max(tried, key=lambda one: one[0])
    side = np.ones(torque_a.size)
    for (start, _), sign in zip(pieces, signs, strict=True):
        side[start:] = sign
    strokes = [
        (a + first, a + last) for a, b in pieces for first, last in stretches(moving[a:b], rate_hz)
    ]
    if strokes:
        _, signs, resists = _turned(side[[a for a, _ in strokes]], *sums(strokes), share=CLEARLY)
        for (start, stop), sign in zip(strokes, signs, strict=True):
            side[start:stop] = sign
    return side if resists else -side


def _turned(
    signs: Floats, gram: Floats, moment: Floats, power: Floats, share: float = 1.0, order: int = -1
) -> tuple[float, Floats, bool]:
    """Turn one stretch after the other while its squared error falls below a share of what it was.

    In order of their power, the strongest first by -1: what they ask of the weak is surer; by 0 in
    time. Also says how much is explained, and whether friction resists: of two mirror images it
    does in one.
    """
    signs = signs.copy()
    total = gram.sum(axis=0)
    for _ in range(SIDE_ROUNDS):
        before = signs.copy()
        for k in np.argsort(order * power, kind="stable"):
            coefficients = solve(total - gram[k], signs @ moment - signs[k] * moment[k])
            model = power[k] + float(coefficients @ gram[k] @ coefficients)
            product = 2.0 * signs[k] * float(coefficients @ moment[k])
            if model + product < share * (model - product):
                signs[k] = -signs[k]
        if np.array_equal(signs, before):
            break
    joint = signs @ moment
    coefficients = solve(total, joint)
    # All that depends on the speed's direction does work against the speed, the second column:
    # friction that grows with the square has a dry part below zero.
    resists = float(coefficients[:2] @ total[:2, 1]) >= 0
    return float(coefficients @ joint), signs, resists
