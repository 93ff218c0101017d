"""What another joint's motion asks of this one."""

import numpy as np

from opamc_cli.errors import ConfigError
from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.kinematics import SLOWEST_SHARE
from opamc_cli.joint.motion.track import Floats, Track

FORMS = (
    (0,),  # a far or light link
    (0, 1, 2),  # one whose reach changes
    (3, 4),  # a slow one on an axis that is parallel,
    (5, 6),  # on one that is opposed,
    (3, 4, 5, 6),  # or on any
    (0, 1, 2, 7, 8, 9, 10, 11, 12),  # an arm that lies level
)
"""Columns of the smaller forms."""


class Coupling(Effect):
    """Torques of an arm's other link.

    Of a planar elbow the shoulder bears ``(a + b cos q2) q2''``, ``2 b cos q2 q1''``,
    ``-b sin q2 (2 q1' q2' + q2'^2)`` and ``g cos(q1 + q2)`` (Spong, Hutchinson, Vidyasagar, Robot
    Modeling and Control, 2006, section 7.3). Zeros of the angles are unknown and axes may be
    opposed: every wave is a sine and a cosine, and the difference stands beside the sum.
    """

    name = "coupling"
    domain = "acceleration"
    origin = "load"
    searches = ("axis",)
    meaning = "torque from the motion of another joint: the arm's own dynamics, no fault"
    needs = ("position", "others")
    from_motion = True
    # A joint's vibration reaches the next one, and averages would not show it.
    fast = True
    several = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Each of the joints that move beside."""
        if track.others is None:
            return []
        travels = np.ptp(track.others[:, : len(track.other_axes)], axis=0)
        least = SLOWEST_SHARE * np.ptp(track.position_rad)
        moving = zip(track.other_axes, travels > least, strict=True)
        return [{"axis": float(axis)} for axis, moves in moving if moves]

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Reaction, gravity, and what the angle between the links makes of both motions."""
        if track.others is None or parameters["axis"] not in track.other_axes:
            logged = ", ".join(str(axis) for axis in track.other_axes) or "none"
            msg = (
                f"effect 'coupling' asks for the position of axis {parameters['axis']:g}, and "
                f"those that are logged beside a motion are {logged}; take the effect out"
            )
            raise ConfigError(msg)
        place = track.other_axes.index(int(parameters["axis"]))
        angle, speed, acceleration = track.others.T[place :: len(track.other_axes)]
        waves = np.cos(angle), np.sin(angle)
        sums = track.position_rad + angle, track.position_rad - angle
        return stack(
            acceleration,
            *(acceleration * wave for wave in waves),
            *(wave(both) for both in sums for wave in (np.cos, np.sin)),
            *(track.acceleration * wave for wave in waves),
            *(speed**2 * wave for wave in waves),
            *(track.velocity * speed * wave for wave in waves),
        )

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Say which joint."""
        return self.meaning.replace("another joint", f"axis {parameters['axis']:g}")

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Forms of links that are far, light, slow or level."""
        return [(parameters, keep) for keep in FORMS]
