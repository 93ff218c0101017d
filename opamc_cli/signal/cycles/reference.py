"""Reference cycle of a series of segments, by its own repetition."""

import numpy as np

from opamc_cli.signal.cycles.alignment import small
from opamc_cli.signal.cycles.features import Floats, Ints, MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import UNIDENTIFIED, identify

MOSTLY = 0.9
"""Share of the pairs of segments that lead to the same places where a shift repeats a series."""

REPEATED = 2.0
"""Squared distance of segments, in their spreads, within which a shift repeats a series: of the
true shift it is below 0.01 in a noisy closed loop and up to 1.7 in a joint of the testbed that
hardly draws a current, of others it is 2.1 to 28."""


def find_reference(
    segments: SegmentFeatures, rule: MatchRule, segments_per_cycle: int | None = None
) -> tuple[int, int]:
    """Find a reference cycle in a series of segments by its own repetition.

    Small segments that are not in every cycle hide the repetition: where the others, looked at
    alone, tell more of themselves, theirs is the cycle.

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
    found = _repeating(segments, rule, segments_per_cycle)
    large = np.flatnonzero(~small(segments, segments))
    if segments_per_cycle or large.size == len(segments):
        return found
    start, stop = _repeating(segments.take(large), rule, None)
    own = int(large[start]), int(large[stop]) if stop < large.size else int(large[-1]) + 1
    (told, regular), (of_large, _) = (_told(segments, large, cycle, rule) for cycle in (found, own))
    # small ones that are always there may tell apart two halves of a program
    return own if of_large > told or (of_large == told and not regular) else found


def _told(
    segments: SegmentFeatures, which: Ints, cycle: tuple[int, int], rule: MatchRule
) -> tuple[float, bool]:
    """Share of some segments that a cycle tells, and whether none is extra or missing.

    None if it finds itself alone, or not itself.
    """
    start, stop = cycle
    found = identify(segments.part(start, stop), segments, rule)
    itself = np.array_equal(found.motion[start:stop], np.arange(stop - start))
    if not itself or found.cycle.max() < 1:
        return 0.0, False
    told = found.cycle > UNIDENTIFIED
    within = np.flatnonzero(told)
    extra = not told[within[0] : within[-1]].all()
    missing = np.count_nonzero(told) < (stop - start) * (found.cycle.max() + 1)
    return float(np.mean(told[which])), not extra and not missing


def _repeating(
    segments: SegmentFeatures, rule: MatchRule, segments_per_cycle: int | None
) -> tuple[int, int]:
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
    if segments.leads_by:
        same = segments.lead_as(segments)
        elsewhere = [np.mean(np.diagonal(same, -k)) < MOSTLY for k in range(1, m)]
        distance[np.array(elsewhere)] = np.inf
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
