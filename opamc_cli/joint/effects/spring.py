"""A torque in proportion to the joint angle."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class Spring(Effect):
    """A spring or a dragging cable package about an unknown neutral angle."""

    name = "spring"
    domain = "joint-angle"
    per = ("rad", "")
    meaning = "a force that grows with the angle: check balancing spring and cable package"
    from_motion = True
    carries_load = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Angle, and a constant for the neutral angle."""
        return stack(track.position_rad, np.ones(track.size))

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Neutral at zero."""
        return [(parameters | {"neutral_rad": 0.0}, (0,))]
