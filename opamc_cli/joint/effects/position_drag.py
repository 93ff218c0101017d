"""Friction at one place of the joint's travel."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Track


class PositionDrag(Effect):
    """A dragging place of some width: friction that depends on the angle."""

    name = "position_drag"
    domain = "joint-angle"
    per = ("",)
    searches = ("place_rad", "width_rad", "flatness")
    meaning = "other friction at one place of the travel: inspect bearing, seal and cables there"
    resists = True
    at_a_place = True
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Places that are passed both ways, widths from a sixtieth to a fifth of the travel.

        Where a joint moves both ways, a drag of one way is none: of strokes that never met it was
        learnt on the one, and its tail added to the other with the sign turned.
        """
        low, high = self._travel(track)
        span = high - low
        rows = track.moving if track.open_samples is None else track.open_samples
        ways = (np.sort(track.position_rad[rows & (track.direction * w > 0)]) for w in (-1, 1))
        met = [way for way in ways if way.size]
        return [
            {"place_rad": float(place), "width_rad": width, "flatness": 2.0}
            for width in geometric(span / 60, span / 5, 5)
            for place in np.arange(low, high + width / 2, max(0.8 * width, span / 50))
            if all(np.ptp(np.searchsorted(way, (place - width, place + width))) for way in met)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Within the travel; not wider than a third of it, or it is not a place."""
        low, high = self._travel(track)
        return {
            "place_rad": (low, high),
            "width_rad": ((high - low) / 150, (high - low) / 3.5),
            "flatness": (1.2, 8.0),
        }

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Direction times a bell over the angle."""
        away = np.abs(track.position_rad - parameters["place_rad"]) / parameters["width_rad"]
        return stack(track.direction * np.exp(-0.5 * away ** parameters["flatness"]))

    @staticmethod
    def _travel(track: Track) -> tuple[float, float]:
        # Of a place that the fitted samples do not pass there are only the bell's tails.
        rows = track.moving if track.open_samples is None else track.open_samples
        position = track.position_rad[rows]
        return float(position.min()), float(position.max())
