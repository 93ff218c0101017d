"""Friction that builds up over some travel after a reversal."""

import numpy as np

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
    meaning = "torque lags behind after reversals: check gear preload and backlash"
    needs = ("position",)
    resists = True
    from_motion = True

    def guesses(self, track: Track, residual: Floats) -> list[Parameters]:
        """Lengths from a hundredth to half of the travel."""
        span = self._span(track)
        return [{"length_rad": length} for length in geometric(span / 100, span / 2, 9)]

    def limits(self, track: Track) -> dict[str, tuple[float, float]]:
        """From a two-hundredth of the travel to all of it."""
        span = self._span(track)
        return {"length_rad": (span / 200, span)}

    def columns(self, track: Track, parameters: Parameters) -> Floats:
        """State of Dahl's model, +-1 where it has settled."""
        state = np.empty(track.size)
        for start, stop in track.bounds:
            state[start:stop] = dahl_state(track.position_rad[start:stop], parameters["length_rad"])
        return stack(state)

    @staticmethod
    def _span(track: Track) -> float:
        return float(np.ptp(track.position_rad[track.moving]))


def dahl_state(position_rad: Floats, length_rad: float) -> Floats:
    """Solve Dahl's equation ``dz/dq = (1 - z sgn(dq)) / length`` along a path, (n,).

    The state lies between -1 and 1 and starts at 0; exact for a path that is monotone between
    samples.
    """
    steps = np.diff(position_rad, prepend=position_rad[:1])
    direction = np.sign(steps)
    # Stand-still keeps the direction of the last move, so that stretches are few.
    index = np.maximum.accumulate(np.where(direction != 0, np.arange(steps.size), 0))
    direction = direction[index]
    edges = np.concatenate([[0], np.flatnonzero(np.diff(direction) != 0) + 1])
    path = np.cumsum(np.abs(steps))
    begun = np.concatenate([[0.0], path[edges[1:] - 1]])
    length = np.diff(begun, append=path[-1:])
    # Only the states at the reversals follow from one another; the rest is one expression.
    before, state = [], 0.0
    for target, decay in zip(
        direction[edges].tolist(), np.exp(-length / length_rad).tolist(), strict=True
    ):
        before.append(state)
        state = target + (state - target) * decay
    counts = np.diff(edges, append=position_rad.size)
    travelled = path - np.repeat(begun, counts)
    away = np.repeat(np.array(before) - direction[edges], counts)
    settled: Floats = direction + away * np.exp(-travelled / length_rad)
    return settled
