"""Pick-up from the mains."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.spectra import LEAST_LINE, line_power, standing_views

MAINS_HZ = (50.0, 60.0)
HIGHEST_HARMONIC = 12
HIGHEST_FOLDED = 3
"""Above half the sampling rate. Twelve, each 0.5 % of its own frequency wide, cover all that
125 Hz show, and lines of a motor that turns at one speed (a UR10's orders 10, 20, 30) were hum."""
TOLERANCE = 0.005
SAME_START_S = 1e-3
LOGGERS_PARTS = (3, 4, 5, 6, 8, 10)
"""Samples after which a logger's pattern repeats: an arm's had lines at every tenth of its rate."""
BEAT_ERROR = 0.001
"""Of the rate: these lay within 0.0008 of it."""


def _mains_lines(rate_hz: float) -> list[tuple[float, float]]:
    """Where the sampling rate shows multiples of the mains, and how far from it they may lie."""
    lines = []
    for mains in MAINS_HZ:
        for harmonic in range(1, HIGHEST_HARMONIC + 1):
            line = mains * harmonic
            folded = abs((line + rate_hz / 2) % rate_hz - rate_hz / 2)
            shown = line < rate_hz / 2 or harmonic <= HIGHEST_FOLDED
            if shown and 5 <= folded <= 0.48 * rate_hz:
                lines.append((folded, max(TOLERANCE * line, 0.1)))
    return lines


class MainsHum(Effect):
    """A line at a multiple of 50 or 60 Hz, folded where the sampling rate is low.

    In a phase's reading the line stands still, so in the torque current it turns against the
    field (`turning`); what all three phases pick up alike does not reach the torque current.
    Each recording has phases of its own: the mains run fast and slow, and nobody's clock tells when
    one began to a thousandth of a second.
    """

    name = "mains_hum"
    domain = "frequency"
    per = ("",)
    of_its_recordings = True
    origin = "measurement"
    searches = ("frequency_hz",)
    forms = ("turning",)
    meaning = "mains pick-up in the current reading: check shielding and grounding"
    needs = ()
    from_motion = True
    fast = True
    several = True
    static = False

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Strongest line near each multiple that the rate can show."""
        found: list[tuple[float, float, float]] = []
        for turning, signals in standing_views(track, residual):
            frequencies, power = line_power(track, signals)
            for shown_hz, reach_hz in _mains_lines(track.rate_hz):
                first = int(np.searchsorted(frequencies, shown_hz - reach_hz))
                last = int(np.searchsorted(frequencies, shown_hz + reach_hz, side="right"))
                if last > first:
                    best = first + int(np.argmax(power[first:last]))
                    found.append((float(power[best]), float(frequencies[best]), float(turning)))
        least = 0.5 * LEAST_LINE * np.count_nonzero(residual)
        found = sorted((one for one in found if one[0] > least), reverse=True)[:2]
        return [{"frequency_hz": frequency, "turning": turning} for _, frequency, turning in found]

    def first_steps(self, track: Track, parameters: Parameters) -> dict[str, float]:
        """Half of what two frequencies have to differ by in the longest recording."""
        return {"frequency_hz": 0.5 / max(float(np.max(track.run_time_s)), 1e-9)}

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Up to the highest frequency that the rate can show."""
        return {"frequency_hz": (4.0, 0.49 * track.rate_hz)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Sine and cosine of time, against the field or not, of each recording."""
        angle = 2 * np.pi * parameters["frequency_hz"] * track.time_s
        waves = [np.cos(angle), np.sin(angle)]
        if parameters.get("turning"):
            assert track.electrical_rad is not None
            field = (np.cos(track.electrical_rad), np.sin(track.electrical_rad))
            waves = [wave * part for wave in waves for part in field]
        if len(track.starts_s) == 1:
            return stack(*waves)
        started_s = track.time_s - track.run_time_s
        own = [np.abs(started_s - start_s) < SAME_START_S for start_s in track.starts_s]
        return stack(*(np.where(inside, wave, 0.0) for inside in own for wave in waves))

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Name the line, and say where it may be folded."""
        frequency = parameters["frequency_hz"]
        for mains in MAINS_HZ:
            if abs(frequency / mains - round(frequency / mains)) * mains < 0.02 * frequency:
                return f"{self.meaning} ({round(frequency / mains)} x {mains:.0f} Hz)"
        text = f"{self.meaning} (a multiple of 50 or 60 Hz, folded by the sampling rate"
        for parts in LOGGERS_PARTS:
            beat = frequency / track.rate_hz * parts
            if abs(beat - round(beat)) < BEAT_ERROR * parts:
                return f"{text}, or the logger's own: {round(beat)}/{parts} of its rate)"
        return f"{text})"
