"""A long recording's groups by a sample of them: a track of its own, of bounded size."""

from collections.abc import Sequence

import numpy as np

from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.track import Bools, Track, excerpt

MOST_SAMPLES = 30_000
"""Of more moving samples parts, evenly spread over open and sealed groups alike, stand for all.
With 50 000 a minute takes 1.4 times as long, and as many hidden effects are named (30 of 34)."""
FEWEST_GROUPS = 12
"""What happens at some time is consistent over groups only if there are some on both sides."""
LEAD_S = 1.0
"""Before each piece, so that what has a memory (wind-up, hysteresis, a drive's answer from 1 Hz on)
has settled: of two minutes' error 2 s leave as much to five digits, and take a fifth longer."""
TAIL_S = 0.15
"""After each piece, so that a delayed current finds its motion."""

Pieces = list[tuple[int, int]]


def thinned(
    track: Track, grouping: Grouping, groups: Sequence[int], most: int = MOST_SAMPLES
) -> Pieces:
    """Let a sample of some groups stand for all of them in a long recording.

    Cycles are taken whole: a part of a cycle is not like the rest. Of recordings and blocks the
    first and the last part is taken, so that whatever changes at some time is seen on its own side
    of a sealed neighbour. The half-open pieces hold some `most` moving samples times these groups'
    share, more where whole cycles are long.
    """
    member = track.moving & (track.group >= 0)
    share = most / max(int(np.count_nonzero(member)), 1)
    sizes = np.bincount(track.group[member], minlength=len(grouping.names))
    count = min(max(int(len(groups) * share), FEWEST_GROUPS), len(groups))
    whole = grouping.kind == "cycles"
    picks = [groups[i] for i in np.linspace(0, len(groups) - 1, count).round().astype(int)]
    budget = share * float(sizes[list(groups)].sum()) / len(picks)
    pieces: Pieces = []
    for group in picks:
        rows = np.flatnonzero(member & (track.group == group))
        half = int(budget / 2)
        taken = [rows] if whole or rows.size <= 2 * half else [rows[:half], rows[-half:]]
        pieces += [(int(some[0]), int(some[-1]) + 1) for some in taken]
    return pieces


def cut(track: Track, pieces: Pieces) -> Track:
    """Cut half-open pieces, ascending, out of a track, with their surroundings, in no group."""
    inside: Bools = np.zeros(track.size, dtype=bool)
    spans: Pieces = []
    for start, stop in pieces:
        inside[start:stop] = True
        first, last = next(bound for bound in track.bounds if bound[0] <= start < bound[1])
        lead, tail = int(LEAD_S * track.rate_hz), int(TAIL_S * track.rate_hz)
        span = max(start - lead, first), min(stop + tail, last)
        if spans and span[0] <= spans[-1][1]:
            spans[-1] = (spans[-1][0], max(span[1], spans[-1][1]))
        else:
            spans.append(span)
    return excerpt(track, inside, tuple(spans))
