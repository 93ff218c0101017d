"""A current that comes later, or earlier, than the motion it belongs to."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, stack
from opamc_cli.joint.normal import solve
from opamc_cli.joint.track import Floats, Track

LONGEST_FILTER_S = 4e-3
"""What a drive's filter of its reported current may delay it: 40 Hz, of first order."""


class TimeDelay(Effect):
    """The whole model's current, shifted in time."""

    name = "time_delay"
    domain = "time"
    origin = "measurement"
    meaning = "current and motion are logged with a delay: check the logger's clocks"
    needs = ("position", "logged")
    static = False
    same_for_all = True
    dense_guesses = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Up to 60 ms either way."""
        return [
            {"delay_s": sign * delay}
            for sign in (-1.0, 1.0)
            for delay in (0.002, 0.005, 0.01, 0.02, 0.035, 0.06)
        ]

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
        columns = np.concatenate(track.static_columns, axis=1)
        shifted = np.empty_like(columns)
        for start, stop in track.bounds:
            times = np.arange(stop - start) / track.rate_hz
            for k in range(columns.shape[1]):
                shifted[start:stop, k] = np.interp(
                    times - parameters["delay_s"], times, columns[start:stop, k]
                )
        part = shifted[rows]
        coefficients = solve(part.T @ part, part.T @ track.current_a[rows])
        return (shifted - columns) * coefficients

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Only a whole shift counts: the model's current is moved, not multiplied."""
        return bool(0.4 < coefficients[0] < 2.5)

    def interpretation(self, parameters: Parameters, track: Track) -> str:
        """Name the filter that delays as much, where one may."""
        delay_s = parameters["delay_s"]
        if not 0 < delay_s <= LONGEST_FILTER_S:
            return self.meaning
        corner_hz = 1 / (2 * np.pi * delay_s)
        return f"{self.meaning}; a filter of the current at {corner_hz:.0f} Hz delays as much"
