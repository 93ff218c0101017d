"""What segments are identified by, and within which limits."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

SAME_PROGRAM = 0.05
"""Relative difference of durations and speeds below which a cycle is another one's motion, whatever
it draws. Of half of its segments: the edges of short ones move with the current."""

SAME_PLACE = 0.02
"""Of the range of a cycle, within which a motion starts and stops at the same place."""

SAME_WAY, LEAST_TURNS = 0.015, 0.5
"""Of the longest way of a cycle, and turns, within which a current vector turns as far. A healthy
motion's turns repeat within 0.2 of 60, or 2.6 of 175 where noise hides the current for a third of
the way; neighbouring strokes of a pallet differ by 1 of 35."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


LINGERS = 1.0
"""Of its duration, by which a motion may last longer where a joint creeps to its place: a cold
night's strokes of a second ended 0.8 s late."""


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
    places_rad: Floats | None = None
    """Where the joint is at each one's start and stop, (n, 2), rad; NaN where not known, None where
    no position is logged."""
    turns: Floats | None = None
    """How far the current vector turns in each, net, turns; None where that is not known."""

    @property
    def way(self) -> Floats:
        """How far each segment goes at most, in turns of its carrier: speed times length."""
        return self.f_max_hz * self.duration_s

    @property
    def leads_by(self) -> str | None:
        """Name of what tells where the segments lead; None if nothing does."""
        known = (name for name in ("places_rad", "turns") if getattr(self, name) is not None)
        return next(known, None)

    def anywhere(self) -> "SegmentFeatures":
        """Return the segments as if nothing were known of where they lead."""
        return replace(self, places_rad=None, turns=None)

    def lead_as(self, others: "SegmentFeatures") -> npt.NDArray[np.bool_]:
        """Tell which segments lead from where to where others of a cycle do; (n, m).

        Where no places are known, which go as far. So does whatever is not known to lead elsewhere.
        """
        if self.places_rad is not None and others.places_rad is not None:
            away = np.abs(self.places_rad[:, np.newaxis] - others.places_rad).max(axis=2)
            return np.asarray(~(away > SAME_PLACE * others.range_rad))
        if self.turns is not None and others.turns is not None and others.turns.size:
            limit = max(SAME_WAY * float(np.abs(others.turns).max()), LEAST_TURNS)
            return np.asarray(np.abs(self.turns[:, np.newaxis] - others.turns) <= limit)
        return np.ones((len(self), len(others)), dtype=bool)

    @property
    def range_rad(self) -> float:
        """How far apart the places are that are known; 0 if none is."""
        known = np.zeros(0) if self.places_rad is None else self.places_rad
        known = known[np.isfinite(known)]
        return float(np.ptp(known)) if known.size else 0.0

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
            None if self.places_rad is None else self.places_rad[indices],
            None if self.turns is None else self.turns[indices],
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
    lingers: float = 0.0
    """Relative difference by which segments may last longer still."""

    def by_lead(self) -> "MatchRule":
        """Return the rule for places of a joint so faulty that it no longer follows its speed."""
        return replace(self, min_similarity=0.0, f_max_tolerance=np.inf)

    def lingering(self) -> "MatchRule":
        """Return the rule for a joint that creeps to some of its places, as a cold one does."""
        return replace(self, lingers=LINGERS, middle_tolerance=SAME_PROGRAM)

    def by_motion(self) -> "MatchRule":
        """Return the rule for a current that is like nothing: a gross fault changes every one."""
        return replace(self, min_similarity=0.0, middle_tolerance=SAME_PROGRAM)
