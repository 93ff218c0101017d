"""What tells a series that is no cycle of the reference from one: one motion more or less."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import UNIDENTIFIED, identify
from opamc_cli.signal.cycles.reference import find_reference

MOST = 0.5
"""Share of the segments that has to fit then: of two cycles' worth the edges may cut half."""

FEWEST = 3
"""Motions that have to be left: any two may look like two others."""


@dataclass(frozen=True)
class OneOff:
    """The one motion by which the cycles of two series differ."""

    gained: bool
    """Whether the series has one more, or one less."""
    motion: int
    """Its number, from 0, in the reference's cycle if it is lost, in the series' own if gained."""
    duration_s: float
    """How long it lasts there."""


def one_off(
    reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule
) -> OneOff | None:
    """Find the motion without which the series would be cycles of the reference; or None.

    Parameters
    ----------
    reference
        One cycle.
    segments
        A series in which no cycle is found, at least one segment.
    rule
        When a window is a cycle.
    """
    found: list[tuple[tuple[float, float], OneOff]] = []
    if len(reference) > FEWEST:
        for motion, duration_s in enumerate(reference.duration_s.tolist()):
            worth = _worth(_without(reference, [motion]), segments, rule)
            found.append((worth, OneOff(False, motion, duration_s)))
    start, stop = find_reference(segments, rule)
    if stop - start == len(reference) + 1 > FEWEST:
        # counted on into the cycles that the edges have cut
        own = (np.arange(len(segments)) - start) % (stop - start)
        for motion, duration_s in enumerate(segments.duration_s[start:stop].tolist()):
            rest = _without(segments, np.flatnonzero(own == motion).tolist())
            found.append((_worth(reference, rest, rule), OneOff(True, motion, duration_s)))
    (share, _), best = max(found, key=lambda one: one[0], default=((0.0, 0.0), None))
    return best if share >= MOST else None


def _without(segments: SegmentFeatures, which: list[int]) -> SegmentFeatures:
    return segments.take(np.delete(np.arange(len(segments)), which))


def _worth(
    reference: SegmentFeatures, segments: SegmentFeatures, rule: MatchRule
) -> tuple[float, float]:
    """Share of segments that fit, and how near their durations are: motions may be alike."""
    motion = identify(reference, segments, rule).motion
    fits = motion > UNIDENTIFIED
    ratios = segments.duration_s[fits] / reference.duration_s[motion[fits]]
    return float(np.mean(fits)), -float(np.abs(np.log(ratios)).sum())
