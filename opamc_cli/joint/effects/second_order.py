"""Filters of second order: what a sprung mass, or a velocity loop, makes of a signal."""

import numpy as np

from opamc_cli.joint.motion.track import Floats

Quadratic = tuple[float, float, float]


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
