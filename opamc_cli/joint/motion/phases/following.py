"""Angle and speed from three phase currents alone.

When the torque changes sign, the current vector's angle jumps by pi; the angle of its square
does not. Half of that angle is the electrical angle, and the current along it has a sign.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from opamc_cli.joint.motion.phases.half_turns import bridged
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.track import Bools, Floats
from opamc_cli.signal.motion.smoothing import derivatives
from opamc_cli.signal.plausible.sensor_errors import (
    FEWEST_FAST_SAMPLES,
    current_vector,
    rounded,
    without_sensor_errors,
)
from opamc_cli.signal.transform.angle_filter import (
    STRONG,
    acceleration_noise,
    averaged_angle,
    clean_bandwidth,
    smoothed_angle,
    smoothing_kernel,
    widest_bandwidth,
)

WEAKEST_SHARE = 0.02
"""Nor does one count that is shorter than this share of the longest."""

MUCH_SMOOTHER = 0.5
"""Errors that hide the angle make its speed at least three times as rough; where they do not, the
two differ by a few per cent, and from the vector as logged less is taken."""
CLEANING_ROUNDS = 2
"""At most; five leave 71 simulated recordings (the panel's seeds 99000 to 99003) the same."""
BRIDGE_ROUNDS = 2
BANDWIDTH_ROUNDS = 2
CARRIERS_OVER_BANDWIDTH = 2.0, 1.5
"""Electrical frequency, in bandwidths, above which the follower does not sway with the carrier; or
does little, where a joint hardly gets there: a zero error hid what is turned at small torques."""

AGREED = 0.7
"""Of the mean phasor of measured less followed angles: of nine recordings 0.72 at least in all but
a thousandth of the samples, 0.36 at most where single samples in a gap led the follower away."""

NOISIEST_SHARE = 0.1
"""Noise of the acceleration, relative to the acceleration, up to which a sample counts."""


@dataclass(frozen=True)
class _Followed:
    """A current vector with the angle, modulo pi, that was followed along it."""

    vector: NDArray[np.complex128]
    noise: float
    floor: float
    """With `noise`: standard deviation of each component, and length below which none counts."""
    angle: Floats
    fast: Bools
    """Samples at which the carrier is faster than the follower."""
    rough: Floats
    sure: Bools
    spread: Floats | None
    """With `rough`, `sure`: as for `bridged`."""
    roughness: float
    """Mean square of the speed's changes, in units of the speed's."""


def _followed(
    vector: NDArray[np.complex128], start: NDArray[np.complex128], rate_hz: float, bandwidth: float
) -> _Followed:
    """Follow a vector; its noise is that of the one before anything small was taken out of it."""
    length = np.abs(start)
    # The third harmonic-free sum of three phases is noise alone where sensors have no offset;
    # fourth differences of the vector's length hold no carrier either way.
    noise = float(np.median(np.abs(np.diff(length, 4)))) / 0.6745 / np.sqrt(70.0)
    floor = WEAKEST_SHARE * float(np.quantile(length, 0.95))
    length = np.abs(vector)
    strong = length > max(STRONG * noise, floor)
    rough, coherence = _turning(vector, rate_hz)
    sure = (coherence > 0.9) & strong
    local = np.sqrt(np.maximum(uniform_filter1d(length**2, 15, mode="constant"), 1e-300))
    spread = None
    if strong.any():
        spread = np.maximum(float(np.median(local[strong])) / local, 1.0) ** 2
    measured = np.angle(vector)
    angle, speed = bridged(measured, strong, rough, sure, spread, rate_hz, bandwidth)
    carrier = strong * np.abs(speed) / (2 * np.pi * bandwidth)
    fastest = (carrier > least for least in CARRIERS_OVER_BANDWIDTH)
    fast = next((one for one in fastest if one.sum() >= FEWEST_FAST_SAMPLES), carrier > np.inf)
    roughness = float(np.sum(np.diff(speed) ** 2)) / max(float(np.sum(speed**2)), 1e-300)
    return _Followed(vector, noise, floor, angle, fast, rough, sure, spread, roughness)


def follow_phases(phases_a: Floats, rate_hz: float) -> PhaseAngle:
    """Follow the current vector's angle, modulo pi, through zeros and reversals of the current.

    Phase currents, (n, 3), are finite and more than 16; the electrical frequency lies 15 Hz below
    half the rate.
    """
    bandwidth = widest_bandwidth(rate_hz)
    vector = current_vector(phases_a)
    found, other = (_followed(v, v, rate_hz, bandwidth) for v in (vector, rounded(vector)))
    # Beside an error of the sensors the angle sways: the smoother motion is the right one.
    if other.roughness < MUCH_SMOOTHER * found.roughness:
        found = other
    start = found.vector
    for _ in range(CLEANING_ROUNDS):
        before = found.vector
        length = uniform_filter1d(np.abs(before), 15, mode="constant")
        cleaned = without_sensor_errors(before, found.angle, found.fast)
        if float(np.median(np.abs(cleaned - before))) <= found.noise:
            found = replace(found, vector=cleaned)
            break
        found = _followed(cleaned, start, rate_hz, bandwidth)
    rough, sure, noise, angle = found.rough, found.sure, found.noise, found.angle
    for _ in range(BRIDGE_ROUNDS):
        strong, measured = averaged_angle(found.vector, angle, noise, found.floor, rate_hz)
        angle, _ = bridged(measured, strong, rough, sure, found.spread, rate_hz, bandwidth)
    measured = measured - np.pi * np.round((measured - angle) / np.pi)

    def smoothed() -> tuple[Floats, Floats, Floats]:
        return smoothed_angle(measured, strong, rough, sure, rate_hz, bandwidth, turn_rad=0.0)

    def agreeing() -> Bools:
        window = int(rate_hz / bandwidth) | 1
        return strong & (_agreement(measured - angle, strong, window) > AGREED)

    angle, velocity, acceleration = smoothed()
    strong = agreeing()
    angle, velocity, acceleration = smoothed()
    angle_noise = noise / np.maximum(length, 1e-300)
    typical = float(np.median(angle_noise[strong])) if strong.any() else 0.0
    for _ in range(BANDWIDTH_ROUNDS):
        own = float(np.var(acceleration[strong])) if strong.any() else 0.0
        own -= acceleration_noise(typical, rate_hz, bandwidth) ** 2
        narrower = clean_bandwidth(typical, np.sqrt(max(own, 0.0)), rate_hz)
        if narrower > 0.9 * bandwidth:
            break
        bandwidth = narrower
        angle, velocity, acceleration = smoothed()
    limit = NOISIEST_SHARE * float(np.std(acceleration[strong])) if strong.any() else 0.0
    clear = agreeing() & (acceleration_noise(1.0, rate_hz, bandwidth) * angle_noise <= limit)
    window = int(rate_hz / bandwidth) | 1
    path = np.where(strong, measured, angle)
    sizes = [int(times * rate_hz / bandwidth) | 1 for times in (0.5, 2)]
    sizes = [min(size, (path.size - 1) | 1) for size in sizes]
    blur = np.stack([derivatives(path, rate_hz, size, 2) - acceleration for size in sizes], axis=1)
    kernel = smoothing_kernel(rate_hz, bandwidth)
    return PhaseAngle(angle, velocity, acceleration, strong, clear, window, kernel, blur)


def _agreement(apart: Floats, strong: Bools, window: int) -> Floats:
    """How far measured angles agree with the followed one, modulo pi, over a window; 0 to 1."""
    phasors = np.where(strong, np.exp(2j * apart), 0.0)
    known = uniform_filter1d(1.0 * strong, window, mode="constant")
    mean = np.abs(uniform_filter1d(phasors, window, mode="constant"))
    return np.asarray(mean / np.maximum(known, 1e-9))


def _turning(vector: NDArray[np.complex128], rate_hz: float) -> tuple[Floats, Floats]:
    """Angular speed in rad/s from sample to sample, averaged, and how far neighbours agree."""
    turns = vector[1:] * np.conj(vector[:-1])
    smooth = uniform_filter1d(turns, 15, mode="constant")
    weight = uniform_filter1d(np.abs(turns), 15, mode="constant")
    coherence = np.abs(smooth) / np.maximum(weight, 1e-300)
    return np.concatenate([[0.0], np.angle(smooth)]) * rate_hz, np.concatenate([[0.0], coherence])
