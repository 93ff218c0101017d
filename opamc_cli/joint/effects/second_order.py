"""Filters of second order: what a sprung mass, or a velocity loop, makes of a signal."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from opamc_cli.joint.motion.track import Floats, Ints


def answers(
    signals: Sequence[Floats],
    rad_per_s: float,
    damping: float,
    rate_hz: float,
    bounds: tuple[tuple[int, int], ...],
    rows: Ints | None = None,
    out: Floats | None = None,
) -> Floats:
    """Put signals through the low-pass and the band-pass of one resonance.

    Parameters
    ----------
    signals : sequence of arrays of shape (n,)
        As if each recording's first value had lasted for ever: no ringing from the start.
    rad_per_s, damping : float
        Undamped angular frequency, below pi times the rate, and damping ratio.
    rows : int array of shape (m,), optional
        Samples that somebody looks at; else all n of them.
    out : array of shape (2 k, m), optional
        Where to write.

    Returns
    -------
    array of shape (2 k, m)
        All k signals through the low-pass, of gain 1 at rest; then through the band-pass, the
        low-pass's rate of change in units of the resonance.
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
    edges, last = np.array(bounds), len(signals) - 1
    for i in range(0, len(signals), 2):
        # Two at a time take as long as one, of which every sample waits for the one before.
        j = min(i + 1, last)
        out_of_both = (found[i], found[j], found[len(signals) + i], found[len(signals) + j])
        both = (signals[i], signals[j])
        _put_through(both, edges, poles / poles[0], w * w / poles[0], 1 / w, places, out_of_both)
    return found


@njit(cache=True)
def _put_through(
    signals: tuple[Floats, Floats],
    bounds: Ints,
    poles: Floats,
    gain: float,
    steeper: float,
    places: Ints,
    out: tuple[Floats, Floats, Floats, Floats],
) -> None:
    one, other = signals
    low, low_of_other, band, band_of_other = out
    p1, p2 = poles[1], poles[2]
    for start, stop in bounds:
        a = b = gain * one[start] / (1.0 + p1 + p2)
        c = d = gain * other[start] / (1.0 + p1 + p2)
        for n in range(start, stop):
            # All have these poles; their zeros are (1 + 1/z)^2 and 1 - 1/z^2.
            poled = gain * one[n] - p1 * a - p2 * b
            poled_other = gain * other[n] - p1 * c - p2 * d
            place = places[n]
            if place >= 0:
                low[place] = poled + 2.0 * a + b
                low_of_other[place] = poled_other + 2.0 * c + d
                band[place] = steeper * (poled - b)
                band_of_other[place] = steeper * (poled_other - d)
            a, b, c, d = poled, a, poled_other, c
