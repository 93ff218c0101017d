"""A current that comes later, or earlier, than the motion it belongs to."""

import numpy as np
from numba import njit

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Ints, Track
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


def late_means(
    sums: Floats, bounds: tuple[tuple[int, int], ...], samples: float, factor: int
) -> Floats:
    """Means of blocks of columns that come later, the first and the last values held.

    Running sums of the columns, (n + recordings, k) from zero in each recording, make a delay cost
    no more than there are blocks; between samples it is what a straight line between them gives.
    """
    means = np.empty((sum((stop - start) // factor for start, stop in bounds), sums.shape[1]))
    _late_means(sums, np.array(bounds), samples, factor, means)
    return means


@njit(cache=True)
def _late_means(sums: Floats, bounds: Ints, samples: float, factor: int, means: Floats) -> None:
    place = 0
    for number in range(len(bounds)):
        start, stop = bounds[number]
        own = sums[start + number : stop + number + 1]
        blocks = (stop - start) // factor
        for block in range(blocks + 1):
            edge = factor * block - samples
            # Beyond the ends the nearest step goes on.
            whole = min(max(int(edge), 0), stop - start - 1)
            for k in range(sums.shape[1]):
                step = own[whole + 1, k] - own[whole, k]
                at = (own[whole, k] + (edge - whole) * step) / factor
                if block:
                    means[place + block - 1, k] += at
                if block < blocks:
                    means[place + block, k] = -at
        place += blocks


@njit(cache=True)
def lagging(columns: Floats, pole: float) -> Floats:
    """Put columns, (n, k), through a filter of first order, from rest at their first values."""
    late = columns.copy()
    for n in range(1, len(late)):
        for k in range(late.shape[1]):
            late[n, k] += pole * (late[n - 1, k] - late[n, k])
    return late
