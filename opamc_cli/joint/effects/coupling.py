"""What another joint's motion asks of this one."""

import numpy as np

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.kinematics import SLOWEST_SHARE
from opamc_cli.joint.motion.track import Floats, Ints, Track

ONE = (
    (0,),  # a far or light link
    (0, 1, 2, 3, 4),  # the outer link of an elbow,
    (0, 5, 6),  # or the inner one,
    (0, 13, 14),  # whose axis is opposed
    (7, 8),  # a link that lifts, of a joint that stands upright
    (9, 10),  # a slow link on an axis that is parallel,
    (11, 12),  # or opposed
)
TWO = (
    *((place, place + 1) for place in (0, 2, 4, 6)),  # a slow third link
    *(tuple(range(place, place + 4)) for place in (8, 12)),  # both lift, of an upright joint
    tuple(range(8)),  # a slow link on axes that are not parallel
    # A chain of three on parallel axes: of its first joint, its second and its third.
    *((n, n + 1, n + 16, n + 17, 32, 33) for n in (0, 2, 4, 6)),
    *((n, n + 1, n + 24, n + 25, 32, 33) for n in (0, 2, 4, 6)),
    *((n, n + 1, n + 24, n + 25, 34, 35) for n in (0, 2, 4, 6)),
)
"""With `ONE`: columns of the smaller forms, with one other joint and with two."""


class Coupling(Effect):
    """Torques of an arm's other links.

    Of a planar elbow the shoulder bears ``(a + b cos q2) q2'' - b sin q2 q2'^2``, twice the rate
    of change of ``b cos q2 q1'``, and ``g cos(q1 + q2)``; the elbow ``(a + b cos q2) q1'' + b sin
    q2 q1'^2`` (Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, section 7.3). A
    third link on a parallel axis adds ``cos(q1 + q2 + q3)``, and the same with ``q2 + q3``, or with
    two joints' speeds; about an upright axis the links' inertia is a sum of squares and products of
    ``cos q2`` and ``cos(q2 + q3)``. Zeros of the angles are unknown and axes may be opposed: every
    wave is a sine and a cosine, and the difference stands beside the sum.
    """

    name = "coupling"
    domain = "acceleration"
    origin = "load"
    searches = ("axis", "beside")
    meaning = "torque from the motion of another joint: the arm's own dynamics, no fault"
    needs = ("position", "others")
    from_motion = True
    # Programs of a second are too short for averages, and a joint's vibration reaches the next one.
    fast = True
    several = True
    carries_load = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Each of the joints that move beside, and each two of them."""
        if track.others is None:
            return []
        travels = np.ptp(track.others[:, : len(track.other_axes)], axis=0)
        least = SLOWEST_SHARE * np.ptp(track.position_rad)
        moving = zip(track.other_axes, travels > least, strict=True)
        axes = [float(axis) for axis, moves in moving if moves]
        pairs = [{"axis": a, "beside": b} for a in axes for b in axes if a < b]
        return [*({"axis": axis} for axis in axes), *pairs]

    def columns_at(self, track: Track, parameters: Parameters, rows: Ints) -> Floats:
        """Regressors of one other joint, or of two, at some samples."""
        q, dq, ddq = (own[rows] for own in (track.position_rad, track.velocity, track.acceleration))
        one = a, da, dda = _motion(track, parameters["axis"], rows)
        if "beside" not in parameters:
            return stack(
                dda,
                *_carried(a, da, da, dda),
                *_carried(a, da, dq, ddq),
                *_carried(q, -da, da, dda),
                *_carried(2 * a, 2 * da, dq, ddq),
                *_waves(q + a),
                *_waves(q - a),
                *_carried(q, -da, da, -dda),
            )
        two = b, db, _ = _motion(track, parameters["beside"], rows)
        senses = [(way, side) for way in (1, -1) for side in (1, -1)]
        lifted = [(2 * one + times * two)[:2] for times in (1, 2, -1, -2)]
        sums = [way * one + side * two for way, side in senses]
        pairs = [
            *(_waves(q + angle) for angle, _, _ in sums),
            *(_carried(angle, rate, dq, ddq) for angle, rate in lifted),
            *(_carried(s, ds, 2 * dq + ds, 2 * ddq + dds) for s, ds, dds in sums),
            *(_carried(q + side * b, -da, da, way * dda) for way, side in senses),
            _carried(b, db, da, dda),
            (np.cos(q) * da * db, np.sin(q) * da * db),
        ]
        return stack(*(column for pair in pairs for column in pair))

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Say which joints."""
        axes = " and ".join(f"{axis:g}" for axis in parameters.values())
        several = "axes " if "beside" in parameters else "axis "
        return self.meaning.replace("another joint", several + axes)

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Forms of links that are far, light, slow or upright."""
        return [(parameters, keep) for keep in (TWO if "beside" in parameters else ONE)]


def _motion(track: Track, axis: float, rows: Ints) -> Floats:
    """Position, speed and acceleration of another joint at some samples, shape (3, rows)."""
    if track.others is None or axis not in track.other_axes:
        logged = ", ".join(str(axis) for axis in track.other_axes) or "none"
        msg = (
            f"effect 'coupling' asks for the position of axis {axis:g}, and those that are logged "
            f"beside a motion are {logged}; take the effect out"
        )
        raise ConfigError(msg)
    place = track.other_axes.index(int(axis))
    return np.asarray(track.others[rows, place :: len(track.other_axes)].T)


def _waves(angle: Floats) -> tuple[Floats, Floats]:
    return np.cos(angle), np.sin(angle)


def _carried(
    angle: Floats, rate: Floats, speed: Floats, acceleration: Floats
) -> tuple[Floats, Floats]:
    """Rates of change of a speed times the cosine of an angle, and times its sine."""
    cos, sin = _waves(angle)
    return cos * acceleration - sin * rate * speed, sin * acceleration + cos * rate * speed
