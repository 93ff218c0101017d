"""Whether a current comes later against its joint's position than it used to."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP_S = 0.002
"""Of the grid on which courses are compared; a parabola finds what lies between."""
LONGEST_S = 0.12
"""Largest lag that is sought either way, as of the effect `time_delay`."""
BESIDE_S = 0.1
"""Rest beside a stroke that is compared, too: friction starts and ends there."""
SPEED_S = 0.03
"""Over which a speed is taken, one sample at least: over less, steps of a position are noise."""
MOVING = 0.1
"""Share of the highest speed above which a joint is in a stroke."""
SHORTEST_S = 0.1
"""What moves for less is no stroke."""
NEAR = 0.05
"""Of all of the way: strokes that begin and end as near to each other are of one kind. Where a
stroke begins moves with the highest speed of its recording, of a shaking joint by 1 or 2 %."""

FEWEST_RECORDINGS = 3
"""Of the baseline: fewer do not tell how much the lags of healthy ones differ."""
LEAST_S = 0.008
"""Below it a softer gear's shift holds up to 0.70 of what it changes (docs/decision.md)."""
BEYOND = 3.0
"""Times the largest lag of a baseline recording against the others: colder ones have up to 4 ms."""
HELD = 0.7
"""Of what the target's courses differ by: a shift holds 0.54 at most of a gear's fault that moves
the current by `LEAST_S`, and 0.77 or more of a lag of 40 ms (docs/decision.md)."""


@dataclass(frozen=True)
class Course:
    """A recording's mean current along its strokes of one kind, each from the middle of its way."""

    first: float
    last: float
    """Where they begin and end, as a share of all of the way."""
    current: Floats
    """On a grid of `STEP_S`, (n,), about the middle of the way; `LONGEST_S` more at each end."""

    def is_of(self, other: "Course") -> bool:
        """Whether both are of one kind."""
        return abs(self.first - other.first) < NEAR and abs(self.last - other.last) < NEAR


@dataclass(frozen=True)
class Shift:
    """At which shift one side's courses fit another's best."""

    lag_s: float
    """By how much they come later."""
    left: float
    unshifted: float
    """Shares of the mean square that the other's do not hold there (1 - r²), and without shift."""

    @property
    def held(self) -> float:
        """Share of what the courses differ by that the shift holds."""
        return 1 - self.left / self.unshifted if self.unshifted > 0 else 0.0


@dataclass(frozen=True)
class Lag:
    """By how much a target's current comes later than the baseline's."""

    lag_s: float
    """Negative where it comes earlier."""
    of_baseline_s: float
    """Largest modulus of one of the baseline's recordings against the others."""
    share: float
    """Of what the courses differ by: what is gone where the current is moved back."""


def lag_behind(
    baseline: Sequence[Sequence[Course]], target: Sequence[Sequence[Course]]
) -> Lag | None:
    """Tell whether a target's current is the baseline's, only later or earlier.

    A fault of the gear bends the courses; a logger or a bus moves all of them by one time.

    Parameters
    ----------
    baseline, target : sequence of sequences of Course
        Of each recording.

    Returns
    -------
    Lag or None
        None where the lag is no larger than those of the baseline's recordings, or does not hold
        most of what the courses differ by. Of several target recordings the median.
    """
    own = [shift([*baseline[:i], *baseline[i + 1 :]], baseline[i]) for i in range(len(baseline))]
    healthy = [abs(one.lag_s) for one in own if one is not None]
    late = [one for one in (shift(baseline, courses) for courses in target) if one is not None]
    if len(healthy) < FEWEST_RECORDINGS or not late:
        return None
    lag_s = float(np.median([one.lag_s for one in late]))
    share = float(np.median([one.held for one in late]))
    if abs(lag_s) <= max(LEAST_S, BEYOND * max(healthy)) or share < HELD:
        return None
    return Lag(lag_s, max(healthy), share)


def strokes(position: Floats, rate_hz: float) -> list[tuple[int, int]]:
    """Return the samples (start, stop) between which a joint moves one way, half-open."""
    step = max(round(SPEED_S * rate_hz), 1)
    if position.size <= 2 * step:
        return []
    speed = np.zeros(position.size)
    ahead = step // 2
    speed[ahead : position.size - step + ahead] = position[step:] - position[:-step]
    speed[~np.isfinite(speed)] = 0.0
    way = np.where(np.abs(speed) > MOVING * np.abs(speed).max(), np.sign(speed), 0.0)
    edges = np.flatnonzero(np.diff(way, prepend=0.0, append=0.0))
    return [
        (int(start), int(stop))
        for start, stop in pairwise(edges)
        if way[start] and stop - start >= SHORTEST_S * rate_hz
    ]


