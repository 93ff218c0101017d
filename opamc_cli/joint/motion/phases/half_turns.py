"""How many half turns the electrical angle makes while there is too little current to see it."""

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
from scipy.ndimage import uniform_filter1d

from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.track import Bools, Floats
from opamc_cli.signal.transform.angle_filter import smoothed_angle

UNSEEN_S = 0.002
"""After this long without current half turns are counted anew: while the torque passes zero and the
joint brakes hard the angle turns unseen. Of 140 simulated recordings (phases at 2 kHz, the panel's
seeds 77000 to 82000) 19 left more than 1.5 times the least error of all values tried at 15 ms, 6 at
4 ms, 3 at 2 ms and at 1 ms."""

LOST_S = 0.015
"""After this long without current nothing is known of the motion in between; at 2 ms as well, the
cause of a change loses samples, and one pair of twelve twice (benchmarks/cause.py, seed 31000)."""

REST_SHARE = 0.03
REST_MARGIN_S = 0.02
"""Speed, relative to working speed, on both sides of a rest, and what makes a gap a long one."""

LIKE = 0.33
"""Of the larger: what speeds beside a gap that is passed evenly differ by at most (noise 0.2)."""

FEWEST_CYCLES = 3
LARGEST_DRIFT = 0.1
AGREED = 2 / 3
"""Share of cycles that agree where they tell what was turned in a gap."""
GUESSED_S = 0.05
"""Without cycles that could agree a longer gap in mid-move is a guess: half are miscounted."""


def bridged(
    measured_rad: Floats,
    strong: Bools,
    rough_rad_s: Floats,
    sure: Bools,
    spread: Floats | None,
    rate_hz: float,
    bandwidth_hz: float,
) -> tuple[Floats, Floats]:
    """Follow an angle that is known modulo pi through long gaps of the current.

    Angle and speed, (n,). As whole waves are resolved in satellite positioning: first the angle may
    change by any amount in every gap, and only speeds and accelerations of both sides tell how it
    goes on. Then each change is set to the nearest multiple of pi: the angle is steady within each
    stretch of current, and on the same branch in all. In a long gap between like speeds the
    joint goes on evenly, between slow ones it rests. Arguments are those of `smoothed_angle`.
    """
    if not strong.any():
        return np.zeros(strong.size), np.zeros(strong.size)
    free = np.zeros(strong.size, dtype=bool)
    free[[start for start, _ in stretches(strong, rate_hz)[1:]]] = True
    follow = partial(smoothed_angle, measured_rad, strong, spread=spread, free=free)
    _, speed, _ = follow(rough_rad_s, sure, rate_hz, bandwidth_hz)
    slow = REST_SHARE * float(np.quantile(np.abs(speed[strong]), 0.95))
    told, known = rough_rad_s.copy(), sure.copy()
    # Samples of a weak current, few and noisy, end no gap; nor does what they say of acceleration
    # carry an angle through it: of a second at 40 rad/s it made 4000 rad.
    dense = uniform_filter1d(1.0 * strong, 2 * int(REST_MARGIN_S * rate_hz) + 1) > 0.5
    for (first, stop), (start, last) in pairwise(stretches(dense, rate_hz, REST_MARGIN_S)):
        half = (start - stop) // 2
        sides = speed[max(first, stop - half) : stop], speed[start : min(last, start + half)]
        before, after = (float(np.median(side)) for side in sides)
        rests = min(max(abs(before), abs(after)), max(abs(speed[[stop - 1, start]]))) < slow
        evenly = abs(after - before) < LIKE * max(abs(before), abs(after))
        if rests or (evenly and half > 2 * rate_hz / bandwidth_hz):
            told[stop:start] = 0.0 if rests else np.linspace(before, after, start - stop)
            known[stop:start] = True
    angle, speed, _ = follow(told, known, rate_hz, bandwidth_hz)
    at = np.flatnonzero(free)
    changes = angle[at] - angle[at - 1] - 0.5 * (speed[at] + speed[at - 1]) / rate_hz
    turns = np.zeros(strong.size)
    turns[at] = np.pi * np.round(changes / np.pi)
    return angle - np.cumsum(turns), speed


