"""Filters of second order: what a sprung mass, or a velocity loop, makes of a signal."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from opamc_cli.joint.motion.track import Floats, Ints

Quadratic = tuple[float, float, float]


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
    # The bilinear transform bends frequencies; start from the bent one.
    w = 2 * rate_hz * np.tan(rad_per_s / (2 * rate_hz))
    zeros, poles = discrete((0.0, 0.0, w * w), (1.0, 2 * damping * w, w * w), rate_hz)
    size = signals[0].size
    places = np.arange(size)
    if rows is not None:
        places[:] = -1
        places[rows] = np.arange(rows.size)
    count = size if rows is None else rows.size
    found = np.empty((2 * len(signals), count)) if out is None else out
    for signal, low, band in zip(signals, found, found[len(signals) :], strict=False):
        _put_through(signal, np.array(bounds), poles, zeros[0], 2 * rate_hz / w, places, low, band)
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
    for start, stop in bounds:
        last = before = gain * signal[start] / (1.0 + poles[1] + poles[2])
        for n in range(start, stop):
            # Both have these poles; their zeros are (1 + 1/z)^2 and 1 - 1/z^2.
            poled = gain * signal[n] - poles[1] * last - poles[2] * before
            place = places[n]
            if place >= 0:
                low[place] = poled + 2.0 * last + before
                band[place] = steeper * (poled - before)
            before = last
            last = poled


def discrete(above: Quadratic, below: Quadratic, rate_hz: float) -> tuple[Floats, Floats]:
    """Bilinear transform of a filter of second order.

    Parameters
    ----------
    above, below : tuple of 3 floats
        Coefficients of s^2, s and 1 in numerator and denominator.

    Returns
    -------
    above, below : arrays of shape (3,)
        Coefficients of 1, 1/z and 1/z^2; the denominator begins with 1. `scipy.signal.bilinear`
        returns the same by way of polynomial objects, at a hundred times the cost.
    """
    k = 2 * rate_hz

    def in_z(s: Quadratic) -> Floats:
        square, linear, constant = s[0] * k * k, s[1] * k, s[2]
        return np.array(
            [square + linear + constant, 2 * (constant - square), square - linear + constant]
        )

    first = in_z(below)[0]
    return in_z(above) / first, in_z(below) / first
