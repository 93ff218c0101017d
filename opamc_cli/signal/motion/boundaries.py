"""Where exactly a motion starts and stops, read from the angle of the current vector.

The motion signal needs a few carrier periods to rise, and a carrier of very low frequency is no
carrier yet: its threshold is crossed when the joint already turns. The vector's angle tells more:
at standstill it keeps its value, whatever the torque does, up to the jump by π when the torque
changes sign. The angle of its square does not jump.
"""

import numpy as np
from numpy.typing import NDArray

SMOOTHING_S = 0.004  # a quarter period at 60 Hz, faster than any carrier that just begins to turn
LEAST_TURN_RAD = 0.12  # the least turn that counts as leaving standstill
# A smaller current at standstill may be the sensors' offset, which has an angle of its own.
MIN_HOLDING_SHARE = 0.15
# Drives settle after a stop: what is left of the current is not motion.
REST_SHARE = 0.1
STAY_S = 0.025  # a quarter period at 10 Hz
CLEAR_TURN_RAD = 1.5  # the turn up to which the angle is followed


def refine_boundaries(
    current: NDArray[np.inexact],
    start: int,
    stop: int,
    fs_hz: float,
    noise_a: float,
    n_to_f_last: int | None = None,
) -> tuple[int, int]:
    """Move coarse boundaries outwards to where the vector leaves and reaches standstill.

    With one phase only there is no angle near standstill: there the boundary is where the
    current leaves and reaches its standstill value, be it by rotation or by torque.

    Parameters
    ----------
    current : array, shape (n,), A
        Current vector (complex), or a single phase current (real), of the motion with the
        standstill before and after it, up to the middle of the gap to the neighbouring motions,
        or the recording's ends.
    start, stop : int
        Coarse boundaries within `current`, half-open; the joint turns at both.
    fs_hz : float
        Sampling rate, Hz.
    noise_a : float
        Standard deviation of the noise in each component of `current`, A.
    n_to_f_last : int or None
        Samples from `start` to where the carrier first was as fast as at `stop`; given if it is
        still fast there.

    Returns
    -------
    tuple of int
        Refined (start, stop), half-open, start <= the coarse one, stop >= the coarse one. A
        boundary with too little standstill beside it to compare with is returned as it was.
    """
    middle = (start + stop) // 2
    amplitude_a = float(np.median(np.abs(current[start:stop])))
    # Backwards in time a stop is a start.
    before, after = current[:middle], current[middle:][::-1]
    onset = _onset if np.iscomplexobj(current) else _departure
    refined_start = onset(before, start, fs_hz, noise_a, amplitude_a)
    n_rest = current.size - stop
    if n_to_f_last is not None and not _is_held(after[: int(0.4 * n_rest)], amplitude_a):
        # The carrier is lost at speed: friction does the braking, the current is near zero, and
        # so it stays. A joint brakes as it accelerates, for all that is known.
        return refined_start, min(current.size, stop + start + n_to_f_last - refined_start)
    return refined_start, current.size - onset(after, n_rest, fs_hz, noise_a, amplitude_a)


def _is_held(rest: NDArray[np.inexact], amplitude_a: float) -> bool:
    """Whether a holding torque stands out from what a sensor's offset may be."""
    return rest.size > 0 and float(np.abs(np.mean(rest))) >= MIN_HOLDING_SHARE * amplitude_a


def _departure(
    x: NDArray[np.inexact], coarse: int, fs_hz: float, noise_a: float, amplitude_a: float
) -> int:
    """Sample at which a single current leaves its standstill value, at most `coarse`."""
    width = max(1, round(SMOOTHING_S * fs_hz))
    n_rest = int(0.4 * coarse)
    if n_rest < 2 * width:
        return coarse
    smooth = _moving_mean(x[:coarse], width)
    limit = max(5 * noise_a / np.sqrt(width), LEAST_TURN_RAD * amplitude_a)
    away = np.abs(smooth - np.median(smooth[:n_rest])) > limit
    return _last_stay(~away, coarse, fs_hz)


def _weighted_line(
    t: NDArray[np.int_], y: NDArray[np.floating], weight: NDArray[np.floating]
) -> tuple[float, float]:
    """Slope and intercept of the line through (t, y) of least weighted squares."""
    w = weight * weight
    w = w / w.sum()
    t_mean, y_mean = float(w @ t), float(w @ y)
    slope = float(w @ ((t - t_mean) * (y - y_mean))) / float(w @ (t - t_mean) ** 2)
    return slope, y_mean - slope * t_mean


