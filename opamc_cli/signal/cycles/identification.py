"""Identification of cycles and motions by the similarity of variance vectors."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.cycles.alignment import MISSING, aligned_windows, small
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
    duration, f_d,max and direction, and leads from the same place to the same place, where they are
    known. A window may lack a small segment of the reference, or have one
    more between its motions (`opamc_cli.signal.cycles.alignment`), and is compared without. Of the
    windows that pass, the most that do not overlap are taken, among equally many those with the
    most motions, then those of the largest similarity. What fits nothing stays unidentified.

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
    for k, value in enumerate(sliding_similarity(reference.variance, segments.variance)):
        best_similarity[k : k + n] = np.maximum(best_similarity[k : k + n], value)
    if not n:
        return Identification(cycle, motion, best_similarity)
    windows = _windows(reference, segments, rule)
    similarity = _similarity(reference.variance, segments.variance, windows)
    fits = similarity >= rule.min_similarity
    for index, k in enumerate(_most_windows(windows, fits, similarity)):
        motions = np.flatnonzero(windows[k] != MISSING)
        own = windows[k, motions]
        cycle[own], motion[own] = index, motions
        best_similarity[own] = similarity[k]
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


def fits_shifted(reference: SegmentFeatures, rule: MatchRule) -> bool:
    """Tell whether a cycle fits itself from another motion on, but for where its motions lead."""
    n = len(reference)
    cycle = reference.anywhere()
    agree = _agreeing(cycle, cycle, rule)
    own = np.arange(n)
    return any(agree[(own + shift) % n, own].all() for shift in range(1, n))


def with_cut_cycles(
    reference: SegmentFeatures,
    segments: SegmentFeatures,
    found: Identification,
    rule: MatchRule,
) -> Identification:
    """Add what both ends of a recording hold of a cycle that they cut.

    It goes on from the first and the last motion that is told, for as long as each segment agrees
    with the motion that is due.
    """
    n, told = len(reference), np.flatnonzero(found.motion > UNIDENTIFIED)
    if not told.size:
        return found
    agree = _agreeing(reference, segments, rule)
    cycle, motion, similarity = found.cycle.copy(), found.motion.copy(), found.similarity.copy()
    for last, step in ((int(told[0]), -1), (int(told[-1]), 1)):
        window, due = np.full((1, n), MISSING), motion[last]
        for segment in range(last + step, len(segments) if step > 0 else -1, step)[: n - 1]:
            due = (due + step) % n
            if not agree[segment, due]:
                break
            window[0, due] = segment
        alike = float(_similarity(reference.variance, segments.variance, window)[0])
        if alike >= rule.min_similarity:
            due = np.flatnonzero(window[0] != MISSING)
            if step < 0:
                cycle[cycle > UNIDENTIFIED] += 1
            cut = window[0, due]
            motion[cut], similarity[cut] = due, alike
            cycle[cut] = 0 if step < 0 else cycle.max() + 1
    return Identification(cycle, motion, similarity)


def _agreeing(
    reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule
) -> npt.NDArray[np.bool_]:
    """Tell which segments each by itself could be which motion of the reference; (m, n)."""
    agree = segments.lead_as(reference)
    for have, want, tolerance, more in (
        (segments.duration_s, reference.duration_s, rule.duration_tolerance, rule.lingers),
        (segments.f_max_hz, reference.f_max_hz, rule.f_max_tolerance, 0.0),
    ):
        away = have[:, np.newaxis] - want
        agree &= (-tolerance * want <= away) & (away <= (tolerance + more) * want)
    if rule.use_direction:
        agree &= segments.direction[:, np.newaxis] * reference.direction >= 0
    return agree


def _windows(reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule) -> Ints:
    """Return windows each of whose segments agrees with its reference by itself.

    Shape (k, n), in the order of their first segments: which segment each motion is.
    """
    n, m = len(reference), len(segments)
    agree = _agreeing(reference, segments, rule)
    extra, optional = small(segments, reference), small(reference, reference)
    if extra.any() or optional.any():
        windows = aligned_windows(agree, extra, optional)
    else:
        windows = np.arange(max(m - n + 1, 0))[:, np.newaxis] + np.arange(n)
        windows = windows[agree[windows, np.arange(n)].all(axis=1)]
    there = windows != MISSING
    fits = there.any(axis=1)
    for have, want in (
        (segments.duration_s, reference.duration_s),
        (segments.f_max_hz, reference.f_max_hz),
    ):
        if rule.middle_tolerance is not None:
            beyond = np.abs(have[windows] - want) - rule.middle_tolerance * want
            own = np.where(there, beyond, np.nan)
            fits[fits] &= np.nanmedian(own[fits], axis=1) <= 0
    fitting: Ints = windows[fits]
    return fitting


def _similarity(reference_variance: Floats, variance: Floats, windows: Ints) -> Floats:
    """Cosine similarity of each window with the motions of the reference that it has; (k,)."""
    there = windows != MISSING
    own, wanted = np.where(there, variance[windows], 0.0), np.where(there, reference_variance, 0.0)
    norms = np.linalg.norm(own, axis=1) * np.linalg.norm(wanted, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        similarity = (own * wanted).sum(axis=1) / norms
    return np.clip(np.where(norms > 0, similarity, 0.0), 0.0, 1.0)


def _most_windows(windows: Ints, fits: npt.NDArray[np.bool_], similarity: Floats) -> list[int]:
    """Choose windows that do not overlap: the most, with the most motions, then the most similar.

    Windows, shape (k, n), come in the order of their first segments.
    """
    found = (windows != MISSING).sum(axis=1).tolist()
    stops = windows.max(axis=1, initial=MISSING) + 1
    starts = np.where(windows == MISSING, stops[:, np.newaxis], windows).min(axis=1)
    after = np.searchsorted(starts, stops).tolist()
    # best[k]: windows, motions and total similarity of the best choice among window k and later
    best: list[tuple[int, int, float]] = [(0, 0, 0.0)] * (len(windows) + 1)
    take = [False] * len(windows)
    for k in range(len(windows) - 1, -1, -1):
        best[k] = best[k + 1]
        if fits[k]:
            count, motions, total = best[after[k]]
            with_k = (count + 1, motions + found[k], total + float(similarity[k]))
            # at equal worth the earlier window: cycles count from the recording's start
            if with_k >= (*best[k + 1][:2], best[k + 1][2] - 1e-12):
                best[k], take[k] = with_k, True
    chosen, k = [], 0
    while k < len(windows):
        if take[k]:
            chosen.append(k)
            k = after[k]
        else:
            k += 1
    return chosen
