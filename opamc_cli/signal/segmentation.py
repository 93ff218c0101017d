"""From the motion signal's frames to motions: thresholds, durations, dips, directions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion import MotionFrames
from opamc_cli.signal.rotation import Rotation

MIN_CLEAR_FRAMES = 3


@dataclass(frozen=True)
class MotionRule:
    """What counts as a motion.

    Attributes
    ----------
    on, off : float
        Motion begins where S(t) rises above `on` and lasts while it stays above `off`; 0..1.
    min_motion_s, min_still_s : float
        Shorter motions are dropped; shorter standstills belong to the motion around them, s.
    max_dip_s : float
        Longest dip of S(t) inside one motion that is bridged because the carrier is as fast
        after it as before it, s.
    """

    on: float = 0.5
    off: float = 0.3
    min_motion_s: float = 0.1
    min_still_s: float = 0.06
    max_dip_s: float = 2.0


@dataclass(frozen=True)
class Motion:
    """A motion at the resolution of frames: frames `first` .. `last`-1, half-open.

    Attributes
    ----------
    first, last : int
        Half-open interval of frames.
    direction : int
        Sense of rotation: 1, -1, or 0 where unknown.
    f_max_hz : float
        Largest fundamental frequency that lasted, Hz.
    """

    first: int
    last: int
    direction: int
    f_max_hz: float


def hysteresis(
    strength: NDArray[np.floating], on: float, off: float
) -> list[tuple[int, int]]:
    """Half-open intervals that stay above `off` and reach `on` somewhere.

    Parameters
    ----------
    strength : array, shape (n,)
        Motion signal, or any other evidence of motion.
    on, off : float
        Thresholds, off <= on; values equal to a threshold are above it.

    Returns
    -------
    list of (first, last)
        In order, not touching.
    """
    above = np.concatenate([[False], strength >= off, [False]])
    edges = np.flatnonzero(above[1:] != above[:-1])
    return [
        (int(a), int(b))
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if strength[a:b].max() >= on
    ]


def find_motions(
    frames: MotionFrames,
    rotation: Rotation | None,
    fs_hz: float,
    rule: MotionRule,
    f_floor_hz: float,
) -> list[Motion]:
    """Motions of one axis.

    Parameters
    ----------
    frames : MotionFrames
        Motion signal and ridge.
    rotation : Rotation or None
        Rotation of the current vector in the same frames; None for a single phase.
    fs_hz : float
        Sampling rate, Hz.
    rule : MotionRule
        Thresholds and durations.
    f_floor_hz : float
        Lowest frequency of the motion signal's band, Hz.

    Returns
    -------
    list of Motion
        In order, not overlapping.
    """
    frame_s = frames.step / fs_hz
    ridge_hz = frames.ridge_hz.astype(np.float64)
    clear = frames.strength >= rule.on
    if rotation is not None:
        clear &= rotation.agrees_with(ridge_hz, fs_hz)
    lobes = hysteresis(frames.strength, rule.on, rule.off)
    if rotation is not None:
        lobes = [p for lobe in lobes for p in _split_by_direction(lobe, rotation, rule, frame_s)]
    # Noise may pass the threshold for a moment; a carrier is clear for a few frames at least.
    lobes = [(a, b) for a, b in lobes if clear[a:b].sum() >= MIN_CLEAR_FRAMES]

    def speed_hz(first: int, last: int) -> float:
        return largest_frequency(ridge_hz[first:last][clear[first:last]])

    joined: list[tuple[int, int]] = []
    for lobe in lobes:
        if joined and _is_dip(joined[-1], lobe, rotation, rule, frame_s):
            before, gap_s = joined[-1], (lobe[0] - joined[-1][1]) * frame_s
            fastest = min(speed_hz(*before), speed_hz(*lobe))
            left = float(np.median(ridge_hz[max(before[0], before[1] - 3) : before[1]]))
            right = float(np.median(ridge_hz[lobe[0] : min(lobe[1], lobe[0] + 3)]))
            if gap_s < rule.min_still_s or min(left, right) > max(0.5 * fastest, 2 * f_floor_hz):
                joined[-1] = (before[0], lobe[1])
                continue
        joined.append(lobe)
    return [
        Motion(a, b, 0 if rotation is None else rotation.direction(a, b), speed_hz(a, b))
        for a, b in joined
        if (b - a) * frame_s >= rule.min_motion_s
    ]


def largest_frequency(ridge_hz: NDArray[np.floating]) -> float:
    """Largest frequency that lasts, of the ridge where the motion is clear.

    A single frame may jump to a harmonic or to noise while the current passes zero; the median of
    five neighbours does not follow it.

    Parameters
    ----------
    ridge_hz : array, shape (n,)
        Ridge in frames of clear motion, Hz.

    Returns
    -------
    float
        Hz; 0 for no frame at all.
    """
    if not ridge_hz.size:
        return 0.0
    width = min(5, ridge_hz.size)
    windows = np.lib.stride_tricks.sliding_window_view(ridge_hz, width)
    return float(np.median(windows, axis=1).max())


def _is_dip(
    before: tuple[int, int],
    after: tuple[int, int],
    rotation: Rotation | None,
    rule: MotionRule,
    frame_s: float,
) -> bool:
    turned_back = rotation is not None and rotation.direction(*before) != rotation.direction(*after)
    return not turned_back and (after[0] - before[1]) * frame_s <= rule.max_dip_s


def _split_by_direction(
    lobe: tuple[int, int], rotation: Rotation, rule: MotionRule, frame_s: float
) -> list[tuple[int, int]]:
    """Cut a lobe where the sense of rotation changes for good."""
    first, last = lobe
    n_least = max(1, round(rule.min_motion_s / frame_s))
    smooth = np.convolve(rotation.turn[first:last], np.ones(n_least), mode="same")
    sign = np.sign(smooth)
    cuts = np.flatnonzero(sign[1:] != sign[:-1]) + 1
    parts: list[tuple[int, int]] = []
    begin = 0
    for cut in [*cuts.tolist(), last - first]:
        if parts and (cut - begin < n_least or _same_sense(sign, parts[-1], begin, first)):
            parts[-1] = (parts[-1][0], first + cut)
        else:
            parts.append((first + begin, first + cut))
        begin = cut
    return parts


def _same_sense(
    sign: NDArray[np.floating], part: tuple[int, int], begin: int, first: int
) -> bool:
    return bool(sign[begin] == np.sign(sign[part[0] - first : part[1] - first].sum()))

