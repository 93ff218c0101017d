"""From the motion signal's frames to motions: thresholds, durations, dips, directions."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion.motion_signal import MotionFrames
from opamc_cli.signal.motion.rotation import Rotation

MIN_CLEAR_FRAMES = 3
SMOOTHED_FRAMES = 3
FRAMES_AT_A_TIME = 65_536
# Largest ratio between the ridge's and the vector's frequency where the two agree: well inside
# the sidebands of a torque ripple twice per motor turn with five pole pairs, 1 ± 2/5.
AGREEMENT = 1.2
# Share of the largest S(t) where the ridge is trusted with the largest frequency.
HIGH_SHARE = 0.8
# Frames of a motion that are looked at to tell whether the next lobe continues it.
RECENT_FRAMES = 256
# Share of a lobe's largest frequency that its ridge still has where a dip begins.
FAST_SHARE = 0.7


@dataclass(frozen=True)
class MotionRule:
    """What counts as a motion."""

    on: float = 0.5
    off: float = 0.3
    """Motion begins where S(t) reaches `on` and lasts while it stays above `off`; 0..1."""
    min_motion_s: float = 0.1
    min_still_s: float = 0.06
    """With `min_motion_s`: a shorter turn the other way is none; shorter standstills belong to the
    motion around them, s."""
    max_dip_s: float = 2.0
    """Longest dip of S(t) inside one motion that is bridged because the carrier is as fast after it
    as before it, s."""


@dataclass(frozen=True)
class Motion:
    """A motion at the resolution of frames."""

    first: int
    last: int
    """With `first`: half-open interval of frames."""
    direction: int
    """Sense of rotation: 1, -1, or 0 where unknown."""
    f_max_hz: float
    """Largest fundamental frequency that lasted, Hz."""
    f_last_hz: float
    """Frequency in the last frame, Hz."""
    n_to_f_last: int
    """Frames from the first one to that in which the frequency first was as high as in the last."""


@dataclass(frozen=True)
class Evidence:
    """What is known of one axis, frame by frame."""

    frames: MotionFrames
    """Motion signal and ridge."""
    rotation: Rotation
    """Rotation of the analytic signal in the same frames."""
    has_direction: bool
    """Whether the rotation's sign means something: true for three phases, false for one."""
    fs_hz: float
    """Sampling rate, Hz."""
    noise_a: float
    """Standard deviation of the noise in each component of the analytic signal, A."""
    f_floor_hz: float
    """Lowest frequency of the motion signal's band, Hz."""

    @property
    def frame_s(self) -> float:
        """Time between frames, s."""
        return self.frames.step / self.fs_hz

    def direction(self, first: int, last: int) -> int:
        """Sense of rotation over the frames first .. last-1."""
        return self.rotation[first:last].direction() if self.has_direction else 0


def hysteresis(strength: NDArray[np.floating], on: float, off: float) -> list[tuple[int, int]]:
    """Half-open intervals that stay above `off` and reach `on` somewhere.

    Parameters
    ----------
    strength : array, shape (n,)
        Motion signal, or any other evidence of motion.
    on, off : float
        Thresholds, off <= on; a value equal to a threshold counts as above it, NaN as below.

    Returns
    -------
    list of (first, last)
        In order, not touching.
    """
    above = np.concatenate([[False], strength >= off, [False]])
    edges = np.flatnonzero(above[1:] != above[:-1])
    first, last = edges[::2], edges[1::2]
    if not first.size:
        return []
    # Noise makes lobes by the hundred thousand: their maxima are taken in one call. Between two
    # lobes the strength is below `off` or NaN, so that it may count with the lobe before it.
    highest = np.fmax.reduceat(strength, first)
    chosen = highest >= on
    return list(zip(first[chosen].tolist(), last[chosen].tolist(), strict=True))


def find_motions(evidence: Evidence, rule: MotionRule) -> list[Motion]:
    """Motions of one axis.

    Parameters
    ----------
    evidence : Evidence
        Motion signal, ridge and rotation.
    rule : MotionRule
        Thresholds and durations.

    Returns
    -------
    list of Motion
        In order, not overlapping.
    """
    clear = clear_motion(evidence, rule)

    def ridge_hz(first: int, last: int) -> NDArray[np.float64]:
        return evidence.frames.ridge_hz[first:last].astype(np.float64)

    def speed_hz(first: int, last: int) -> float:
        """Largest frequency where S(t) is nearly as high as it gets."""
        high = evidence.frames.strength[first:last] * clear[first:last]
        return largest_frequency(ridge_hz(first, last)[high >= HIGH_SHARE * high.max()])

    joined: list[tuple[int, int]] = []
    for high in hysteresis(evidence.frames.strength, rule.on, rule.off):
        for part in _split_by_direction(high, evidence, rule):
            # Noise may pass the threshold for a moment; a carrier is clear for a few frames, and
            # no frame of it is faster than the largest frequency that lasts.
            slow_enough = ridge_hz(*part) < AGREEMENT * speed_hz(*part)
            turning = np.flatnonzero(clear[slice(*part)] & slow_enough)
            if turning.size < MIN_CLEAR_FRAMES:
                continue
            # Slow wavelets are long and still ring after the vector has come to rest.
            lobe = (part[0] + int(turning[0]), part[0] + int(turning[-1]) + 1)
            if joined and _is_one_motion(joined[-1], lobe, evidence, rule, speed_hz):
                joined[-1] = (joined[-1][0], lobe[1])
            else:
                joined.append(lobe)
    motions = []
    for first, last in joined:
        f_last_hz = float(evidence.frames.ridge_hz[last - 1])
        # A few percent less, or noise would put it anywhere in a cruise at constant speed.
        as_fast = clear[first:last] & (ridge_hz(first, last) >= 0.95 * f_last_hz)
        motions.append(
            Motion(
                first,
                last,
                evidence.direction(first, last),
                speed_hz(first, last),
                f_last_hz,
                int(np.argmax(as_fast)),
            )
        )
    return motions


