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

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Stribeck speeds from 1.5 % to 60 % of the top speed, both exponents."""
        top = track.speed_scale
        return [
            {"stribeck_speed": speed, "exponent": exponent}
            for exponent in (2.0, 1.0)
            for speed in geometric(0.015 * top, 0.6 * top, 11)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """1 % to 70 % of the top speed: beyond it the fall is a straight line."""
        return {"stribeck_speed": (0.01 * track.speed_scale, 0.7 * track.speed_scale)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Direction times the fall with speed."""
        ratio = np.abs(track.velocity) / parameters["stribeck_speed"]
        return stack(track.direction * np.exp(-(ratio ** parameters["exponent"])))
