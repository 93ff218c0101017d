"""Delays and filters: what a logger, a sprung mass or a velocity loop makes of a signal."""

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