def clear_motion(evidence: Evidence, rule: MotionRule) -> NDArray[np.bool_]:
    """Frames where S(t) is high and the vector turns as fast as the ridge says.

    Noise has a ridge as well, but does not turn along with it; and where the torque is near
    zero, the ripple's sidebands outgrow the carrier, whose frequency the vector still shows.
    """
    clear = evidence.frames.strength >= rule.on
    n = clear.size
    # A shift has millions of frames: only some at a time need their frequencies in memory.
    for start in range(0, n, FRAMES_AT_A_TIME):
        stop = min(start + FRAMES_AT_A_TIME, n)
        first, last = max(start - SMOOTHED_FRAMES, 0), min(stop + SMOOTHED_FRAMES, n)
        smooth = evidence.rotation[first:last].smoothed(SMOOTHED_FRAMES)
        turned_hz = smooth[start - first : stop - first].frequency_hz(evidence.fs_hz)
        ratio = np.abs(turned_hz) / np.maximum(evidence.frames.ridge_hz[start:stop], 1e-9)
        clear[start:stop] &= (ratio > 1 / AGREEMENT) & (ratio < AGREEMENT)
    return clear


def largest_frequency(ridge_hz: NDArray[np.floating], n_lasting: int = 5) -> float:
    """Largest frequency that lasts, of the ridge where the motion is clear.

    A single frame may jump to a harmonic or to noise while the current passes zero; the median of
    its neighbours does not follow it.

    Parameters
    ----------
    ridge_hz : array, shape (n,)
        Ridge in frames of clear motion, Hz.
    n_lasting : int
        Frames over which the median is taken.

    Returns
    -------
    float
        Hz; 0 for no frame at all.
    """
    if not ridge_hz.size:
        return 0.0
    windows = np.lib.stride_tricks.sliding_window_view(ridge_hz, min(n_lasting, ridge_hz.size))
    return float(np.median(windows, axis=1).max())


def standing_time(evidence: Evidence, first: int, last: int) -> float:
    """Time within the frames first .. last-1 for which a clear current does not turn, s.

    A holding torque that stands still proves standstill; a current within the noise proves
    nothing.
    """
    rotation = evidence.rotation[first:last]
    clear = rotation.along > evidence.frames.step * 2 * (3 * evidence.noise_a) ** 2
    stands = np.abs(rotation.frequency_hz(evidence.fs_hz)) < evidence.f_floor_hz
    return float(np.sum(clear & stands) * evidence.frame_s)


def _is_one_motion(
    before: tuple[int, int],
    after: tuple[int, int],
    evidence: Evidence,
    rule: MotionRule,
    speed_hz: Callable[[int, int], float],
) -> bool:
    """Whether the gap between two lobes of S(t) is a dip inside one motion.

    While braking the torque, and with it the current, passes zero, and where gravity drives the
    joint it may stay near zero for long. No joint stops from speed at once: where the carrier is
    fast on both sides of the gap it was fast within, unless a holding torque proves standstill.
    """
    before = (max(before[0], before[1] - RECENT_FRAMES), before[1])
    if evidence.direction(*before) != evidence.direction(*after):
        return False
    gap_s = (after[0] - before[1]) * evidence.frame_s
    if gap_s < rule.min_still_s:
        return True
    if gap_s > rule.max_dip_s or standing_time(evidence, before[1], after[0]) >= rule.min_still_s:
        return False
    ridge_hz = evidence.frames.ridge_hz
    leaving = float(np.median(ridge_hz[max(before[0], before[1] - 3) : before[1]]))
    arriving = float(np.median(ridge_hz[after[0] : min(after[1], after[0] + 3)]))
    return leaving > FAST_SHARE * speed_hz(*before) and arriving > FAST_SHARE * speed_hz(*after)


def _split_by_direction(
    lobe: tuple[int, int], evidence: Evidence, rule: MotionRule
) -> list[tuple[int, int]]:
    """Cut a lobe where the sense of rotation changes for good."""
    if not evidence.has_direction:
        return [lobe]
    first, last = lobe
    n_least = max(1, round(rule.min_motion_s / evidence.frame_s))
    turn = evidence.rotation.turn[first:last]
    sign = np.sign(np.convolve(turn, np.ones(min(n_least, turn.size)), mode="same"))
    cuts = (np.flatnonzero(sign[1:] != sign[:-1]) + 1).tolist()
    parts = [lobe]
    for begin, end in pairwise([*cuts, last - first]):
        turned_back = evidence.direction(parts[-1][0], first + begin) != sign[begin]
        if turned_back and min(end - begin, first + begin - parts[-1][0]) >= n_least:
            parts[-1:] = [(parts[-1][0], first + begin), (first + begin, last)]
    return parts
