"""Dry friction."""

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class Coulomb(Effect):
    """Friction that knows the direction but not the speed."""

    name = "coulomb"
    domain = "velocity"
    per = ("",)
    meaning = "dry friction of bearings and seals: check the preload"
    resists = True
    from_motion = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Direction of motion."""
        return stack(track.direction)
