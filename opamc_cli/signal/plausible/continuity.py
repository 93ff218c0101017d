"""Places at which a joint's angle leaps: samples that are missing between two, or a wrap."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from opamc_cli.signal.plausible.quality import WRAPPED

Floats = NDArray[np.float64]

AROUND = 9
"""Samples whose median step is what a joint goes at one place of its motion."""
STEADY = 0.1
"""Of it: how much single steps differ, at the most, where a missing sample is to be told. A coarse
encoder's steps, and those of a log that is polled unevenly, differ by more."""
LEAPS = 1.7
"""Times the median from which a step holds more than one."""
FEWEST = 5
HELD = 0.5
"""Of the median: below it a value is held, and the next step is as much larger."""
FEWEST_STEPS = 200

RETURNS = 20.0
"""Times the median, or more, by which an angle that wraps leaps back."""
ALIKE = 0.05
"""By which leaps back of one size differ: a joint is found on either side of its wrap."""


@dataclass(frozen=True)
class Leaps:
    """What an angle's steps tell."""

    places: int
    """Steps that are too large."""
    missing: int
    """Samples that they hold."""
    wrap: float | None
    """Size of the leaps, if all go back by as much, in the angle's own unit."""


def leaps(position: Floats) -> Leaps | None:
    """Tell whether an angle leaps on its way.

    Parameters
    ----------
    position : array, shape (n,)
        Joint angle; jumps by a whole turn of 2π are none.

    Returns
    -------
    Leaps or None
        None where it does not, or steps are too uneven to tell.

    Notes
    -----
    Steps are held against the median of nine and against both neighbours, so that a missing sample
    looks like a step twice as large as those beside it. Where as many values are held, samples came
    late and none is missing.
    """
    steps = np.diff(position)
    steps = steps[np.isfinite(steps)]
    turned = np.abs(np.abs(steps) - 2 * np.pi) < WRAPPED
    steps[turned] -= np.sign(steps[turned]) * 2 * np.pi
    if steps.size < FEWEST_STEPS:
        return None
    usual = median_filter(steps, AROUND)
    fastest = float(np.quantile(np.abs(usual), 0.99))
    moving = np.abs(usual) > 0.2 * fastest
    if fastest <= 0 or np.count_nonzero(moving) < FEWEST_STEPS:
        return None
    times = steps[moving] / usual[moving]
    back = times[times < -RETURNS] * usual[moving][times < -RETURNS]
    if back.size > 1 and np.ptp(np.abs(back)) < ALIKE * float(np.abs(back).max()):
        return Leaps(back.size, 0, float(np.median(np.abs(back))))
    if float(np.median(np.abs(times - 1.0))) > STEADY / 2 or (
        np.quantile(np.abs(times - 1.0), 0.9) > STEADY
    ):
        return None
    # a stroke of fewer than nine steps is faster than their median, but next to steps as fast
    beside = np.convolve(steps, (0.5, 0.0, 0.5), "same")
    large = (times > LEAPS) & (np.abs(steps) > LEAPS * np.abs(beside))[moving]
    places = int(np.count_nonzero(large))
    if places < FEWEST or np.count_nonzero(times < HELD) > places / 2:
        return None
    return Leaps(places, int(np.round(times[large] - 1.0).sum()), None)
