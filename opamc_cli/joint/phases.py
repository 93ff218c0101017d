"""Angle, speed and torque current from three phase currents alone.

When the torque changes sign, the current vector's angle jumps by pi; the angle of its square
does not. Half of that angle is the electrical angle, and the current along it has a sign.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from opamc_cli.joint.angle_filter import (
    acceleration_noise,
    clean_bandwidth,
    smoothed_angle,
    smoothing_kernel,
    widest_bandwidth,
)
from opamc_cli.joint.normal import solve
from opamc_cli.joint.smoothing import derivatives
from opamc_cli.joint.track import Bools, Floats

STRONG = 5.0
"""A current vector counts where it is longer than this many times its noise."""

LOST_S = 0.015
"""After this long without current the side of the torque axis has to be found again."""

SIDE_ROUNDS = 8
BANDWIDTH_ROUNDS = 2
CARRIER_OVER_BANDWIDTH = 2.0
FEWEST_FAST_SAMPLES = 200
FEWEST_CYCLES = 3
LARGEST_DRIFT = 0.1

NOISIEST_SHARE = 0.1
"""Noise of the acceleration, relative to the acceleration, up to which a sample counts."""

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


def current_vector(phases_a: Floats) -> NDArray[np.complex128]:
    """Clarke vector, amplitude-invariant.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Phase currents a, b, c.

    Returns
    -------
    complex array of shape (n,)
    """
    turn = np.exp(2j * np.pi / 3)
    vector: NDArray[np.complex128] = (
        2 / 3 * (phases_a[:, 0] + turn * phases_a[:, 1] + np.conj(turn) * phases_a[:, 2])
    )
    return vector


def follow_phases(phases_a: Floats, rate_hz: float) -> PhaseAngle:
    """Follow the current vector's angle, modulo pi, through zeros and reversals of the current.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Finite phase currents, n > 16; the electrical frequency below a quarter of the rate.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    PhaseAngle
        Smoothed by `smoothed_angle`.
    """
    vector = current_vector(phases_a)
    length = np.abs(vector)
    # The third harmonic-free sum of three phases is noise alone where sensors have no offset;
    # fourth differences of the vector's length hold no carrier either way.
    noise = float(np.median(np.abs(np.diff(length, 4)))) / 0.6745 / np.sqrt(70.0)
    strong = length > max(STRONG * noise, 0.02 * float(np.quantile(length, 0.95)))
    turns = vector[1:] * np.conj(vector[:-1])
    smooth = _centred_mean(turns, 15)
    weight = _centred_mean(np.abs(turns).astype(np.complex128), 15).real
    coherence = np.abs(smooth) / np.maximum(weight, 1e-300)
    rough = np.concatenate([[0.0], np.angle(smooth)]) * rate_hz
    sure = np.concatenate([[False], coherence > 0.9]) & strong
    bandwidth = widest_bandwidth(rate_hz)
    angle, velocity, acceleration = smoothed_angle(
        np.angle(vector), strong, rough, sure, rate_hz, bandwidth
    )
    fast = strong & (np.abs(velocity) > CARRIER_OVER_BANDWIDTH * 2 * np.pi * bandwidth)
    measured = np.angle(without_sensor_errors(vector, angle, fast))
    angle, velocity, acceleration = smoothed_angle(
        measured, strong, rough, sure, rate_hz, bandwidth
    )
    angle_noise = noise / np.maximum(_centred_mean(length.astype(np.complex128), 15).real, 1e-300)
    typical = float(np.median(angle_noise[strong])) if strong.any() else 0.0
    for _ in range(BANDWIDTH_ROUNDS):
        followed = float(np.var(acceleration[strong])) if strong.any() else 0.0
        followed -= acceleration_noise(typical, rate_hz, bandwidth) ** 2
        narrower = clean_bandwidth(typical, np.sqrt(max(followed, 0.0)), rate_hz)
        if narrower > 0.9 * bandwidth:
            break
        bandwidth = narrower
        angle, velocity, acceleration = smoothed_angle(
            measured, strong, rough, sure, rate_hz, bandwidth
        )
    limit = NOISIEST_SHARE * float(np.std(acceleration[strong])) if strong.any() else 0.0
    per_radian = acceleration_noise(1.0, rate_hz, bandwidth)
    clear = strong & (per_radian * angle_noise <= limit)
    window = int(rate_hz / bandwidth) | 1
    # The measured angle, on the branch that was followed.
    error = np.where(strong, measured - angle, 0.0)
    path = angle + error - np.pi * np.round(error / np.pi)
    blur = np.stack(
        [
            derivatives(path, rate_hz, min(size, (path.size - 1) | 1), 2) - acceleration
            for size in (int(rate_hz / bandwidth / 2) | 1, int(2 * rate_hz / bandwidth) | 1)
        ],
        axis=1,
    )
    kernel = smoothing_kernel(rate_hz, bandwidth)
    return PhaseAngle(angle, velocity, acceleration, strong, clear, window, kernel, blur)


def without_sensor_errors(
    vector: NDArray[np.complex128], angle_rad: Floats, fast: Bools
) -> NDArray[np.complex128]:
    """Take zero errors and unequal gains of the sensors out of a current vector.

    Both show in the flux current, once and twice per electrical revolution; at a low speed the
    followed angle would sway with them.

    Parameters
    ----------
    vector : complex array of shape (n,)
        Clarke vector.
    angle_rad : array of shape (n,)
        Followed angle of the torque axis, modulo pi.
    fast : bool array of shape (n,)
        Samples at which the carrier is faster than the follower.

    Returns
    -------
    complex array of shape (n,)
        The vector itself where too few samples are fast.
    """
    if np.count_nonzero(fast) < FEWEST_FAST_SAMPLES:
        return vector
    rotated = vector[fast] * np.exp(-1j * angle_rad[fast])
    torque, flux, angle = rotated.real, rotated.imag, angle_rad[fast]
    columns = np.stack(
        [
            -np.sin(angle),
            np.cos(angle),
            -torque * np.sin(2 * angle),
            torque * np.cos(2 * angle),
            np.ones(angle.size),
        ],
        axis=1,
    )
    found = solve(columns.T @ columns, columns.T @ flux)
    offset, imbalance = complex(found[0], found[1]), complex(found[2], found[3])
    clean: NDArray[np.complex128] = vector - offset - imbalance * np.conj(vector)
    return clean


def _centred_mean(values: NDArray[np.complex128], width: int) -> NDArray[np.complex128]:
    sums = np.cumsum(np.concatenate([np.zeros(width // 2 + 1), values, np.zeros(width // 2)]))
    means: NDArray[np.complex128] = (sums[width:] - sums[:-width]) / width
    return means


def without_slips(angle: PhaseAngle, period: int, rate_hz: float) -> PhaseAngle:
    """Let the angle of a motion that repeats repeat.

    While the current is too small to be followed, the angle may slip by a multiple of pi. A
    stretch of current has the angle that it had one cycle earlier; in the first cycle, the one
    that follows from the median of all cycles' steps.

    Parameters
    ----------
    angle : PhaseAngle
        As followed.
    period : int
        Samples per cycle.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    PhaseAngle
        As it was where there are fewer than three cycles, or where a cycle ends elsewhere than
        it began by more than a tenth of its travel: that is no slip.
    """
    path = angle.angle_rad
    cycles = path.size // period
    stretches = _stretches(angle.strong, rate_hz)
    if cycles < FEWEST_CYCLES or not stretches:
        return angle
    whole = slice(0, cycles * period)
    steps = np.diff(path, append=path[-1])[whole].reshape(cycles, period)
    course = np.concatenate([[0.0], np.cumsum(np.median(steps, axis=0))])
    if abs(course[-1]) > LARGEST_DRIFT * float(np.ptp(course)):
        return angle
    weak = np.mean(~angle.strong[whole].reshape(cycles, period), axis=0) + 1e-9
    course[1:] -= course[-1] * np.cumsum(weak) / weak.sum()
    repeated = path.copy()
    edges, slips = [0.0], [0.0]
    anchor: float | None = None
    for start, stop in stretches:
        if stop <= period:
            rest = float(np.median(path[start:stop] - course[start:stop]))
            anchor = rest if anchor is None else anchor
            slip = np.pi * np.round((rest - anchor) / np.pi)
        else:
            begin = max(start, period)
            rest = float(np.median(path[begin:stop] - repeated[begin - period : stop - period]))
            slip = np.pi * np.round(rest / np.pi) if begin < stop else 0.0
        repeated[start:] = path[start:] - slip
        edges += [float(start), float(stop)]
        slips += [slip, slip]
    correction = np.interp(np.arange(path.size), edges, slips)
    return replace(angle, angle_rad=path - correction)


def torque_current(
    phases_a: Floats, electrical_rad: Floats, velocity: Floats
) -> tuple[Floats, Floats]:
    """Split the current along and across the electrical angle.

    Parameters
    ----------
    phases_a : array of shape (n, 3)
        Phase currents.
    electrical_rad : array of shape (n,)
        Electrical angle of the torque axis.
    velocity : array of shape (n,)
        Speed; the sign is taken so that the current does work on average: friction resists.

    Returns
    -------
    torque_a, flux_a : arrays of shape (n,)
    """
    rotated = current_vector(phases_a) * np.exp(-1j * electrical_rad)
    torque = rotated.real
    side = 1.0 if float(np.dot(torque, np.sign(velocity))) >= 0 else -1.0
    return side * torque, side * rotated.imag


def side_of_torque(torque_a: Floats, angle: PhaseAngle, rate_hz: float) -> Floats:
    """Find on which side of the torque axis every stretch of current lies.

    Between stretches, where the current is too small to be followed, the angle may slip by pi.
    The sides are those that fit best to dry and lubricant friction, inertia and a smooth function
    of the position: starting from the sides on which the current does work, and from those as
    followed, one stretch after the other is turned where that lowers the squared error.

    Parameters
    ----------
    torque_a : array of shape (n,)
        Current along the followed angle.
    angle : PhaseAngle
        The followed angle.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    array of shape (n,)
        +1 or -1.
    """
    stretches = _stretches(angle.strong, rate_hz)
    if not stretches:
        return np.ones(torque_a.size)
    speed = angle.velocity_rad_s
    moving = angle.strong & (np.abs(speed) > 0.05 * float(np.quantile(np.abs(speed), 0.98)))
    place = angle.angle_rad / max(float(np.ptp(angle.angle_rad)), 1e-9) * 2
    place = place - place.mean()
    columns = np.stack(
        [np.sign(speed), speed, angle.acceleration_rad_s2, *(place**k for k in range(4))], axis=1
    )
    columns /= np.sqrt(np.mean(columns**2, axis=0)) + 1e-300
    sides = []
    grams, moments = [], []
    for start, stop in stretches:
        rows = slice(start, stop)
        part = columns[rows][moving[rows]]
        values = torque_a[rows][moving[rows]]
        work = float(np.dot(values, part[:, 0])) if values.size else 0.0
        sides.append(1.0 if work >= 0 else -1.0)
        grams.append(part.T @ part)
        moments.append(part.T @ values)
    gram, moment = np.array(grams), np.array(moments)
    starts = (np.array(sides), np.ones(len(sides)))
    signs = max((_turned(start, gram, moment) for start in starts), key=lambda found: found[0])[1]
    side = np.ones(torque_a.size)
    for (start, _), sign in zip(stretches, signs, strict=True):
        side[start:] = sign
    return side


def _turned(signs: Floats, gram: Floats, moment: Floats) -> tuple[float, Floats]:
    """Turn one stretch after the other while that explains more; also how much is explained."""
    signs = signs.copy()
    total = gram.sum(axis=0)
    for _ in range(SIDE_ROUNDS):
        turned = False
        for k in range(signs.size):
            coefficients = solve(total - gram[k], signs @ moment - signs[k] * moment[k])
            better = 1.0 if float(coefficients @ moment[k]) >= 0 else -1.0
            turned |= better != signs[k]
            signs[k] = better
        if not turned:
            break
    joint = signs @ moment
    explained = float(solve(total, joint) @ joint)
    # Friction resists: of two mirror images only one has it positive.
    return explained, signs if solve(total, joint)[0] >= 0 else -signs


def lost(strong: Bools, rate_hz: float) -> Bools:
    """Tell where the current was too small, for too long, to carry the followed angle across.

    Parameters
    ----------
    strong : bool array of shape (n,)
        Samples with enough current to tell an angle.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    bool array of shape (n,)
        False also in gaps of up to 15 ms, as where the torque passes zero: the filter bridges them.
    """
    result: Bools = np.ones(strong.size, dtype=bool)
    for start, stop in _stretches(strong, rate_hz):
        result[start:stop] = False
    return result


def _stretches(strong: Bools, rate_hz: float) -> list[tuple[int, int]]:
    """Half-open stretches of strong samples; short gaps are bridged."""
    rows = np.flatnonzero(strong)
    if not rows.size:
        return []
    breaks = np.flatnonzero(np.diff(rows) > max(int(LOST_S * rate_hz), 2))
    starts = [int(rows[0]), *(int(rows[b + 1]) for b in breaks)]
    stops = [*(int(rows[b]) + 1 for b in breaks), int(rows[-1]) + 1]
    return list(zip(starts, stops, strict=True))
