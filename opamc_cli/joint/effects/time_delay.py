"""A current that comes later, or earlier, than the motion it belongs to."""

import numpy as np
from scipy.signal import lfilter

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.normal import solve
from opamc_cli.joint.track import Floats, Track

SHORTEST_GUESS_S = 5e-4


class TimeDelay(Effect):
    """The whole model's current, shifted in time or (`filtered`) behind a first-order filter."""

    name = "time_delay"
    domain = "time"
    origin = "measurement"
    meaning = "current and motion are logged with a delay: check the logger's clocks"
    needs = ("position", "logged")
    static = False
    same_for_all = True
    dense_guesses = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """From half a millisecond to 64 ms either way, each twice the last; filters to 8 ms."""
        delays = geometric(SHORTEST_GUESS_S, 2**7 * SHORTEST_GUESS_S, 8)
        shifts = [{"delay_s": sign * delay} for sign in (-1.0, 1.0) for delay in delays]
        return [*shifts, *({"delay_s": delay, "filtered": 1.0} for delay in delays[:5])]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """Up to 120 ms either way."""
        return {"delay_s": (-0.12, 0.12)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Shifted model current less the model current, by the coefficients that fit when shifted.

        The coefficients of the unshifted fit would not do: they have already bent to the delay.
        """
        return stack(self.parts(track, parameters).sum(axis=1))

    def parts(self, track: Track, parameters: Parameters) -> Floats:
        """Shift each regressor of the model: one clock delays them all alike."""
        rows = track.open_samples
        if not track.static_columns or rows is None:
            return np.zeros((track.size, 1))
        delay_s = parameters["delay_s"]
        columns = np.concatenate(track.static_columns, axis=1)
        shifted = np.empty_like(columns)
        for start, stop in track.bounds:
            if parameters.get("filtered"):
                shifted[start:stop] = lagging(columns[start:stop], delay_s * track.rate_hz)
                continue
            times = np.arange(stop - start) / track.rate_hz
            for k in range(columns.shape[1]):
                shifted[start:stop, k] = np.interp(times - delay_s, times, columns[start:stop, k])
        part = shifted[rows]
        coefficients = solve(part.T @ part, part.T @ track.current_a[rows])
        return (shifted - columns) * coefficients

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Only a whole shift counts: the model's current is moved, not multiplied.

        What twice a short delay does is almost twice as large: one of the guesses fits within a
        factor of 1.5.
        """
        return bool(0.6 < coefficients[0] < 1.7)

    def rescaled(self, parameters: Parameters, coefficients: Floats) -> Parameters:
        """Lengthen the delay where more than a whole shift is asked for.

        Short delays differ by their size alone. Less than a whole shift is another matter: then
        something of the current is not delayed.
        """
        return parameters | {"delay_s": parameters["delay_s"] * max(float(coefficients[0]), 1.0)}

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Name the filter, where it is one."""
        if not parameters.get("filtered"):
            return self.meaning
        corner_hz = 1 / (2 * np.pi * parameters["delay_s"])
        return f"the current is reported through a filter of {corner_hz:.0f} Hz: no fault"


def lagging(columns: Floats, samples: float) -> Floats:
    """Put columns through a filter of first order, from rest at their first values.

    Parameters
    ----------
    columns : array of shape (n, k)
        Uniformly sampled.
    samples : float
        Time constant.
    """
    pole = np.exp(-1.0 / max(samples, 1e-3))
    rest = pole * columns[:1]
    smooth: Floats = lfilter([1.0 - pole], [1.0, -pole], columns, axis=0, zi=rest)[0]
    return smooth
