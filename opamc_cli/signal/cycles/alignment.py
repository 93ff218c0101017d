"""Windows of segments that are a cycle but for small segments, which one may have and not another.

What a joint does at a stop, creeping into its place or yielding to another joint, is a segment in
one recording and none in the next: it lies at the threshold of what is a motion, wherever that is.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.cycles.features import Ints, SegmentFeatures

MISSING = -1

SMALL = 0.07
"""Way, as a share of the reference's middle one, up to which a segment may be missing or extra.
What creeps at a stop goes 0.5 to 2.3 % of it in simulated cells, 2 to 6.1 % where a measured ball
screw swings back; a program's own motion of a tenth is asked for."""

Bools = npt.NDArray[np.bool_]


def small(segments: SegmentFeatures, reference: SegmentFeatures) -> Bools:
    """Tell which segments go a tiny share of the way that the reference's motions go; (m,)."""
    if not len(reference):
        return np.zeros(len(segments), dtype=bool)
    return segments.way <= SMALL * float(np.median(reference.way))


def aligned_windows(agree: Bools, extra: Bools, optional: Bools) -> Ints:
    """Align the reference cycle with the segments from each one on.

    Parameters
    ----------
    agree
        Shape (m, n): whether a segment could be a motion of the reference.
    extra
        Shape (m,): segments that may stand between motions and be none.
    optional
        Shape (n,): motions that may be missing, of which there are fewer than half.

    Returns
    -------
    array
        Shape (m, n): for each segment the window that begins with it, which is the segment that
        each motion is, `MISSING` where there is none; of possible ones the one with the most
        motions, and of these the one that ends first. All of a row is missing where nothing fits,
        or no more than half of the motions would be there.
    """
    m, n = agree.shape
    windows = np.full((m, n), MISSING, dtype=np.int64)
    begins = agree[:, :1].any(axis=1) | optional[:1].any()
    for start in np.flatnonzero(begins).tolist():
        # by the segment that is next: what each motion so far is
        states: Mapping[int, tuple[int, ...]] = {start: ()}
        for motion in range(n):
            states = _with_motion(states, start, agree[:, motion], extra, bool(optional[motion]))
            if not states:
                break
        if states:
            stop = min(states, key=lambda stop: (-_found(states[stop]), stop))
            if 2 * _found(states[stop]) > n:
                windows[start] = states[stop]
    return windows


def _with_motion(
    states: Mapping[int, tuple[int, ...]],
    start: int,
    agree: Bools,
    extra: Bools,
    optional: bool,
) -> Mapping[int, tuple[int, ...]]:
    following: dict[int, tuple[int, ...]] = {}

    def offer(stop: int, members: tuple[int, ...]) -> None:
        if stop not in following or _found(members) > _found(following[stop]):
            following[stop] = members

    for at, members in states.items():
        if optional:
            offer(at, (*members, MISSING))
        for segment in range(at, len(agree)):
            if agree[segment]:
                offer(segment + 1, (*members, segment))
            # a window begins with a motion: nothing stands before its first one
            if at == start or not extra[segment]:
                break
    return following


def _found(members: tuple[int, ...]) -> int:
    return sum(segment != MISSING for segment in members)
