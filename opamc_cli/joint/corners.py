"""Where the motion changes faster than its smoothing can follow.

A coarse encoder asks for a long window. Where the acceleration has a corner, the window rounds it
off, and the inertia's current is left over: broad in frequency, the same in every cycle, and well
fitted by sines of the angle or of time. Fast effects are looked for elsewhere.
"""

import numpy as np

from opamc_cli.joint.track import Bools, Floats, Track, averaged

LARGEST_LACK = 0.3
"""Standard deviations of the noise that the smoothing may take from a sample that counts."""


def clear_of_corners(track: Track) -> Bools | None:
    """Tell the samples at which the smoothing of the motion takes less than the noise.

    What the window takes from the acceleration is about what it would take a second time (Tukey's
    twicing). How much current that is, is fitted to the current less its own moving average, which
    holds what the window takes, and noise.

    Parameters
    ----------
    track : Track
        At the full rate.

    Returns
    -------
    bool array of shape (n,) or None
        None where every sample counts.
    """
    if track.kernel.size == 1:
        return None

    def taken(values: Floats) -> Floats:
        return values - averaged(values, track.bounds, track.kernel)

    rows = track.moving & (track.group >= 0)
    lack = taken(track.acceleration)
    energy = float(lack[rows] @ lack[rows])
    if energy <= 0:
        return None
    fast = taken(track.current_a)
    lack *= float(lack[rows] @ fast[rows]) / energy
    noise = float(np.median(np.abs(fast - lack)[rows])) / 0.6745
    # At the corner itself nothing is taken, on its two sides the more.
    spoilt = _spread(np.abs(lack) > LARGEST_LACK * noise, track.bounds, track.kernel.size // 4)
    return None if not np.any(spoilt & rows) else ~spoilt


def _spread(rows: Bools, bounds: tuple[tuple[int, int], ...], reach: int) -> Bools:
    """Rows that are true, or nearer than `reach` to one of the same recording that is."""
    spread = np.zeros_like(rows)
    for start, stop in bounds:
        counts = np.concatenate([[0], np.cumsum(rows[start:stop])])
        places = np.arange(stop - start)
        first = np.maximum(places - reach, 0)
        last = np.minimum(places + reach + 1, stop - start)
        spread[start:stop] = counts[last] > counts[first]
    return spread
