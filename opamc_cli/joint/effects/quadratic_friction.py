"""Drag that grows with the square of the speed."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class QuadraticFriction(Effect):
    """Churning and windage losses."""

    name = "quadratic_friction"
    domain = "velocity"
    per = ("rad²/s²",)
    meaning = "churning losses: too much grease"
    resists = True
    from_motion = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Signed square of the speed."""
        return stack(track.velocity * np.abs(track.velocity))
