"""Lubricant friction that follows the measured temperature."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track

SMALLEST_RANGE_C = 0.5


class ThermalViscous(Effect):
    """Lubricant friction falls, exponentially, as the temperature rises."""

    name = "thermal_viscous"
    domain = "temperature"
    per = ("rad/s",)
    origin = "environment"
    changes_in_time = True
    searches = ("rate_per_c",)
    meaning = "grease that is stiffer when cold: not a fault"
    needs = ("position", "temperature")
    resists = True
    from_motion = True

    def untestable(self, track: Track) -> str | None:
        """Needs a temperature that changes."""
        why = super().untestable(track)
        if why is None and track.temperature_c is not None:
            span = float(np.ptp(track.temperature_c[track.moving]))
            if span < SMALLEST_RANGE_C:
                why = f"temperature changes by {span:.2g} °C, less than {SMALLEST_RANGE_C} °C"
        return why

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Relative change of viscosity per degree."""
        return [{"rate_per_c": rate} for rate in (0.002, 0.02, 0.05)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From a straight line to a halving every 9 degrees."""
        return {"rate_per_c": (0.001, 0.08)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Speed times the relative viscosity above its middle."""
        assert track.temperature_c is not None
        rate = parameters["rate_per_c"]
        viscosity = np.expm1(-rate * (track.temperature_c - track.middle_temperature_c)) / rate
        return stack(track.velocity * viscosity)
