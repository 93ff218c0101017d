"""Whether a current's noise has grown as much while the joint stands still as while it moves."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BLOCK_S = 0.1
"""Stretch in which a cubic is the slow course: five periods of the mains."""
ORDER = 4
"""Coefficients of a cubic: about a line noise of three times the size is told on 17 of 20 joints,
not 20, since the course of other weather differs by more (docs/decision.md)."""
FEWEST_SAMPLES = 8
"""Of a stretch: those of a slower log are longer."""
FEWEST_STRETCHES = 4
"""At rest, and in motion: fewer say nothing of a recording."""
FEWEST_RECORDINGS = 3
"""Of the baseline: fewer do not tell how much healthy ones differ."""

STANDING, MOVING = 0.01, 0.1
"""Share of the fastest stretch's speed below which the joint stands, and above which it moves."""

GROWN = 2.0
"""Times the power at rest of the noisiest baseline recording, which has 1.27 times the middle one's
at most; faults of the gear have 1.4 times, noise of twice the size four (docs/decision.md)."""
AS_MUCH = 0.5
"""Of the growth of power in motion that is there at rest, too: of a sensor's noise all of it."""


@dataclass(frozen=True)
class Fluctuation:
    """How much a recording's current fluctuates about its slow course, as mean squares."""

    at_rest: float
    """Median over stretches of standstill."""
    in_motion: float
    """Mean over stretches of motion: a gear's fault at one place counts, too."""
    trembling: float
    """As `at_rest`, of the position: a loop that hunts moves the joint."""


@dataclass(frozen=True)
class Growth:
    """By how much a current's noise at rest has grown."""

    times: float
    """Its size over the baseline's."""
    share: float
    """Of the growth of power in motion, 1 at most: what is there at rest, too."""


def fluctuation(current: Floats, position: Floats, rate_hz: float) -> Fluctuation | None:
    """Measure how much a current fluctuates at rest and in motion.

    Parameters
    ----------
    current : ndarray, shape (n,) or (n, 3)
        Reported current, or three phases, in A; NaN where unknown.
    position : ndarray, shape (n,)
        Of the joint, in any unit; NaN where unknown.
    rate_hz : float
        Sampling rate.

    Returns
    -------
    Fluctuation or None
        Of phases that of the length of their vector; None where the recording has too little
        standstill or motion.
    """
    size = max(round(BLOCK_S * rate_hz), FEWEST_SAMPLES)
    n = len(current) // size
    places = position[: n * size].reshape(n, size)
    speed = np.abs(places[:, -1] - places[:, 0])
    if n < 2 * FEWEST_STRETCHES or not np.nanmax(speed, initial=0.0):
        return None
    share = speed / np.nanmax(speed)
    still = share <= STANDING
    # before and after a motion the loop settles
    still[1:-1] &= still[:-2] & still[2:]
    stretches = current[: n * size].reshape(n, size, -1)
    rest = about_course(stretches).mean(axis=1)
    moved = rest
    if current.ndim > 1:
        # the vector's length is amplitude invariant; without current it has none to fluctuate
        length = np.sqrt(2 / 3 * (stretches**2).sum(axis=2, keepdims=True))
        rest, moved = 2 / 3 * rest, about_course(length)[:, 0]
    still &= np.isfinite(rest)
    moves = (share >= MOVING) & np.isfinite(moved)
    if min(np.count_nonzero(still), np.count_nonzero(moves)) < FEWEST_STRETCHES:
        return None
    trembling = about_course(places[still][:, :, None])
    return Fluctuation(
        float(np.median(rest[still])), float(moved[moves].mean()), float(np.median(trembling))
    )


def about_course(stretches: Floats) -> Floats:
    """Mean squares, (n, k), of stretches, (n, samples, k), about each one's own cubic."""
    size = stretches.shape[1]
    course = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, size), ORDER))[0]
    left = stretches - np.einsum("ti,si,nsk->ntk", course, course, stretches, optimize=True)
    return np.asarray((left**2).sum(axis=1) / (size - ORDER))


def growth_at_rest(baseline: Sequence[Fluctuation], target: Sequence[Fluctuation]) -> Growth | None:
    """Tell whether a current's noise has grown at rest as it has in motion.

    A fault of the gear needs motion; noise or hum of a sensor is there as well without.

    Parameters
    ----------
    baseline, target : sequence of Fluctuation
        One for each recording.

    Returns
    -------
    Growth or None
        None where it has not grown beyond the baseline's recordings, by less than half of what the
        fluctuation in motion has grown by, or together with the position's, as where a loop hunts.
    """
    if len(baseline) < FEWEST_RECORDINGS or not target:
        return None
    before, after = (
        Fluctuation(*np.median([(s.at_rest, s.in_motion, s.trembling) for s in side], axis=0))
        for side in (baseline, target)
    )
    grown, in_motion = after.at_rest - before.at_rest, after.in_motion - before.in_motion
    if after.at_rest <= GROWN * max(one.at_rest for one in baseline):
        return None
    if grown < AS_MUCH * in_motion:
        return None
    if after.trembling > GROWN * max(one.trembling for one in baseline):
        return None
    share = min(grown / in_motion, 1.0) if in_motion > 0 else 1.0
    return Growth(float(np.sqrt(after.at_rest / max(before.at_rest, 1e-300))), float(share))
