"""Torque that accelerates rotor and links."""

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class Inertia(Effect):
    """Current in proportion to the acceleration."""

    name = "inertia"
    domain = "acceleration"
    per = ("rad/s²",)
    origin = "load"
    meaning = "mass that is accelerated; not a fault in itself"
    from_motion = True
    carries_load = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Acceleration."""
        return stack(track.acceleration)