def courses(current: Floats, position: Floats, rate_hz: float) -> list[Course]:
    """Cut a recording into strokes and average its current along those of one kind.

    Parameters
    ----------
    current : ndarray, shape (n,) or (n, 3)
        Reported current, or three phases (the length of their vector is taken), in A.
    position : ndarray, shape (n,)
        Of the joint, in any unit.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    list of Course
        One for each kind; none where the joint makes no stroke that has samples beside it.
    """
    if current.ndim > 1:
        current = np.sqrt(2 / 3 * (current**2).sum(axis=1))
    lowest, highest = np.nanmin(position, initial=np.inf), np.nanmax(position, initial=-np.inf)
    whole = highest - lowest
    found: list[list[Course]] = []
    time = np.arange(position.size) / rate_hz
    beside = round(BESIDE_S * rate_hz)
    for start, stop in strokes(position, rate_hz):
        part = position[start:stop]
        # a lost sample ends a stroke amid its way
        if not np.isfinite(position[max(start - beside, 0) : stop + beside]).all():
            continue
        first, last = part[0], part[-1]
        along = (part - first) * np.sign(last - first)
        middle = np.interp(abs(last - first) / 2, np.maximum.accumulate(along), time[start:stop])
        half = (stop - start) / 2 / rate_hz + BESIDE_S + LONGEST_S
        grid = middle + STEP_S * np.arange(-round(half / STEP_S), round(half / STEP_S) + 1)
        if grid[0] < 0 or grid[-1] > time[-1]:
            continue
        course = np.interp(grid, time, current)
        if np.isfinite(course).all():
            one = Course((first - lowest) / whole, (last - lowest) / whole, course)
            alike = next((kind for kind in found if kind[0].is_of(one)), None)
            if alike is None:
                found.append([one])
            else:
                alike.append(one)
    return [mean_course(kind) for kind in found]


def mean_course(parts: Sequence[Course]) -> Course:
    """Average courses of one kind about their middles, as far as the shortest goes."""
    half = min(part.current.size for part in parts) // 2
    mean = np.mean([centred(part.current, half) for part in parts], axis=0)
    return Course(parts[0].first, parts[0].last, mean)


def centred(course: Floats, half: int) -> Floats:
    """Return `half` samples on either side of the middle of a course, (n,), and that one."""
    middle = course.size // 2
    return course[middle - half : middle + half + 1]


def shift(reference: Sequence[Sequence[Course]], late: Sequence[Course]) -> Shift | None:
    """Find the shift at which a recording's courses correlate most with others' mean ones.

    All kinds of stroke have one shift, one gain and one offset. Equal correlations: the smallest
    shift in modulus, then the negative one.

    Parameters
    ----------
    reference : sequence of sequences of Course
        Of each of the recordings that are held against.
    late : sequence of Course
        What may come later.

    Returns
    -------
    Shift or None
        None where they have no kind of stroke in common.
    """
    pairs = []
    for course in late:
        alike = [other for courses in reference for other in courses if other.is_of(course)]
        if alike:
            other = mean_course(alike).current
            half = min(course.current.size, other.size) // 2
            pairs.append((centred(course.current, half), centred(other, half)))
    most = round(LONGEST_S / STEP_S)
    if not pairs:
        return None
    # of the course that may be late all but the ends, of the other what lies as much earlier
    own = np.concatenate([course[most : course.size - most] for course, _ in pairs])
    lags = sorted(range(-most, most + 1), key=lambda lag: (abs(lag), lag))
    left = {}
    for lag in lags:
        earlier = [other[most - lag : other.size - most - lag] for _, other in pairs]
        left[lag] = 1 - max(correlation(own, np.concatenate(earlier)), 0.0) ** 2
    best = min(lags, key=left.__getitem__)
    between = 0.0
    if abs(best) < most:
        before, at, after = left[best - 1], left[best], left[best + 1]
        bend = before - 2 * at + after
        between = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return Shift(STEP_S * (best + between), left[best], left[0])


def correlation(one: Floats, other: Floats) -> float:
    """Pearson's, of two courses, (n,) each; 0 of what is constant."""
    x, y = one - one.mean(), other - other.mean()
    size = np.sqrt((x @ x) * (y @ y))
    return float(x @ y / size) if size > 0 else 0.0
