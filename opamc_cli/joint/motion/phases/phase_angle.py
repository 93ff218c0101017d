"""The electrical angle that phase currents tell, and how it lies beside a logged position."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.motion.track import Bools, Floats
from opamc_cli.signal.transform.least_squares import solve

LONGEST_LAG_S = 0.06
ALIGNMENT_SAMPLES = 2000
ALIGNED = 0.6
LEAST_CONTRAST = 0.97
"""How far, on how many samples and how surely the lag of phases behind a position is sought: 38
recordings of three strangers align by 0.68 or more."""
FAST = 0.3
SLOPE_DOUBT = 0.03
TURNED_RAD = 0.5
MOST_SLOPES = 2000
SPEED_BINS, LAG_BINS = 512, 2048
SETTLING_ROUNDS = 2
"""Share of the top speed, above which speeds tell the ratio; how far it may lie off, and by what
angle over the travel two ratios that are tried differ; how finely speeds and lags are told."""


@dataclass(frozen=True)
class PhaseAngle:
    """Smoothed electrical angle of one recording, and its derivatives."""

    angle_rad: Floats
    velocity_rad_s: Floats
    acceleration_rad_s2: Floats
    """With `angle_rad`, `velocity_rad_s`: electrical; s of shape (n,)."""
    strong: Bools
    clear: Bools
    """With `strong`: samples with enough current to tell an angle, and an acceleration; (n,)."""
    window: int
    """Samples over which it is smooth."""
    kernel: Floats
    """Moving average that the angle and its derivatives have gone through."""
    blur: Floats
    """What the acceleration would gain or lose by a shorter and a longer window; (n, 2)."""
    guessed_s: tuple[float, ...] = ()
    """Lengths of the gaps without current in which nothing tells how much was turned."""

    def aligned_with(
        self, position_rad: Floats, velocity_rad_s: Floats, rate_hz: float
    ) -> tuple[Floats, float, tuple[float, ...]]:
        """Electrical angle from the logged position, with ratio, zero and delay from the phases.

        The angle, (n,), is the phases' own where the position does not follow it. With it come the
        phases' lag behind it, within 60 ms, 0 if unknown, and electrical radians per joint radian.
        """
        rows = np.flatnonzero(self.strong)
        if not rows.size:
            return self.angle_rad, 0.0, ()
        rows = rows[:: max(rows.size // ALIGNMENT_SAMPLES, 1)]
        angle, position, speed = self.angle_rad[rows], position_rad[rows], velocity_rad_s[rows]
        # By the speeds, at which half turns do not count.
        fast = np.abs(speed) > FAST * float(np.quantile(np.abs(speed), 0.95))
        ratios = self.velocity_rad_s[rows][fast] / speed[fast]
        slope = _slope(angle, position, speed, float(np.median(ratios)) if fast.any() else 1.0)
        lag_s = _lag(np.exp(2j * (angle - slope * position)), slope * speed, LONGEST_LAG_S)
        time_s = np.arange(position_rad.size) / rate_hz
        path = slope * np.interp(time_s - lag_s, time_s, position_rad)
        offset = complex(np.mean(np.exp(2j * (angle - path[rows]))))
        if abs(offset) < ALIGNED:
            return self.angle_rad, 0.0, ()
        return path + 0.5 * float(np.angle(offset)), lag_s, (abs(slope),)


def _slope(angle: Floats, position: Floats, speed: Floats, rough: float) -> float:
    """Electrical radians per joint radian at which the angle, modulo pi, follows the position.

    Where the torque passes zero within a stroke the followed angle slips by half turns, so that no
    straight line fits it. Of samples with enough current, (n,); `rough` is right to a few per cent.
    """
    travel = float(np.ptp(position))
    largest = float(np.max(np.abs(speed), initial=0.0))
    if travel <= 0 or largest <= 0:
        return rough
    step = TURNED_RAD / travel
    count = min(int(SLOPE_DOUBT * abs(rough) / step) + 1, MOST_SLOPES // 2)
    slopes = rough + step * np.arange(-count, count + 1)
    # The phasors' transform over speed is their contrast at every lag at once.
    bins = np.round((speed / largest + 1) * (SPEED_BINS // 2 - 1)).astype(np.int64)
    turn = 2 * rough * 2 * largest / SPEED_BINS
    farthest = int(LONGEST_LAG_S * abs(turn) / (2 * np.pi) * LAG_BINS)
    near = np.arange(-min(farthest, LAG_BINS // 2), min(farthest, LAG_BINS // 2) + 1)
    best, highest = rough, -1.0
    for slope in slopes:
        rest = np.exp(2j * (angle - slope * position))
        real = np.bincount(bins, rest.real, SPEED_BINS)
        imaginary = np.bincount(bins, rest.imag, SPEED_BINS)
        height = float(np.abs(np.fft.fft(real + 1j * imaginary, LAG_BINS)[near]).max())
        if height > highest:
            best, highest = float(slope), height
    for _ in range(SETTLING_ROUNDS):
        rest = np.exp(2j * (angle - best * position))
        rest = rest * np.exp(2j * _lag(rest, best * speed, LONGEST_LAG_S) * best * speed)
        turned = 0.5 * np.angle(rest * np.conj(rest.mean()))
        columns = np.stack([position, speed, np.ones(position.size)], axis=1)
        best += float(solve(columns.T @ columns, columns.T @ turned)[0])
    return best


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
