"""Friction that decays with time since the start."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Track


class Warmup(Effect):
    """Friction above its settled level, decaying since the session's or the recording's start."""

    name = "warmup"
    domain = "time"
    per = ("rad/s", "")
    of_its_recordings = True
    origin = "environment"
    changes_in_time = True
    searches = ("time_constant_s",)
    meaning = "friction that falls while the joint warms up: not a fault"
    needs = ("position", "returns")
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Try time constants of a twentieth to one and a half of the session's length."""
        # In a recording that never comes back, time since its start is a function of place.
        length = float(np.ptp(track.time_s)) + 1e-9
        clocks = (0.0, 1.0) if len(track.starts_s) > 1 and track.comes_back else (0.0,)
        return [
            {"time_constant_s": constant, "per_recording": clock}
            for clock in clocks
            for constant in geometric(length / 20, 1.5 * length, 7)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From a fortieth to three times the session's length."""
        length = float(np.ptp(track.time_s)) + 1e-9
        return {"time_constant_s": (length / 40, 3 * length)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Decaying lubricant and dry friction."""
        clock = track.run_time_s if parameters["per_recording"] else track.time_s
        decay = np.exp(-clock / parameters["time_constant_s"])
        return stack(track.velocity * decay, track.direction * decay)

    def variants(self, parameters: Parameters) -> list[tuple[Parameters, tuple[int, ...]]]:
        """Only the lubricant, or only the dry friction."""
        return [(parameters | {"dry": 0.0}, (0,)), (parameters | {"viscous": 0.0}, (1,))]

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Friction falls while warming up: at least the larger part of it."""
        return bool(np.max(coefficients) > 0)
