"""Identification of cycles and motions by the similarity of variance vectors."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.cycles.features import Floats, Ints, MatchRule, SegmentFeatures

UNIDENTIFIED = -1


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
