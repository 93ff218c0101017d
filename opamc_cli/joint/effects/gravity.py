"""Torque that holds the links up."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track

TRAVELS_RAD = (0.3, 0.8, 1.4, 2.0, 2.8, 3.8, 5.0, 6.3)
SHORTEST_TRAVEL_RAD = 0.1
LONGEST_TRAVEL_RAD = 7.0


class Gravity(Effect):
    """Sine and cosine of the joint angle: the angle at which the link hangs is not known.

    Where the angle's scale is unknown too (phase currents alone, without gear ratio and pole
    pairs), `joint_rad_per_rad` is searched: how far the joint turns per radian of the known angle.
    """

    name = "gravity"
    domain = "joint-angle"
    per = ("",)
    origin = "load"
    searches = ("joint_rad_per_rad",)
    meaning = "weight of the links; not a fault in itself"
    carries_load = True
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Travels of the joint from a few degrees to a whole turn, where nobody knows it."""
        if "scale" in track.channels:
            return [{}]
        return [{"joint_rad_per_rad": joint / max(track.travel_rad, 1e-9)} for joint in TRAVELS_RAD]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Up to somewhat more than a turn of the joint."""
        if "scale" in track.channels:
            return {}
        travel = max(track.travel_rad, 1e-9)
        return {"joint_rad_per_rad": (SHORTEST_TRAVEL_RAD / travel, LONGEST_TRAVEL_RAD / travel)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Sine and cosine of the joint angle."""
        angle = parameters.get("joint_rad_per_rad", 1.0) * track.position_rad
        return stack(np.sin(angle), np.cos(angle))
