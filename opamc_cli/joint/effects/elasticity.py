"""A joint that winds up and rings."""

import numpy as np
from scipy.signal import bilinear, lfilter, lfilter_zi

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

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Resonances from 2 Hz to a quarter of the rate, three dampings."""
        high = min(60.0, track.rate_hz / 4)
        return [
            {"resonance_hz": resonance, "damping": damping}
            for damping in (0.03, 0.1, 0.3)
            for resonance in geometric(2.0, high, 22)
        ]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From slow swaying to a quarter of the sampling rate."""
        return {"resonance_hz": (1.0, min(60.0, track.rate_hz / 3)), "damping": (0.005, 0.4)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """Acceleration of the sprung load less that of the motor, and its rate of change."""
        w = 2 * np.pi * parameters["resonance_hz"]
        damping = parameters["damping"]
        # The bilinear transform bends frequencies; start from the bent one.
        w = 2 * track.rate_hz * np.tan(w / (2 * track.rate_hz))
        denominator = [1.0, 2 * damping * w, w * w]
        load = bilinear([-1.0, -2 * damping * w, 0.0], denominator, track.rate_hz)
        rate = bilinear([w, 0.0], denominator, track.rate_hz)
        excess = np.empty(track.size)
        change = np.empty(track.size)
        for start, stop in track.bounds:
            part = track.acceleration[start:stop]
            # As if the first acceleration had lasted for ever: no ringing from the start itself.
            for filtered, taps in ((excess, load), (change, rate)):
                rest = lfilter_zi(*taps) * part[0]
                filtered[start:stop] = lfilter(*taps, part, zi=rest)[0]
        return stack(excess, change)