def without_slips(angle: PhaseAngle, sure: Bools, period: int | None, rate_hz: float) -> PhaseAngle:
    """Let the angle of a motion that repeats, if it does, repeat, and tell what is a guess.

    While the current is too small to be `sure`, (n,), the angle may slip by a multiple of pi. A
    stretch of current has the angle that it had one cycle earlier; in the first cycle, the one that
    follows from the median of all cycles' steps. The angle stays as it was where there are fewer
    than three cycles, or where a cycle ends elsewhere than it began by more than a tenth of its
    travel, and all by as much: that is no slip.
    """
    path = angle.angle_rad
    pieces = stretches(angle.strong, rate_hz)
    found = None
    if period is not None and path.size >= FEWEST_CYCLES * period and pieces:
        found = _common_course(path, sure, period, rate_hz)
    if period is None or found is None:
        return replace(angle, guessed_s=_unseen(angle, rate_hz))
    course, guessed_s = found
    repeated = path.copy()
    slips, slip, anchor = list[float](), 0.0, None
    # On the way to the first cycle's beginning a joint moves otherwise than one cycle later.
    known = np.where(sure, angle.velocity_rad_s, np.nan)[: 2 * period].reshape(2, period)
    differs = np.abs(known[1] - known[0]) > LARGEST_DRIFT * np.nanmax(np.abs(known), initial=0.0)
    led_in = int(np.max(np.flatnonzero(differs), initial=-1)) + 1
    for start, stop in pieces:
        rest = path[start:stop] - course[np.arange(start, stop) % period]
        rest[: max(led_in - start, 0)] = np.nan
        # A cycle is no whole number of samples: the cycle before is nearer than the first.
        later = np.arange(max(start, period + led_in), max(stop, period + led_in))
        later = later[sure[later - period]]
        if later.size:
            rest = path[later] - repeated[later - period]
            slip = np.pi * np.round(float(np.median(rest)) / np.pi)
        elif np.isfinite(rest).any():
            middle = float(np.nanmedian(rest))
            anchor = middle if anchor is None else anchor
            slip = np.pi * np.round((middle - anchor) / np.pi)
        repeated[start:] = path[start:] - slip
        slips += [slip, slip]
    correction = np.interp(np.arange(path.size), np.ravel(pieces), slips)
    speed = angle.velocity_rad_s - rate_hz * np.gradient(correction) * lost(angle.strong, rate_hz)
    return replace(angle, angle_rad=path - correction, velocity_rad_s=speed, guessed_s=guessed_s)


def _unseen(angle: PhaseAngle, rate_hz: float) -> tuple[float, ...]:
    """Lengths of gaps in the middle of a move of which speeds on both sides tell too little."""
    speed = np.abs(angle.velocity_rad_s)
    slow = REST_SHARE * float(np.quantile(speed[angle.strong], 0.95)) if angle.strong.any() else 0.0
    gaps = pairwise(stretches(angle.strong, rate_hz, GUESSED_S))
    return tuple((b - a) / rate_hz for (_, a), (b, _) in gaps if max(speed[[a - 1, b]]) >= slow)


def _common_course(
    path: Floats, strong: Bools, period: int, rate_hz: float
) -> tuple[Floats, tuple[float, ...]] | None:
    """One cycle of a path that repeats, NaN where few cycles have current, and all gaps guessed.

    From one stretch of current to the next the angle changes by what most cycles say; of a whole
    cycle nothing may be left: that was turned in the gap in which cycles differ most, if no two of
    three agree there, else in the longest; where they do not in two gaps or more, these are all
    guesses. None if more than a tenth of the travel is left and no cycles differ by as much.
    """
    cycles = path.size // period
    folded = path[: cycles * period].reshape(cycles, period)
    current = strong[: cycles * period].reshape(cycles, period)
    common = np.mean(current, axis=0) > 0.5
    anchors = stretches(common, rate_hz)
    if not anchors:
        return None
    steps, doubts = [], []
    places = [(start + stop) // 2 for start, stop in anchors]
    for here, there in zip(places, [*places[1:], places[0] + period], strict=True):
        known = np.flatnonzero(strong[here : path.size - there + here : period]) * period + here
        known = known[strong[known + there - here]]
        changes = path[known + there - here] - path[known] if known.size else np.zeros(1)
        whole = np.round((changes - changes[0]) / np.pi)
        values, counts = np.unique(whole, return_counts=True)
        often = values[counts == counts.max()]
        chosen = often[np.argmin(np.abs(often - np.median(whole)))]
        steps.append(float(np.median(changes[whole == chosen])))
        doubts.append(float(np.ptp(whole)) if counts.max() < AGREED * counts.sum() else 0.0)
    left = float(np.sum(steps))
    heights = np.concatenate([[0.0], np.cumsum(steps)])
    if np.pi * max(doubts) < LARGEST_DRIFT * float(np.ptp(heights)) < abs(left):
        return None
    starts, stops = np.array(anchors).T
    gaps = (np.roll(starts, -1) - stops) % period
    turns = np.pi * np.round(left / np.pi)
    heights[np.lexsort((gaps, doubts))[-1] + 1 :] -= turns
    course = np.full(period, np.nan)
    for (start, stop), place, height in zip(anchors, places, heights, strict=False):
        rows = np.flatnonzero(common[start:stop]) + start
        about = np.where(current[:, [place]], folded - folded[:, [place]], np.nan)[:, rows]
        inside = np.where(current[:, rows], about, np.nan)
        course[rows] = height + np.nanmedian(inside, axis=0)
    guessed = [float(gap) / rate_hz for gap, doubt in zip(gaps, doubts, strict=True) if doubt]
    return course, tuple(guessed) * cycles if len(guessed) > 1 else ()


def lost(strong: Bools, rate_hz: float) -> Bools:
    """Tell where the current was too small, for too long, to carry the followed angle across.

    Of strong samples, bool (n,); gaps of up to `LOST_S` are bridged by the filter.
    """
    result: Bools = np.ones(strong.size, dtype=bool)
    for start, stop in stretches(strong, rate_hz, LOST_S):
        result[start:stop] = False
    return result


def stretches(strong: Bools, rate_hz: float, gap_s: float = UNSEEN_S) -> list[tuple[int, int]]:
    """Half-open stretches of strong samples; gaps of up to `gap_s` do not end them."""
    rows = np.flatnonzero(strong)
    if not rows.size:
        return []
    breaks = np.flatnonzero(np.diff(rows) > max(int(gap_s * rate_hz), 2))
    return [(int(part[0]), int(part[-1]) + 1) for part in np.split(rows, breaks + 1)]