def _last_stay(at_rest: NDArray[np.bool_], coarse: int, fs_hz: float) -> int:
    """End of the last standstill before `coarse`.

    A current that oscillates, or changes its sign while braking, passes its standstill value
    again and again, but does not stay.
    """
    n_stay = round(STAY_S * fs_hz)
    if coarse < n_stay:
        return coarse
    stays = np.lib.stride_tricks.sliding_window_view(at_rest[:coarse], n_stay).all(axis=1)
    ends = np.flatnonzero(stays) + n_stay
    return int(ends[-1]) if ends.size else coarse


def _onset(
    z: NDArray[np.inexact],
    coarse: int,
    fs_hz: float,
    noise_a: float,
    amplitude_a: float,
) -> int:
    """Sample at which a vector that stands at first begins to turn, at most `coarse`."""
    width = max(1, round(SMOOTHING_S * fs_hz))
    n_rest = int(0.4 * coarse)
    if n_rest < 2 * width:
        return coarse
    end = min(z.size, coarse + round(0.1 * fs_hz))
    smooth = _moving_mean(z[:end], width)
    noise = max(noise_a / np.sqrt(width), 1e-12)

    rest = smooth[:n_rest]
    reference = complex(np.mean(rest * rest))
    if np.sqrt(abs(reference)) < max(3 * noise, MIN_HOLDING_SHARE * amplitude_a):
        # Without current at standstill the motion begins where the current does.
        limit = max(4 * noise, REST_SHARE * amplitude_a)
        at_rest = np.abs(smooth - np.mean(rest)) < limit
        return _last_stay(at_rest, coarse, fs_hz)
    weak = max(2.5 * noise, REST_SHARE * amplitude_a)
    turned = _turn_since(smooth, reference, weak)
    least = max(LEAST_TURN_RAD, 4 * noise / float(np.sqrt(abs(reference))))
    return _extrapolate(turned, np.abs(smooth), least, coarse)


def _turn_since(
    smooth: NDArray[np.inexact], reference: complex, weak: float
) -> NDArray[np.float64]:
    """Angle turned since standstill, rad, from the squared vector; positive on the whole."""
    doubled = np.angle(smooth * smooth * np.conj(reference))
    # While the torque passes zero the vector has the angle of what is left, noise and the
    # sensors' offset: it is bridged.
    known = np.flatnonzero(np.abs(smooth) > weak)
    if known.size < 2:
        return np.zeros(smooth.size)
    followed = np.unwrap(doubled[known]) / 2
    turned = np.interp(np.arange(smooth.size), known, followed)
    forward: NDArray[np.float64] = turned * np.sign(turned[-1])
    return forward


def _extrapolate(
    turned: NDArray[np.float64], weight: NDArray[np.floating], least: float, coarse: int
) -> int:
    """Trace the turn back to zero: as t^2 (constant acceleration) or t^3 (constant jerk)."""
    clear = max(CLEAR_TURN_RAD, 4 * least)
    below_clear = np.flatnonzero(turned[:coarse] < clear)
    t_clear = int(below_clear[-1]) + 1 if below_clear.size else 0
    t_clear = min(t_clear, turned.size - 1)
    below_least = np.flatnonzero(turned[:t_clear] < least)
    t_least = int(below_least[-1]) + 1 if below_least.size else 0
    if t_clear - t_least < 4:
        return min(t_least, coarse)
    t = np.arange(t_least, t_clear)
    y = np.maximum(turned[t_least:t_clear], 1e-6)
    w = weight[t_least:t_clear]
    best = (np.inf, float(t_least))
    for power in (2, 3):
        slope, intercept = _weighted_line(t, y ** (1 / power), w)
        if slope <= 0:
            continue
        zero = -intercept / slope
        misfit = float(np.sum((w * (y - np.maximum(slope * (t - zero), 0) ** power)) ** 2))
        best = min(best, (misfit, zero))
    earliest = t_least - 1.5 * (t_clear - t_least)
    return int(np.clip(round(best[1]), max(0, earliest), min(t_least, coarse)))


def _moving_mean(x: NDArray[np.inexact], width: int) -> NDArray[np.inexact]:
    kernel = np.full(width, 1 / width)
    return np.convolve(x, kernel, mode="same")
