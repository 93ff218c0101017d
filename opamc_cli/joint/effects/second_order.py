"""Filters of second order: what a sprung mass, or a velocity loop, makes of a signal."""

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from opamc_cli.joint.motion.track import Floats

Quadratic = tuple[float, float, float]


def answers(
    signals: Sequence[Floats],
    rad_per_s: float,
    damping: float,
    rate_hz: float,
    bounds: tuple[tuple[int, int], ...],
) -> list[Floats]:
    """Put signals through the low-pass and the band-pass of one resonance.

    Parameters
    ----------
    signals : sequence of arrays of shape (n,)
        As if each recording's first value had lasted for ever: no ringing from the start.
    rad_per_s, damping : float
        Undamped angular frequency, below pi times the rate, and damping ratio.
    rate_hz : float
        Sampling rate.
    bounds : tuple of (int, int)
        Half-open recordings.

    Returns
    -------
    list of arrays of shape (n,)
        All signals through the low-pass, of gain 1 at rest; then through the band-pass, the
        low-pass's rate of change in units of the resonance.
    """
    # The bilinear transform bends frequencies; start from the bent one.
    w = 2 * rate_hz * np.tan(rad_per_s / (2 * rate_hz))
    found = []
    for above in ((0.0, 0.0, w * w), (0.0, w, 0.0)):
        zeros, poles = discrete(above, (1.0, 2 * damping * w, w * w), rate_hz)
        for signal in signals:
            filtered = np.empty(signal.size)
            for start, stop in bounds:
                part = signal[start:stop]
                rest = at_rest(zeros, poles) * part[0]
                filtered[start:stop] = lfilter(zeros, poles, part, zi=rest)[0]
            found.append(filtered)
    return found


def discrete(above: Quadratic, below: Quadratic, rate_hz: float) -> tuple[Floats, Floats]:
    """Bilinear transform of a filter of second order.

    Parameters
    ----------
    above, below : tuple of 3 floats
        Coefficients of s^2, s and 1 in numerator and denominator.
    rate_hz : float
        Sampling rate.

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


def at_rest(above: Floats, below: Floats) -> Floats:
    """State of a filter of second order that has had 1 as its input for ever."""
    level = above.sum() / below.sum()
    last = above[2] - below[2] * level
    return np.array([above[1] - below[1] * level + last, last])
