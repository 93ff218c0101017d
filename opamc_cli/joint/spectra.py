"""Order and frequency spectra of a residual, from samples that are uniform in time only."""

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.ndimage import uniform_filter1d

from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.signal.transform.angle_bins import OVERSAMPLING, AngleBins, vertex

FEWEST_SAMPLES = 50
MOST_TIME = 8
"""Pieces of a recording are put on its clock if it is at most so many times as long."""
NYQUIST_SHARE = 0.9
FOLDED, FOLDED_HZ = 4.0, 500.0
"""Times the highest order that is not folded, and frequency at the median speed, up to which lines
are looked for: at 100 Hz half of the kinematic error's speeds fold, and the angle, which is known
at every sample, unfolds them; above some hundred hertz a drive answers little."""
ABOVE_ITS_IMAGE = 1.1
"""At constant speed a line and its folded image are one; that of another order is no stronger."""
LOWEST_ORDER = {"motor": 0.4, "joint": 8.0, "electrical": 0.05}
SURROUNDINGS = 20
"""Resolutions on both sides of a line over which its surroundings are averaged."""
LEAST_LINE = 0.02
"""Share of the residual's power: less than half of what an effect must hold to be added."""


def highest_order(track: Track) -> float:
    """Highest order per turn of the machine angle that is not folded at the median speed."""
    step = np.abs(np.gradient(track.machine_angle_rad))[track.moving]
    typical = float(np.median(step)) if step.size else 0.0
    return NYQUIST_SHARE * np.pi / typical if typical > 0 else 0.0


def highest_folded(track: Track) -> float:
    """Highest order that is looked for where the motion's changes of speed unfold it."""
    highest = highest_order(track)
    # The highest order is what NYQUIST_SHARE of half the rate is at the median speed.
    per_hz = highest / (NYQUIST_SHARE * 0.5 * track.rate_hz)
    return max(highest, min(FOLDED * highest, FOLDED_HZ * per_hz))


def order_spectrum(
    track: Track, residual: Floats, top: float | None = None
) -> tuple[Floats, Floats]:
    """Power of a residual over orders of the machine angle, in units of white noise's power.

    Samples are binned by angle, separately for both directions and for slow and fast motion, so
    that a ripple whose phase depends on either is seen; each class is transformed on its own and
    the powers are added.

    The residual, shape (n,), is zero where samples do not count; `top` is the highest order, that
    which is not folded at the median speed if missing. Orders (cycles per revolution) are
    oversampled four times; each class alone has mean 1 for white noise.
    """
    valid = track.moving & (residual != 0)
    top = highest_order(track) if top is None else top
    if valid.sum() < FEWEST_SAMPLES or top <= 0:
        return np.empty(0), np.empty(0)
    angle = track.machine_angle_rad[valid]
    values = residual[valid]
    speed = np.abs(track.velocity[valid])
    fast = speed > np.median(speed)
    forward = track.velocity[valid] > 0
    angle = angle - angle.min()
    bins = AngleBins.of(float(angle.max()), top)
    power = np.zeros(bins.orders.size)
    for direction in (forward, ~forward):
        for pace in (fast, ~fast):
            members = direction & pace
            energy = float(np.dot(values[members], values[members]))
            if members.sum() >= FEWEST_SAMPLES and energy > 0:
                power += bins.power(angle[members], values[members]) / energy
    return bins.orders, power


def order_lines(
    track: Track, residual: Floats, count: int, lowest: float | None = None
) -> list[tuple[float, float]]:
    """Orders that stand out of the noise with their power, strongest first.

    The `count` strongest peaks, and as many of those that stand out most of their surroundings,
    from the `lowest` on that a gear may have: orders refined by a parabola over the oversampled
    spectrum, at least 1.5 resolutions apart, and their power in units of white noise's, where they
    hold 2 % of the residual's power. The residual, (n,) at the full rate, is 0 where none counts.
    """
    orders, power = order_spectrum(track, residual, highest_folded(track))
    lowest = max(lowest or LOWEST_ORDER[track.angle_kind], 3 * track.order_resolution)
    first = int(np.searchsorted(orders, lowest))
    if orders.size - first < 8:
        return []
    power = power.copy()
    power[:first] = 0
    folded = int(np.searchsorted(orders, highest_order(track)))
    if power[folded:].max(initial=0.0) <= ABOVE_ITS_IMAGE * power[:folded].max():
        orders, power = orders[:folded], power[:folded]
    # A sine that holds a share s of the power shows with half of s times the samples.
    threshold = 0.5 * LEAST_LINE * np.count_nonzero(residual)
    spacing = float(orders[1] - orders[0])
    guard = max(int(1.5 * track.order_resolution / spacing), OVERSAMPLING)
    # What repeats with the motion lifts whole stretches of the spectrum: a line stands out.
    around = uniform_filter1d(power, 2 * SURROUNDINGS * guard + 1, mode="nearest")
    peaks: list[tuple[float, float]] = []
    for weighed in (power.copy(), power / np.maximum(around, 1e-300)):
        for order, _ in peaks:
            place = round(order / spacing)
            weighed[max(place - guard, 0) : place + guard + 1] = 0
        for _ in range(count):
            best = int(np.argmax(np.where(power >= threshold, weighed, 0.0)))
            if power[best] < threshold or weighed[best] <= 0:
                break
            peaks.append((vertex(orders, power, best), float(power[best])))
            weighed[max(best - guard, 0) : best + guard + 1] = 0
    return peaks


def standing_views(track: Track, residual: Floats) -> list[tuple[bool, list[Floats]]]:
    """Signals in which a line of constant frequency stands still.

    The residual itself (False); and, from phases, the residual turned back into their frame (True):
    what a phase picks up turns against the field in the torque current.
    """
    views = [(False, [residual])]
    if "phases" in track.channels and track.electrical_rad is not None:
        field = track.electrical_rad
        views.append((True, [residual * np.cos(field), residual * np.sin(field)]))
    return views


def line_power(track: Track, signals: list[Floats]) -> tuple[Floats, Floats]:
    """Frequencies in Hz, and the mean power of signals over them in units of white noise's.

    Oversampled twice; signals, (n,) each, are zero where samples do not count. The track gives the
    rate, and the time that passes between its recordings or pieces.
    """
    clocked = [_on_the_clock(track, signal) for signal in signals]
    length = next_fast_len(2 * clocked[0].size, real=True)
    powers = [np.abs(rfft(one, length)) ** 2 / max(float(one @ one), 1e-300) for one in clocked]
    power: Floats = np.mean(powers, axis=0)
    return np.arange(power.size) * track.rate_hz / length, power


def _on_the_clock(track: Track, residual: Floats) -> Floats:
    """Put zeros where a track leaves time out, unless that is far more than it holds."""
    if len(track.bounds) == 1:
        return residual
    places = np.round((track.time_s - track.time_s[0]) * track.rate_hz).astype(np.int64)
    if places[-1] >= MOST_TIME * residual.size:
        return residual
    values = np.zeros(places[-1] + 1)
    values[places] = residual
    return values
