"""Lubricant friction."""

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class Viscous(Effect):
    """Friction in proportion to the speed, and the motor's own damping."""

    name = "viscous"
    domain = "velocity"
    per = ("rad/s",)
    meaning = "lubricant friction: check grease amount and grade"
    resists = True
    from_motion = True

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Speed."""
        return stack(track.velocity)
