"""How fast something grows over the nights, and when it will be too much."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.trend.median import median

FloatArray = NDArray[np.float64]

LEAST_NIGHTS = 6
"""Fewer nights have slopes of either sign by chance in every tenth series."""

LEAST_NIGHTS_OF_SPREAD = 3
"""Nights from which there is a slope where it is known how much nights differ. Of 300 joints with a
step of 0.6, nights of a spread of 0.13, 10 % seemed to grow for sure with fewer than six nights."""

NORMAL_90 = 1.6449
"""Two-sided 90 % of the normal distribution."""

NORMAL_999 = 3.2905
"""Two-sided 99.9 %."""


STEP = 2.0
"""Standard deviations of nights that a step has at least."""


@dataclass(frozen=True)
class Slope:
    """Change per night."""

    per_night: float
    low: float
    high: float
    """With `per_night`, `low`: change per night with its interval."""
    middle: float
    """Level in the middle of the nights, where it hardly depends on the slope."""
    age: float
    """Nights from that middle to the last night."""

    @property
    def level(self) -> float:
        """Level at the last night."""
        return self.middle + self.per_night * self.age

    @property
    def clear(self) -> bool:
        """Whether it grows for sure."""
        return self.low > 0


def robust_slope(nights: FloatArray, values: FloatArray, sure: float = NORMAL_90) -> Slope | None:
    """Return the median of the slopes between all pairs of nights.

    Parameters
    ----------
    nights : ndarray, shape (T,)
        Times in nights, ascending.
    values : ndarray, shape (T,)
        Finite.
    sure : float
        Half width of the interval, in standard deviations of the normal distribution.

    Returns
    -------
    Slope or None
        None with fewer than `LEAST_NIGHTS`.

    Notes
    -----
    H. Theil (1950) and P. K. Sen, J. Am. Stat. Assoc. 63 (1968): up to 29 % of the nights may be
    odd. The interval is Sen's, from the variance of Kendall's S.
    """
    n = len(values)
    if n < LEAST_NIGHTS:
        return None
    first, second = np.triu_indices(n, 1)
    slopes = np.sort((values[second] - values[first]) / (nights[second] - nights[first]))
    slope, middle = median(slopes), median(nights)
    reach = sure * np.sqrt(n * (n - 1) * (2 * n + 5) / 18)
    low = int(np.floor((len(slopes) - reach) / 2))
    high = int(np.ceil((len(slopes) + reach) / 2))
    return Slope(
        slope,
        float(slopes[low]) if low >= 0 else -np.inf,
        float(slopes[high]) if high < len(slopes) else np.inf,
        median(values - slope * (nights - middle)),
        float(nights[-1] - middle),
    )


def slope_of_spread(
    nights: FloatArray, values: FloatArray, spread: float, sure: float = NORMAL_90
) -> Slope | None:
    """Return the slope of few nights, of which it is known how much nights differ.

    Parameters
    ----------
    nights : ndarray, shape (T,)
        Times in nights, ascending.
    values : ndarray, shape (T,)
        Finite.
    spread : float
        Standard deviation of nights that do not grow.
    sure : float
        As of `robust_slope`.

    Returns
    -------
    Slope or None
        By least squares; None with fewer than `LEAST_NIGHTS_OF_SPREAD`.
    """
    if len(values) < LEAST_NIGHTS_OF_SPREAD:
        return None
    middle = float(nights.mean())
    square = float(((nights - middle) ** 2).sum())
    slope = float((nights - middle) @ values) / square
    reach = sure * spread / np.sqrt(square)
    return Slope(
        slope,
        slope - reach,
        slope + reach,
        float(values.mean()),
        float(nights[-1] - middle),
    )


def is_step(slope: Slope, before: float, spread: float, span: float) -> bool:
    """Whether more came at once, before the first of some nights, than in all of them since.

    Then a level since that night describes them better than a rise that begins there, and nights
    that rise a little by chance must not be taken for its course.

    Parameters
    ----------
    slope : Slope
        Of the nights since.
    before, spread : float
        Level before, and standard deviation of nights: what is less than `STEP` of them is none.
    span : float
        From the first of the nights since to the last.
    """
    grown = slope.per_night * span
    return slope.level - grown - before > max(grown, STEP * spread)


def later_half(values: FloatArray) -> FloatArray:
    """Return the later half of some nights' values, `LEAST_NIGHTS` of them at least."""
    return values[-max(-(-len(values) // 2), LEAST_NIGHTS) :]


def nights_until(
    slope: Slope, limit: float, lately: Slope | None = None
) -> tuple[float, float] | None:
    """Return in how many nights a limit is reached, earliest and latest.

    Parameters
    ----------
    slope : Slope
        Of all nights since it grows.
    limit : float
        Level that is awaited.
    lately : Slope or None
        Of the later half of them: wear quickens, and a straight line through all nights is late
        (of 41 forecasts of 11 virtual joints 10 were too late and none too early; two with this).

    Returns
    -------
    tuple of float, or None
        None where nothing grows for sure; (0, 0) where the limit is reached already.
    """
    if slope.level >= limit:
        return 0.0, 0.0
    if not slope.clear:
        return None
    rising = [one for one in (slope, lately) if one is not None and one.high > 0]
    soonest = min((limit - one.middle) / one.high - one.age for one in rising)
    return max(soonest, 0.0), max((limit - slope.middle) / slope.low - slope.age, 0.0)
