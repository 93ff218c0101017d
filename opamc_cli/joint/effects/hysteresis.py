"""Friction that builds up over some travel after a reversal."""

import numpy as np
from numba import njit

from opamc_cli.joint.effects.base import Effect, Parameters, geometric, stack
from opamc_cli.joint.motion.track import Floats, Track


class Hysteresis(Effect):
    """Dahl's presliding friction: the torque follows the direction over a length of travel.

    References
    ----------
    Dahl, AIAA Journal 14, 1976.
    """

    name = "hysteresis"
    domain = "joint-angle"
    per = ("",)
    searches = ("length_rad",)
    meaning = "torque that lags behind after reversals: check gear preload and backlash"
    resists = True
    builds_up = True
    from_motion = True

    lengths = (1 / 100, 1 / 2, 9)
    """Shares of the travel: the shortest and the longest that is tried, and how many."""

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Lengths of travel."""
        shortest, longest, count = self.lengths
        span = track.travel_rad
        return [{"length_rad": one} for one in geometric(shortest * span, longest * span, count)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From half of the shortest to twice the longest."""
        span = track.travel_rad
        return {"length_rad": (self.lengths[0] * span / 2, self.lengths[1] * span * 2)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """State of Dahl's model, +-1 where it has settled."""
        state = np.empty(track.size)
        for start, stop in track.bounds:
            state[start:stop] = dahl_state(track.position_rad[start:stop], parameters["length_rad"])
        return stack(state)


class AnyHysteresis(Hysteresis):
    """A declared one: a bearing's, too, which is no effect that a joint would lack."""

    lengths = (1 / 5000, 1 / 2, 15)


@njit(cache=True)
def dahl_state(position_rad: Floats, length_rad: float) -> Floats:
    """Solve Dahl's equation ``dz/dq = (1 - z sgn(dq)) / length`` along a path, (n,).

    The state lies between -1 and 1 and starts at 0; exact for a path that is monotone between
    samples.
    """
    states = np.zeros(position_rad.size)
    for n in range(1, position_rad.size):
        step = position_rad[n] - position_rad[n - 1]
        settled = np.sign(step)
        states[n] = settled + (states[n - 1] - settled) * np.exp(-abs(step) / length_rad)
    return states
