"""Friction that differs between the directions."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class AsymmetricFriction(Effect):
    """Dry and lubricant friction of one direction against the other."""

    name = "asymmetric_friction"
    domain = "velocity"
    per = ("", "rad/s")
    meaning = "friction that differs between directions: check bearing preload and seal lips"
    from_motion = True

    def untestable(self, track: Track) -> str | None:
        """Of one way alone it is any friction, of either sign."""
        one = np.unique(track.direction[track.moving]).size < 2
        return "the joint moves one way alone" if one else super().untestable(track)

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Half the difference of dry (a constant) and of lubricant friction."""
        return stack(np.ones(track.size), np.abs(track.velocity))

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Allow that the difference lies in the slope alone; a constant alone is an offset."""
        return [(parameters | {"dry": 0.0}, (1,))]
