"""The electrical angle that phase currents tell, and how it lies beside a logged position."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.track import Bools, Floats

LONGEST_LAG_S = 0.06
ALIGNMENT_SAMPLES = 2000
ALIGNED = 0.8
LEAST_CONTRAST = 0.97
"""How far, on how many samples and how surely the lag of phases behind a position is sought."""


@dataclass(frozen=True)
class PhaseAngle:
    """Smoothed electrical angle of one recording, and its derivatives.

    Attributes
    ----------
    angle_rad, velocity_rad_s, acceleration_rad_s2 : arrays of shape (n,)
        Electrical.
    strong : bool array of shape (n,)
        Samples with enough current to tell an angle.
    clear : bool array of shape (n,)
        Samples with enough current for an acceleration that is not mostly noise.
    window : int
        Samples over which it is smooth.
    kernel : array of odd length
        Moving average that the angle and its derivatives have gone through.
    blur : array of shape (n, 2)
        What the acceleration would gain or lose by a shorter and a longer window.
    """

    angle_rad: Floats
    velocity_rad_s: Floats
    acceleration_rad_s2: Floats
    strong: Bools
    clear: Bools
    window: int
    kernel: Floats
    blur: Floats

    def aligned_with(
        self, position_rad: Floats, velocity_rad_s: Floats, ratio: float | None, rate_hz: float
    ) -> tuple[Floats, float]:
        """Electrical angle from the logged position, with ratio, zero and delay from the phases.

        Parameters
        ----------
        position_rad, velocity_rad_s : array of shape (n,)
            Joint angle and speed.
        ratio : float or None
            Electrical radians per joint radian, if known.
        rate_hz : float
            Sampling rate.

        Returns
        -------
        electrical_rad : array of shape (n,)
            The phases' own angle where the position does not follow it within half a radian.
        lag_s : float
            By how much the phases come later than the position, within 60 ms; 0 where that
            cannot be told. Filters and loggers make it: at 300 Hz a millisecond is two radians.
        """
        centred = position_rad - position_rad.mean()
        slope = float(np.dot(centred, self.angle_rad) / max(np.dot(centred, centred), 1e-300))
        if ratio is not None:
            slope = float(np.copysign(ratio, slope))
        rows = np.flatnonzero(self.strong)
        if not rows.size:
            return self.angle_rad, 0.0
        rows = rows[:: max(rows.size // ALIGNMENT_SAMPLES, 1)]
        rest = np.exp(2j * (self.angle_rad[rows] - slope * position_rad[rows]))
        speed = slope * velocity_rad_s[rows]
        lag_s = _lag(rest, speed, LONGEST_LAG_S)
        time_s = np.arange(position_rad.size) / rate_hz
        path = slope * np.interp(time_s - lag_s, time_s, position_rad)
        offset = complex(np.mean(np.exp(2j * (self.angle_rad[rows] - path[rows]))))
        if abs(offset) < ALIGNED:
            return self.angle_rad, 0.0
        electrical: Floats = path + 0.5 * float(np.angle(offset))
        return electrical, lag_s


def _lag(rest: NDArray[np.complex128], speed: Floats, longest_s: float) -> float:
    """Lag that turns the phasors `rest` by twice the lag times the speed; the shortest of equals.

    At one speed there and back, lags that differ by half a period look the same.
    """
    step = 0.25 / max(float(np.quantile(np.abs(speed), 0.99)), 0.25 / longest_s)
    count = int(longest_s / step)

    def contrast(lags: Floats) -> Floats:
        return np.array([abs(np.mean(rest * np.exp(2j * lag * speed))) for lag in lags])

    coarse: Floats = step * np.arange(-count, count + 1, dtype=np.float64)
    heights = contrast(coarse)
    equals = coarse[heights > LEAST_CONTRAST * heights.max()]
    nearest = equals[np.argmin(np.abs(equals))]
    fine: Floats = nearest + step * np.linspace(-3, 3, 61)
    return float(fine[np.argmax(contrast(fine))])
