"""Torque that holds the links up."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.track import Floats, Track


class Gravity(Effect):
    """Sine and cosine of the joint angle: the angle at which the link hangs is not known."""

    name = "gravity"
    domain = "joint-angle"
    meaning = "weight of the links; not a fault in itself"
    needs = ("scale",)
    from_motion = True
    carries_load = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Sine and cosine of the joint angle."""
        return stack(np.sin(track.position_rad), np.cos(track.position_rad))
