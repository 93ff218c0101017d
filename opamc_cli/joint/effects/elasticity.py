"""A joint that winds up and rings."""

import numpy as np
from scipy.signal import lfilter

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.track import Floats, Track


class Elasticity(Effect):
    """Response of a sprung load to the acceleration: what it adds to the rigid model.

    The load side follows ``x'' + 2 d w x' + w^2 (x - q) = 0``; the rigid model's acceleration is
    taken out, so that only ringing and wind-up remain.
    """

    name = "elasticity"
    domain = "acceleration"
    meaning = "the joint winds up and rings: check flexspline stiffness, bolts and the belt"
    needs = ("position", "logged")
    dense_guesses = True
    from_motion = True
    free_refinement = False

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Resonances from 2 Hz to a quarter of the rate, three dampings."""
        high = min(60.0, track.rate_hz / 4)
        return [
            {"resonance_hz": resonance, "damping": damping}
            for damping in (0.03, 0.1, 0.2)
            for resonance in geometric(2.0, high, 22)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From slow swaying to a third of the sampling rate; damped more, nothing rings."""
        return {"resonance_hz": (1.0, min(60.0, track.rate_hz / 3)), "damping": (0.005, 0.25)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Acceleration of the sprung load less that of the motor, and its rate of change."""
        w = 2 * np.pi * parameters["resonance_hz"]
        damping = parameters["damping"]
        # The bilinear transform bends frequencies; start from the bent one.
        w = 2 * track.rate_hz * np.tan(w / (2 * track.rate_hz))
        below = (1.0, 2 * damping * w, w * w)
        load = discrete((-1.0, -2 * damping * w, 0.0), below, track.rate_hz)
        rate = discrete((0.0, w, 0.0), below, track.rate_hz)
        excess = np.empty(track.size)
        change = np.empty(track.size)
        for start, stop in track.bounds:
            part = track.acceleration[start:stop]
            for filtered, (above, poles) in ((excess, load), (change, rate)):
                # As if the first acceleration had lasted for ever: no ringing from the start.
                rest = _at_rest(above, poles) * part[0]
                filtered[start:stop] = lfilter(above, poles, part, zi=rest)[0]
        return stack(excess, change)

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Inertia is positive, and damping moves its torque by less than an eighth of a turn."""
        return bool(coefficients[0] > 0 and abs(coefficients[1]) < coefficients[0])


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


def _at_rest(above: Floats, below: Floats) -> Floats:
    """State of a filter of second order that has had 1 as its input for ever."""
    level = above.sum() / below.sum()
    last = above[2] - below[2] * level
    return np.array([above[1] - below[1] * level + last, last])
