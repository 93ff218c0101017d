"""Friction that grows more slowly than the speed."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track


class SublinearFriction(Effect):
    """A power of the speed below one: shear-thinning grease."""

    name = "sublinear_friction"
    domain = "velocity"
    per = ("",)
    searches = ("exponent",)
    meaning = "shear-thinning or starved lubricant: check the grease grade"
    resists = True
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Exponents between a constant and a straight line."""
        return [{"exponent": exponent} for exponent in (0.15, 0.3, 0.45, 0.6, 0.75)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Neither a constant nor a straight line."""
        return {"exponent": (0.1, 0.85)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Signed power of the speed, relative to the top speed."""
        ratio = np.abs(track.velocity) / track.speed_scale
        return stack(track.direction * ratio ** parameters["exponent"])
