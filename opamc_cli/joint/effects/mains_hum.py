"""Pick-up from the mains."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.spectra import frequency_lines
from opamc_cli.joint.track import Floats, Track

MAINS_HZ = (50.0, 60.0)
HIGHEST_HARMONIC = 12
TOLERANCE = 0.005


class MainsHum(Effect):
    """A line at a multiple of 50 or 60 Hz, folded where the sampling rate is low."""

    name = "mains_hum"
    domain = "frequency"
    meaning = "mains pick-up in the current reading: check shielding and grounding"
    dense_guesses = True
    from_motion = True
    fast = True
    several = True
    static = False

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Strongest line near each multiple that the rate can show."""
        frequencies, power = frequency_lines(track, residual)
        found: list[tuple[float, float]] = []
        for mains in MAINS_HZ:
            for harmonic in range(1, HIGHEST_HARMONIC + 1):
                line = mains * harmonic
                folded = abs((line + track.rate_hz / 2) % track.rate_hz - track.rate_hz / 2)
                if folded < 5 or folded > 0.48 * track.rate_hz:
                    continue
                near = np.abs(frequencies - folded) <= max(TOLERANCE * line, 0.1)
                if np.any(near):
                    best = int(np.argmax(np.where(near, power, 0.0)))
                    found.append((float(power[best]), float(frequencies[best])))
        found.sort(reverse=True)
        return [{"frequency_hz": frequency} for _, frequency in found[:2]]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Up to the highest frequency that the rate can show."""
        return {"frequency_hz": (4.0, 0.49 * track.rate_hz)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Sine and cosine of time."""
        angle = 2 * np.pi * parameters["frequency_hz"] * track.time_s
        return stack(np.cos(angle), np.sin(angle))

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Name the line, and say where it may be folded."""
        frequency = parameters["frequency_hz"]
        for mains in MAINS_HZ:
            if abs(frequency / mains - round(frequency / mains)) * mains < 0.02 * frequency:
                return f"{self.meaning} ({round(frequency / mains)} x {mains:.0f} Hz)"
        return f"{self.meaning} (a multiple of 50 or 60 Hz, folded by the sampling rate)"
