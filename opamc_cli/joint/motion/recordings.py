"""From recordings to a session: motion, cycles, groups, and what is sealed."""

from dataclasses import replace

import numpy as np

from opamc_cli.joint.motion.groups import Grouping, group_samples
from opamc_cli.joint.motion.kinematics import SLOWEST_SHARE, Recording, build_track
from opamc_cli.joint.motion.track import Floats, Joint, Track, comes_back
from opamc_cli.signal.cycles.period import cycle_length

SHORTEST_TRAVEL_RAD = 1e-4
FEWEST_MOVING_SAMPLES = 50
MOST_PLACES, PROBED = 40_000, 100
"""Of an arm's places those looked at, and those of which it is asked whether it comes back."""
SAME, MOSTLY = 0.05, 0.5
"""Share of each joint's travel within which a place is the same, and of places that are passed
again."""
ENOUGH_SAMPLES = 200_000
"""Of a logged motion, by which the way to differentiate is chosen: all of 100 s at 2 kHz."""


def grouped_track(recordings: list[Recording], joint: Joint) -> tuple[Track, Grouping | None]:
    """Lay recordings on one grid, in groups; None where too little moves to seal any off."""
    track = build_track(recordings, joint)
    lengths = [cycle_length(*_speeds(track, start, stop)) for start, stop in track.bounds]
    known = [length for length in lengths if length is not None]
    period = round(float(np.median(known))) if known else None
    if period is not None:
        track = replace(track, period_s=period / track.rate_hz)
    track = replace(track, channels=track.channels | _passed_again(track))
    names = tuple(recording.name for recording in recordings)
    return track, group_samples(track.moving, track.bounds, period, track.rate_hz, names)


def _passed_again(track: Track) -> set[str]:
    """Whether its own places are passed again, "returns", and the whole arm's, "revisits"."""
    # From one recording's end to the next one's start a joint has gone, too.
    if not comes_back(track.position_rad):
        return set()
    if track.others is None or not track.moving.any():
        return {"returns", "revisits"}
    beside = track.others[:, : len(track.other_axes)]
    places = np.column_stack([track.position_rad, beside])[track.moving]
    places = places[:: max(len(places) // MOST_PLACES, 1)]
    travel = np.ptp(places, axis=0)
    places = places / np.maximum(travel, max(SLOWEST_SHARE * travel[0], SHORTEST_TRAVEL_RAD))
    way = np.cumsum(np.abs(np.diff(places, axis=0, prepend=places[:1])).max(axis=1))
    passed = [
        np.any((np.abs(places - places[k]).max(axis=1) < SAME) & (np.abs(way - way[k]) > 1.0))
        for k in range(0, len(places), max(len(places) // PROBED, 1))
    ]
    return {"returns", "revisits"} if float(np.mean(passed)) >= MOSTLY else {"returns"}


def _speeds(track: Track, start: int, stop: int) -> list[Floats]:
    """Speed of a recording's joint, and of an arm's other joints that move beside it."""
    own, count = track.velocity[start:stop], len(track.other_axes)
    beside = () if track.others is None else track.others[start:stop, count : 2 * count].T
    return [own, *(other for other in beside if np.std(other) > SLOWEST_SHARE * np.std(own))]


def excerpts(recordings: list[Recording], track: Track) -> list[Recording]:
    """Enough of long recordings to choose by how they are differentiated, from the first motion on.

    Whole ones, evenly picked, and the beginning of one that is too long by itself.
    """
    count = min(max(len(recordings) * ENOUGH_SAMPLES // track.size, 1), len(recordings))
    picks = np.linspace(0, len(recordings) - 1, count).round().astype(int)
    found = []
    for pick in picks:
        start, stop = track.bounds[pick]
        first = max(int(np.argmax(track.moving[start:stop])) - 1, 0)
        long = stop - start > ENOUGH_SAMPLES
        span = slice(first, first + ENOUGH_SAMPLES) if long else slice(None)
        found.append(recordings[pick].cut(span))
    return found


def is_moving(track: Track) -> bool:
    """Tell whether the joint moves at all."""
    moves = np.count_nonzero(track.moving) >= FEWEST_MOVING_SAMPLES
    return bool(moves and np.ptp(track.position_rad) >= SHORTEST_TRAVEL_RAD)
