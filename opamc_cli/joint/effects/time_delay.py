"""A current that comes later, or earlier, than the motion it belongs to."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.signal.transform.filters import lagging, late_means
from opamc_cli.signal.transform.least_squares import solve

SHORTEST_GUESS_S, LONGEST_GUESS_S = 5e-4, 64e-3
LONGEST_FILTER_S = 8e-3
LEAST_SAMPLES = 0.75
"""Less stood for corners that sampling had rounded off, 0.62 beside a vibration for nothing."""


class TimeDelay(Effect):
    """The whole model's current, shifted in time or (`filtered`) behind a first-order filter."""

    name = "time_delay"
    domain = "time"
    per = ("current",)
    of_its_recordings = True
    origin = "measurement"
    searches = ("delay_s",)
    forms = ("filtered",)
    meaning = "a delay between current and motion as logged: check the logger's clocks"
    as_smoothing = True
    needs = ("position", "logged")
    static = False
    from_terms = True
    whole = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """From half a millisecond to 64 ms either way, filters to 8 ms.

        Each is half as long again as the last; the refinement finds what lies between.
        """
        delays = geometric(SHORTEST_GUESS_S, LONGEST_GUESS_S, 12)
        shifts = [{"delay_s": sign * delay} for sign in (-1.0, 1.0) for delay in delays]
        filters = geometric(SHORTEST_GUESS_S, LONGEST_FILTER_S, 4)
        return [*shifts, *({"delay_s": delay, "filtered": 1.0} for delay in filters)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Up to 120 ms either way."""
        return {"delay_s": (-0.12, 0.12)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Shifted model current less the model current, by the coefficients that fit when shifted.

        The coefficients of the unshifted fit would not do: they have already bent to the delay.
        """
        rows = track.open_samples
        full, filtered = track.full or track, parameters.get("filtered")
        samples = parameters["delay_s"] * full.rate_hz
        none = abs(samples) < LEAST_SAMPLES and not filtered
        if not track.static_terms or rows is None or none:
            return np.zeros((track.size, 1))
        if filtered:
            pole = np.exp(-1.0 / max(samples, 1e-3))
            columns = track.full_columns
            late = [lagging(columns[start:stop], pole) for start, stop in full.bounds]
            shifted = track.own_means(np.concatenate(late))
        else:
            factor = round(full.rate_hz / track.rate_hz)
            shifted = late_means(track.static_sums, full.bounds, samples, factor)
        part = shifted[rows]
        coefficients = solve(part.T @ part, part.T @ track.current_a[rows])
        return stack((shifted - track.static_columns) @ coefficients)

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Only a whole shift counts: the model's current is moved, not multiplied.

        A delay much shorter than the samples are apart may have any length, and the coefficient
        that goes with it: hence the wide margin.
        """
        return bool(0.6 < coefficients[0] < 1.7)

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Name the filter, where it is one."""
        if not parameters.get("filtered"):
            return self.meaning
        corner_hz = 1 / (2 * np.pi * parameters["delay_s"])
        return f"a current that is reported through a filter of {corner_hz:.0f} Hz: no fault"
