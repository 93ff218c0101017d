"""Filters of second order: what a sprung mass, or a velocity loop, makes of a signal."""

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def answers(
    signals: Sequence[Floats],
    rad_per_s: float,
    damping: float,
    rate_hz: float,
    bounds: tuple[tuple[int, int], ...],
    rows: Ints | None = None,
    out: Floats | None = None,
) -> Floats:
    """Put k signals of shape (n,) through the low-pass and the band-pass of one resonance.

    Of an undamped angular frequency below pi times the rate, and a damping ratio; as if each
    recording's first value had lasted for ever, so that nothing rings from the start. Returned are,
    at all samples or at some `rows`, int (m,), and written to `out` where it is given, the signals
    through the low-pass, of gain 1 at rest, then through the band-pass, the low-pass's rate of
    change in units of the resonance; shape (2 k, m).
    """
    # The bilinear transform bends frequencies; start from the bent one, as a share of twice the
    # rate.
    w = np.tan(rad_per_s / (2 * rate_hz))
    poles = np.array([1 + 2 * damping * w + w * w, 2 * (w * w - 1), 1 - 2 * damping * w + w * w])
    size = signals[0].size
    places = np.arange(size)
    if rows is not None:
        places[:] = -1
        places[rows] = np.arange(rows.size)
    count = size if rows is None else rows.size
    found = np.empty((2 * len(signals), count)) if out is None else out
    edges = np.array(bounds)
    for i, signal in enumerate(signals):
        both = found[i], found[len(signals) + i]
        _put_through(signal, edges, poles / poles[0], w * w / poles[0], 1 / w, places, *both)
    return found


@njit(cache=True)
def _put_through(
    signal: Floats,
    bounds: Ints,
    poles: Floats,
    gain: float,
    steeper: float,
    places: Ints,
    low: Floats,
    band: Floats,
) -> None:
    p1, p2 = poles[1], poles[2]
    for start, stop in bounds:
        a = b = gain * signal[start] / (1.0 + p1 + p2)
        for n in range(start, stop):
            # Both have these poles; their zeros are (1 + 1/z)^2 and 1 - 1/z^2.
            poled = gain * signal[n] - p1 * a - p2 * b
            place = places[n]
            if place >= 0:
                low[place] = poled + 2.0 * a + b
                band[place] = steeper * (poled - b)
            a, b = poled, a
