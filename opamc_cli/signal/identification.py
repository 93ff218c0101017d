"""Identification of cycles and motions by the similarity of variance vectors."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

UNIDENTIFIED = -1

SAME_PROGRAM = 0.05
"""Relative difference of durations and speeds below which a cycle is another one's motion, whatever
it draws. Of half of its segments: the edges of short ones move with the current."""

REPEATED = 2.0
"""Squared distance of segments, in their spreads, within which a shift repeats a series: of the
true shift it is below 0.01 in a noisy closed loop and up to 1.7 in a joint of the testbed that
hardly draws a current, of others it is 2.1 to 28."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class SegmentFeatures:
    """What identification knows of a series of segments, in time order; each of shape (n,)."""

    variance: Floats
    """Variance of the current, A², > 0."""
    duration_s: Floats
    """Length, s."""
    f_max_hz: Floats
    """Largest fundamental frequency reached, Hz."""
    direction: Ints
    """-1, 0 (unknown) or 1."""
    pause_s: Floats
    """Standstill before the segment, s; NaN where the recording starts too late to know."""

    def __len__(self) -> int:
        """Return the number of segments."""
        return len(self.variance)

    def part(self, start: int, stop: int) -> "SegmentFeatures":
        """Return the segments start..stop (half-open)."""
        return self.take(np.arange(start, stop))

    def take(self, indices: Ints) -> "SegmentFeatures":
        """Return some segments."""
        return SegmentFeatures(
            self.variance[indices],
            self.duration_s[indices],
            self.f_max_hz[indices],
            self.direction[indices],
            self.pause_s[indices],
        )


@dataclass(frozen=True)
class MatchRule:
    """When a series of segments is the reference cycle once more."""

    min_similarity: float = 0.9
    """Least cosine similarity of the variance vectors, 0..1."""
    duration_tolerance: float = 0.35
    f_max_tolerance: float = 0.25
    """With `duration_tolerance`: largest relative difference of each segment from its reference."""
    use_direction: bool = True
    """Whether known directions must agree."""
    middle_tolerance: float | None = None
    """Within which half of the segments have to be."""

    def by_motion(self) -> "MatchRule":
        """Return the rule for a current that is like nothing: a gross fault changes every one."""
        return replace(self, min_similarity=0.0, middle_tolerance=SAME_PROGRAM)


@dataclass(frozen=True)
class Identification:
    """Cycle, motion and similarity of each segment; -1, -1 and its best similarity where none."""

    cycle: Ints
    motion: Ints
    """With `cycle`: shape (n,); counted from 0, -1 where unidentified."""
    similarity: Floats
    """Shape (n,); cosine similarity of the cycle that the segment belongs to, or the largest among
    the windows that hold an unidentified one."""


def sliding_similarity(reference_variance: Floats, variance: Floats) -> Floats:
    """Cosine similarity of the reference's variance vector with every window of segments.

    Parameters
    ----------
    reference_variance
        Shape (n,), A².
    variance
        Shape (m,), A², in time order.

    Returns
    -------
    array
        Shape (max(0, m - n + 1),), 0..1; entry k compares with segments k..k+n.

    Notes
    -----
    Equation (3-2) of the thesis, whose variance lacks the square.
    """
    n = len(reference_variance)
    if len(variance) < n or n == 0:
        return np.empty(0)
    windows = np.lib.stride_tricks.sliding_window_view(variance, n)
    norms = np.linalg.norm(windows, axis=1) * np.linalg.norm(reference_variance)
    with np.errstate(divide="ignore", invalid="ignore"):
        similarity = windows @ reference_variance / norms
    return np.clip(np.where(norms > 0, similarity, 0.0), 0.0, 1.0)


def identify(
    reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule
) -> Identification:
    """Find the reference cycle in a series of segments.

    Variances are positive, so two cycles of alike motions are similar at every shift. A window
    is therefore a cycle only if each of its segments also agrees with its reference in
    duration, f_d,max and direction. Of the windows that pass, the most that do not overlap are
    taken, and among equally many those of the largest similarity. What fits nothing stays
    unidentified.

    Parameters
    ----------
    reference
        One cycle.
    segments
        The series to identify.
    rule
        When a window is a cycle.

    Returns
    -------
    Identification
        Cycle, motion and similarity by segment.
    """
    n, m = len(reference), len(segments)
    cycle = np.full(m, UNIDENTIFIED, dtype=np.int64)
    motion = np.full(m, UNIDENTIFIED, dtype=np.int64)
    best_similarity = np.zeros(m)
    similarity = sliding_similarity(reference.variance, segments.variance)
    for k, value in enumerate(similarity):
        best_similarity[k : k + n] = np.maximum(best_similarity[k : k + n], value)
    fits = (similarity >= rule.min_similarity) & _agreement(reference, segments, rule)
    for index, k in enumerate(_most_windows(fits, similarity, n)):
        cycle[k : k + n] = index
        motion[k : k + n] = np.arange(n)
        best_similarity[k : k + n] = similarity[k]
    return Identification(cycle, motion, best_similarity)


def identify_anywhere(
    reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule
) -> Identification:
    """Find the reference cycle as `identify`, or from a later motion on where it is nowhere whole.

    A recording of a program that goes round and round may begin with any motion and hold no cycle
    from its first to its last one, but every motion.
    """
    found = identify(reference, segments, rule)
    n = len(reference)
    if n == 0 or found.cycle.max(initial=UNIDENTIFIED) > UNIDENTIFIED:
        return found
    best, most = found, (0, 0.0)
    for first in range(1, n):
        order = np.roll(np.arange(n), -first)
        turned = identify(reference.take(order), segments, rule)
        taken = turned.motion > UNIDENTIFIED
        worth = (int(np.count_nonzero(taken)), float(turned.similarity[taken].sum()))
        if worth > most:
            motion = np.where(taken, order[turned.motion], UNIDENTIFIED)
            best, most = replace(turned, motion=motion), worth
    return best


