"""A joint that winds up and rings."""

import numpy as np
from numba import njit

from opamc_cli.joint.effects.base import Effect, Parameters, geometric
from opamc_cli.joint.effects.second_order import discrete
from opamc_cli.joint.motion.track import Floats, Track


class Elasticity(Effect):
    """Response of a sprung load to the acceleration: what it adds to the rigid model.

    The load side follows ``x'' + 2 d w x' + w^2 (x - q) = 0``; the rigid model's acceleration is
    taken out, so that only ringing and wind-up remain. On an averaged grid the full rate's
    acceleration is filtered, then averaged: with a coarse encoder the blocks are not much shorter
    than the joint's period.
    """

    name = "elasticity"
    domain = "acceleration"
    per = ("rad/s²",)
    searches = ("resonance_hz", "damping")
    meaning = "the joint winds up and rings: check flexspline stiffness, bolts and the belt"
    as_smoothing = True
    needs = ("position", "logged")
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Resonances from 2 Hz up, three dampings."""
        high = 0.9 * _highest(track)
        return [
            {"resonance_hz": resonance, "damping": damping}
            for damping in (0.03, 0.1, 0.2)
            for resonance in geometric(2.0, high, 22)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From slow swaying to what the grid can show; damped more, nothing rings."""
        return {"resonance_hz": (1.0, _highest(track)), "damping": (0.005, 0.25)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Acceleration of the sprung load less that of the motor, and its rate of change."""
        w = 2 * np.pi * parameters["resonance_hz"]
        damping = parameters["damping"]
        full = track.full or track
        # The bilinear transform bends frequencies; start from the bent one.
        w = 2 * full.rate_hz * np.tan(w / (2 * full.rate_hz))
        below = (1.0, 2 * damping * w, w * w)
        load, poles = discrete((-1.0, -2 * damping * w, 0.0), below, full.rate_hz)
        rate, _ = discrete((0.0, w, 0.0), below, full.rate_hz)
        factor = round(full.rate_hz / track.rate_hz)
        means = np.empty((2, track.size))
        begin = 0
        for start, stop in full.bounds:
            end = begin + (stop - start) // factor
            _filter_and_average(
                full.acceleration[start:stop], load, rate, poles, factor, means[:, begin:end]
            )
            begin = end
        return means.T

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Inertia is positive, and damping moves its torque by less than an eighth of a turn."""
        return bool(coefficients[0] > 0 and abs(coefficients[1]) < coefficients[0])


def _highest(track: Track) -> float:
    """Highest resonance that a grid shows, in hertz."""
    if track.full is None:
        return min(60.0, track.rate_hz / 3)
    return min(60.0, 0.45 * track.rate_hz, track.full.rate_hz / 3)


@njit(cache=True, nogil=True)
def _filter_and_average(
    values: Floats, first: Floats, second: Floats, poles: Floats, factor: int, means: Floats
) -> None:
    """Put a signal through two filters with the same poles, and average the outcomes over blocks.

    Parameters
    ----------
    values : array of shape (n,)
        As if the first had lasted for ever: no ringing from the start.
    first, second, poles : arrays of shape (3,)
        Coefficients of 1, 1/z and 1/z^2; `poles` begins with 1.
    factor : int
        Samples per block.
    means : array of shape (2, n // factor)
        Filled with the means of both outcomes.
    """
    last = values[0] / (1.0 + poles[1] + poles[2])
    before = last
    for block in range(means.shape[1]):
        one = two = 0.0
        for i in range(block * factor, (block + 1) * factor):
            state = values[i] - poles[1] * last - poles[2] * before
            one += first[0] * state + first[1] * last + first[2] * before
            two += second[0] * state + second[1] * last + second[2] * before
            before = last
            last = state
        means[0, block] = one / factor
        means[1, block] = two / factor
