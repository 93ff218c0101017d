"""What a joint's own lines tell of its gear and motor where nobody has given it."""

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from opamc_cli.signal.transform.angle_bins import vertex

Floats = NDArray[np.float64]

USUAL_RATIOS = (50, 80, 100, 120, 160)
"""Of strain wave gears in their makers' catalogues; one more where the circular spline turns out.
Orders of a gear of 30 lie where those of the motion do."""

USUAL_POLE_PAIRS = range(3, 13)
"""Of two or one the line lies where an error of the phases' sensors does."""

TWICE = 2.0
"""A turn of the wave generator its error goes through all that its two lobes do."""

LEAST = 2.0
"""Of the logarithm of a line's power over its surroundings': of 94 joints of ten simulated robots
28 ratios are told, all rightly; from 1.9 on one wrongly."""

SURROUNDINGS = 12.0
NEAR = 0.35
"""Resolutions: half a side of what a line stands out of, and by which it may miss its place."""

HIGHEST_PASSING = 20.0
"""Rolling elements that pass a point of a bearing each turn: a wave generator's has some two dozen
balls, of which half pass either ring."""


def told(
    kind: str, orders: Floats, power: Floats, resolution: float
) -> tuple[float | None, int | None]:
    """Tell a strain wave gear's ratio, or a motor's pole pairs, by the line of a kinematic error.

    Of the orders that may be twice a turn of some usual gear's wave generator the one that stands
    out most. What half of its order stands out as much, or twice, may be the rotor's.

    Parameters
    ----------
    kind
        Whose revolution orders count by: the "joint"'s, which tell the ratio, or the "electrical"
        one, which tell the pole pairs.
    orders, power
        Cycles per revolution, (k,), and each session's power, tapered; (n, k).
    resolution
        Smallest difference of orders that a stroke tells apart.

    Returns
    -------
    tuple
        The ratio as it is measured, within half a per cent or so, and the pole pairs; None where
        the lines do not tell.
    """
    if kind == "joint":
        places = [(TWICE * ratio, TWICE * (ratio + 1)) for ratio in USUAL_RATIOS]
        line = _standing_out(orders, power, resolution, places)
        return None if line is None else line / TWICE, None
    places = [(TWICE / poles, TWICE / poles) for poles in reversed(USUAL_POLE_PAIRS)]
    line = _standing_out(orders, power, resolution, places)
    return None, None if line is None else round(TWICE / line)


def _standing_out(
    orders: Floats, power: Floats, resolution: float, places: Sequence[tuple[float, float]]
) -> float | None:
    if orders.size < 2:
        return None
    mean = np.log(power + 1e-300).mean(axis=0)
    around = 2 * int(SURROUNDINGS * resolution / (orders[1] - orders[0])) + 1
    above = mean - median_filter(mean, around)
    slack = NEAR * resolution
    asked = (orders > places[0][0] - slack) & (orders < places[-1][1] + slack)
    if not asked.any():
        return None
    best = int(np.argmax(np.where(asked, above, -np.inf)))
    line, height = vertex(orders, mean, best), float(above[best])
    there = any(first - slack < line < last + slack for first, last in places)
    half, twice = (
        float(above[asked & (abs(orders - times * line) < resolution / 2)].max(initial=0.0))
        for times in (0.5, 2.0)
    )
    doubtful = twice > LEAST or half > max(LEAST, height - LEAST)
    return line if there and height > LEAST and not doubtful else None


def passing_rollers(
    orders: Sequence[float], resolution: float, ratio: float | None
) -> tuple[int, int] | None:
    """Find two lines, strongest first, that a damaged bearing of the wave generator has.

    Its rolling elements pass a damage some times a turn that are no whole number, as nothing of the
    mesh, the rotor or the windings does, under a load that the lobes bring twice a turn: beside
    that order there is one that differs by two.

    Parameters
    ----------
    orders
        Cycles per revolution of the motor.
    resolution
        As of `told`, by the motor's revolution.
    ratio
        Of the gear: a whole number of cycles as the flexspline turns is one, too.

    Returns
    -------
    tuple of int or None
        Their numbers.
    """
    near = NEAR * resolution
    turning = 1 / (ratio or USUAL_RATIOS[0])
    odd = [
        2 * near + turning * int(one) < one % 1 < 1 - 2 * near and one < HIGHEST_PASSING
        for one in orders
    ]
    pairs = permutations([k for k, is_odd in enumerate(odd) if is_odd], 2)
    return next((p for p in pairs if abs(abs(orders[p[0]] - orders[p[1]]) - TWICE) < near), None)
