"""Friction that falls as the lubricant film builds up."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Track


class Stribeck(Effect):
    """Extra friction at low speed, ``exp(-(v / v_s)^2)`` or ``exp(-v / v_s)``.

    References
    ----------
    Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30, 1994, equation 3.
    """

    name = "stribeck"
    domain = "velocity"
    per = ("",)
    searches = ("stribeck_speed",)
    meaning = "mixed lubrication at low speed: check the grease film"
    resists = True
    from_motion = True

    def untestable(self, track: Track) -> str | None:
        """Where the joint never goes slowly, what friction falls from is nowhere seen."""
        low, high = self.limits(track)["stribeck_speed"]
        return "the joint never goes slowly" if 4 * low > high else super().untestable(track)

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Stribeck speeds from 1.5 % to 60 % of the top speed, both exponents."""
        low, high = self.limits(track)["stribeck_speed"]
        return [
            {"stribeck_speed": speed, "exponent": exponent}
            for exponent in (2.0, 1.0)
            for speed in geometric(1.5 * low, high / 1.2, 11)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Half of the slowest speed to 70 % of the top: beyond it the fall is a straight line."""
        slowest = np.min(np.abs(track.velocity[track.moving]), initial=track.speed_scale)
        low = max(0.01 * track.speed_scale, 0.5 * float(slowest))
        return {"stribeck_speed": (low, 0.7 * track.speed_scale)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Direction times the fall with speed."""
        ratio = np.abs(track.velocity) / parameters["stribeck_speed"]
        return stack(track.direction * np.exp(-(ratio ** parameters["exponent"])))
