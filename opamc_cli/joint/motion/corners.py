"""Where the motion changes faster than its smoothing can follow.

At a step of the acceleration, as every trapezoidal speed has them, and where a coarse encoder asks
for a long window, the smoothed acceleration is not the true one. The inertia's current is left
over: broad in frequency, the same in every cycle, and well fitted by sines of the angle or of time.
"""

import numpy as np
from scipy.ndimage import maximum_filter1d

from opamc_cli.joint.motion.track import Bools, Floats
from opamc_cli.signal.transform.averages import averaged

LARGEST_LACK = 0.3
"""Standard deviations of the current's noise that the smoothing may take from a sample."""
CERTAIN = 3.0
"""Standard deviations of the acceleration's noise: less may not be lacking at all."""
FEWEST_CLEAR = 0.05
"""Share of the moving samples: where fewer would be left, the path is of that nature. At 0.02 a
ripple that shook a joint left 2.8 % of a stroke, none of them sealed, and had no name."""
LONGEST_CORNER = 4
"""Lengths of the window's average: a corner is felt over one on each side, what lasts is vibration.
Of samples that are not clear at most 1 % lie in longer runs where a coarse encoder rounds off a
trapezoid, 73 to 100 % where a ripple shakes a soft joint."""


def clear_of_corners(
    acceleration: Floats, current_a: Floats, moving: Bools, kernel: Floats, noise: float
) -> Bools:
    """Tell the samples whose acceleration is as true as the current's noise can show.

    What the window takes from the acceleration is about what it would take a second time (Tukey's
    twicing), with `noise` of that standard deviation in it. How much current that is, is fitted to
    the current less its own moving average, which holds what the window takes, and noise. All are
    (n,), of one recording, but for the kernel: the moving average, of odd length, that the
    acceleration has gone through.
    """
    everywhere = ((0, acceleration.size),)
    clear = np.ones(acceleration.size, dtype=bool)
    taken = acceleration - averaged(acceleration, everywhere, kernel)
    energy = float(taken[moving] @ taken[moving])
    if energy <= 0:
        return clear
    fast = current_a - averaged(current_a, everywhere, kernel)
    inertia = float(taken[moving] @ fast[moving]) / energy
    current_noise = float(np.median(np.abs(fast - inertia * taken)[moving])) / 0.6745
    limit = max(LARGEST_LACK * current_noise, CERTAIN * noise * abs(inertia))
    # At the corner itself nothing is taken, on its two sides the more.
    lacking = moving & widened(np.abs(inertia * taken) > limit, max(kernel.size // 4, 1))
    starts, stops = np.flatnonzero(np.diff(lacking, prepend=False, append=False)).reshape(-1, 2).T
    lengths = stops - starts
    vibrates = 2 * lengths[lengths > LONGEST_CORNER * kernel.size].sum() > lengths.sum()
    few = np.count_nonzero(moving & ~lacking) < FEWEST_CLEAR * np.count_nonzero(moving)
    return clear if vibrates or few else ~lacking


def widened(rows: Bools, reach: int) -> Bools:
    """Rows that are true, or at most `reach` from one that is."""
    return np.asarray(maximum_filter1d(rows, 2 * reach + 1, mode="constant"))
