"""A joint that winds up and rings."""

import numpy as np

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.signal.motion.smoothing import derivatives
from opamc_cli.signal.transform.filters import answers

LINK_HZ = 20.0
"""Of a motor on the spring alone whose inertia would be the coefficient: a unit, no more."""
LATE = 0.2
"""Share of the one coefficient by which noise may move the other: of a delay of 16 ms they are as
large, and of opposite signs."""
SHORTEST = 5
"""Samples of a cubic's window."""
MOST_DAMPED = 0.25
"""Of a critical damping of 1: a gear's is below 0.2."""


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
    forms = ("link",)
    meaning = (
        "winding up and ringing of the joint or of its load: check flexspline stiffness, bolts and "
        "belt, and what the load holds loosely"
    )
    as_smoothing = True
    needs = ("position", "logged")
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Resonances from 2 Hz up, three dampings, as far apart as half the power is wide."""
        high = max(0.9 * _highest(track), 2.0)
        motor = [
            {"resonance_hz": resonance, "damping": damping}
            for damping in (0.03, 0.1, 0.2)
            for resonance in geometric(2.0, high, 1 + round(np.log(high / 2) / damping / 2))
        ]
        return [*motor, {"link": 1.0}]

    def first_steps(self, track: Track, parameters: Parameters) -> dict[str, float]:
        """Half as far, or a neighbour tells nothing of the top: damped by 3 %, 40 % is too far."""
        resonance, damping = parameters["resonance_hz"], parameters["damping"]
        return {"resonance_hz": damping * resonance, "damping": 0.4 * damping}

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From slow swaying to what the grid can show; damped more, nothing rings."""
        return {"resonance_hz": (1.0, _highest(track)), "damping": (0.005, MOST_DAMPED)}

    def form_of(self, parameters: Parameters) -> str:
        """Tell from where it is seen."""
        return "link" if parameters.get("link") else ""

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Acceleration of one side less that of the other, and its rate of change."""
        full = track.full or track
        if self.form_of(parameters):
            w, window = 2 * np.pi * LINK_HZ, max(full.kernel.size, SHORTEST) | 1
            paths = [full.acceleration[start:stop] for start, stop in full.bounds]
            bend, rise = (
                np.concatenate([derivatives(path, full.rate_hz, window, order) for path in paths])
                for order in (2, 1)
            )
            return stack(track.own_means(bend / w**2), track.own_means(rise / w))
        w = 2 * np.pi * parameters["resonance_hz"]
        acceleration = full.acceleration
        load, rate = answers([acceleration], w, parameters["damping"], full.rate_hz, full.bounds)
        return stack(track.own_means(load - acceleration), track.own_means(rate))

    def plausible(self, coefficients: Floats, parameters: Parameters) -> bool:
        """Inertia is positive, and damping moves its torque by less than an eighth of a turn.

        What comes later, seen from the link, is a delay; what is damped as much as may be, a lag.
        """
        rings = parameters.get("damping", 0.0) < 0.99 * MOST_DAMPED
        least = -LATE if self.form_of(parameters) else -1.0
        return bool(rings and least * coefficients[0] < coefficients[1] < coefficients[0])


def _highest(track: Track) -> float:
    """Highest resonance that a grid shows, in hertz."""
    return min(60.0, 0.45 * track.rate_hz, (track.full or track).rate_hz / 3)