def find_reference(
    segments: SegmentFeatures, rule: MatchRule, segments_per_cycle: int | None = None
) -> tuple[int, int]:
    """Find a reference cycle in a series of segments by its own repetition.

    Parameters
    ----------
    segments
        In time order, at least one.
    rule
        As for `identify`.
    segments_per_cycle
        Motions in a cycle, where known.

    Returns
    -------
    tuple of int
        Half-open interval (start, stop) of segments: the first full cycle.
    """
    n = segments_per_cycle or period(segments)
    n = min(n, len(segments))
    starts = range(len(segments) - n + 1)[: max(n, 1)]
    # the first of the shifts that yield the most cycles; of equal ones, the one after the
    # longest pause: a program waits between its cycles, if anywhere. Where motions are alike, the
    # series may hold more cycles beside a shift than at it: that one would not know itself again
    counts = []
    for start in starts:
        found = identify(segments.part(start, start + n), segments, rule)
        itself = np.array_equal(found.motion[start : start + n], np.arange(n))
        counts.append(int(found.cycle.max(initial=-1)) if itself else UNIDENTIFIED)
    most = [s for s, count in zip(starts, counts, strict=True) if count == max(counts)]
    pauses = [_median_pause(segments.pause_s[s::n]) for s in most]
    start = most[int(np.argmax(pauses))] if _clearly_longer(pauses) else most[0]
    return start, start + n


def period(segments: SegmentFeatures) -> int:
    """Return the smallest number of segments after which the series repeats itself.

    For every shift the squared differences of log variance, log duration, log f_d,max and
    direction are summed, each in units of its own spread over the series, and their median
    taken, so that a few missing or extra segments do not matter. The smallest shift wins whose
    median is within a factor of the best one's. Differences below 5 % count as none. A shift by
    more than half of the series counts where no shorter one repeats it and two pairs are left;
    what nothing repeats is one period.
    """
    m = len(segments)
    if m < 2:
        return max(m, 1)
    columns = []
    for values in (segments.variance, segments.duration_s, segments.f_max_hz):
        logs = np.log(np.maximum(values, 1e-12))
        columns.append(logs / max(float(logs.std()), 0.05))
    turning = segments.direction.astype(np.float64)
    columns.append(2.0 * turning)
    features = np.column_stack(columns)
    distance = np.array(
        [np.median(((features[k:] - features[:-k]) ** 2).sum(axis=1)) for k in range(1, m)]
    )
    by_half, beyond = distance[: m // 2], distance[m // 2 : -1]
    if by_half.min() <= REPEATED:
        return 1 + int(np.argmax(by_half <= max(4.0 * float(by_half.min()), 0.5)))
    if beyond.size and beyond.min() <= REPEATED:
        return 1 + m // 2 + int(beyond.argmin())
    return m


def _median_pause(pauses: Floats) -> float:
    known = pauses[np.isfinite(pauses)]
    return float(np.median(known)) if known.size else 0.0


def _clearly_longer(pauses: list[float]) -> bool:
    # dwell times jitter: a longest pause that is only a little longer says nothing
    ordered = sorted(pauses, reverse=True)
    return len(ordered) > 1 and ordered[0] > 1.5 * ordered[1]


def _agreement(
    reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule
) -> npt.NDArray[np.bool_]:
    """Tell of every window whether each of its segments agrees with its reference by itself."""
    n = len(reference)
    if len(segments) < n or n == 0:
        return np.zeros(0, dtype=bool)

    def windows(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        return np.lib.stride_tricks.sliding_window_view(values, n)

    agree = np.ones((len(segments) - n + 1, n), dtype=bool)
    for have, want, tolerance in (
        (segments.duration_s, reference.duration_s, rule.duration_tolerance),
        (segments.f_max_hz, reference.f_max_hz, rule.f_max_tolerance),
    ):
        difference = np.abs(windows(have) - want)
        agree &= difference <= tolerance * want
        if rule.middle_tolerance is not None:
            beyond = difference - rule.middle_tolerance * want
            agree &= np.median(beyond, axis=1, keepdims=True) <= 0
    if rule.use_direction:
        agree &= windows(segments.direction) * reference.direction >= 0
    return np.asarray(agree.all(axis=1))


def _most_windows(fits: npt.NDArray[np.bool_], similarity: Floats, n: int) -> list[int]:
    """Choose windows that do not overlap: the most of them, then the most similar."""
    m = len(fits)
    # best[k]: (count, total similarity, first chosen window or -1) for windows k and later
    best: list[tuple[int, float]] = [(0, 0.0)] * (m + n + 1)
    take = [False] * m
    for k in range(m - 1, -1, -1):
        best[k] = best[k + 1]
        if fits[k]:
            after = best[min(k + n, m)]
            with_k = (after[0] + 1, after[1] + float(similarity[k]))
            # at equal worth the earlier window: cycles count from the recording's start
            if with_k >= (best[k + 1][0], best[k + 1][1] - 1e-12):
                best[k], take[k] = with_k, True
    chosen, k = [], 0
    while k < m:
        if take[k]:
            chosen.append(k)
            k += n
        else:
            k += 1
    return chosen
