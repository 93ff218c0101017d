"""Follow the slow part of a noise, and take out of each sample what those before it tell of it."""

from dataclasses import dataclass

import numpy as np
from numba import njit

from opamc_cli.joint.track import Floats, Ints


@dataclass(frozen=True)
class SlowPart:
    """A slow noise: an autoregression of first order.

    Attributes
    ----------
    pole : float
        Correlation of one sample with the next, 0 to 1.
    power : float
        Variance, in units of the fast part's innovations.
    """

    pole: float
    power: float


@dataclass(frozen=True)
class Tracking:
    """A Kalman filter that follows a slow noise through samples that are white but for it.

    Attributes
    ----------
    decay, gain, scale, response : arrays of shape (m,)
        Per sample: what is left of the estimate since the one before, how much of the surprise
        goes into it, one over the surprise's standard deviation, and how much of the slow noise
        the sample holds.

    References
    ----------
    Kalman, Journal of Basic Engineering 82, 1960.
    """

    decay: Floats
    gain: Floats
    scale: Floats
    response: Floats

    @classmethod
    def of(cls, slow: SlowPart, steps: Ints, response: Floats) -> "Tracking":
        """Tune the filter.

        Parameters
        ----------
        slow : SlowPart
            What to follow.
        steps : int array of shape (m,)
            Time since the sample before; 0 where a recording begins.
        response : array of shape (m,)
            What the samples show of a constant.
        """
        decay, gain, scale = _gains(steps, response, slow.pole, slow.power)
        return cls(decay, gain, scale, response)

    def take_out(self, white: Floats) -> None:
        """Take what is predicted of the slow noise out of signals of shape (m, k), in place."""
        for k in range(white.shape[1]):
            _take_out(white[:, k], self.decay, self.gain, self.scale, self.response)


@njit(cache=True, nogil=True)
def _gains(
    steps: Ints, response: Floats, pole: float, power: float
) -> tuple[Floats, Floats, Floats]:
    size = steps.size
    decay, gain, scale = np.zeros(size), np.empty(size), np.empty(size)
    doubt = power
    for i in range(size):
        if steps[i] > 0:
            decay[i] = pole ** steps[i]
            doubt = power + decay[i] * decay[i] * (doubt - power)
        else:
            doubt = power
        spread = 1.0 + response[i] * response[i] * doubt
        gain[i] = doubt * response[i] / spread
        scale[i] = 1.0 / np.sqrt(spread)
        doubt *= 1.0 - gain[i] * response[i]
    return decay, gain, scale


@njit(cache=True, nogil=True)
def _take_out(values: Floats, decay: Floats, gain: Floats, scale: Floats, response: Floats) -> None:
    level = 0.0
    for i in range(values.size):
        level *= decay[i]
        surprise = values[i] - response[i] * level
        level += gain[i] * surprise
        values[i] = surprise * scale[i]
