"""What the values of a channel say: degrees or radians, milliampere or ampere, seconds or ticks."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from opamc_cli.storage.ingest.map.units import (
    CONVERSIONS,
    LATEST_S,
    ONE_UNIT,
    conversion,
    date_s,
)

Float = npt.NDArray[np.float64]

MOST_TURNS = 2
"""Hardly any joint turns further either way."""

LARGEST_RAD = 2 * math.pi * MOST_TURNS
"""What goes further is counted in degrees."""

LARGEST_A = 60.0
"""No joint motor of an arm draws more; what is larger is counted in milliampere."""

AGREE_WITHIN = 0.03
"""Relative difference within which a position's steps agree with a speed: those of logs do to
0.1 %, to 2 % where the speed is noise to a seventh; radians by rpm are 4.7 % from a tenth."""

ANGLE_UNITS = {
    ("rad", "rad/s"): 1.0,
    ("deg", "deg/s"): 1.0,
    ("deg", "rad/s"): 180 / math.pi,
    ("rad", "deg/s"): math.pi / 180,
    ("deg", "rpm"): 6.0,
    ("rad", "rpm"): math.pi / 30,
    ("deg", "rev/s"): 360.0,
    ("rad", "rev/s"): 2 * math.pi,
}
"""Steps of the position per second, over the speed, by units of both."""

RATES_HZ = (5.0, 20_000.0)
"""Rates at which arms are logged."""

SLOWEST_HZ = 0.5
"""Of stamps in seconds that may also be milliseconds: some machines log so slowly."""

SHORTEST_S = 1.0
"""Of a log: no motion is over sooner."""

FASTEST_HZ = 1e6
"""Of stamps in seconds, which no other unit makes a log of: a drive's capture, a probe."""

DATES_S = (9.467e8, LATEST_S)
"""Seconds from 1970 to 2000 and to 2080: within, no two units of time take a number for a date."""

DATED_HZ = 0.1
"""A date tells its unit; but a clock at 46 000 s is none of days, for its steps."""


@dataclass(frozen=True)
class Guess:
    """A unit and what speaks for it."""

    unit: str
    why: str


def current_unit(largest: float) -> Guess:
    """Return ampere or milliampere by the largest value."""
    if largest > LARGEST_A:
        return Guess("mA", f"largest {largest:.4g}: too many for amperes")
    return Guess("A", f"largest {largest:.3g}")


def angle_units(
    positions: Mapping[int, Float], speeds: Mapping[int, Float], rate_hz: float | None
) -> tuple[Guess, Guess]:
    """Return the units of positions and speeds.

    Parameters
    ----------
    positions, speeds
        Values by axis; speeds may be empty.
    rate_hz
        Samples per second, None where it is not known.
    """
    largest = max((_largest(values) for values in positions.values()), default=0.0)
    fastest = max((_largest(values) for values in speeds.values()), default=0.0)
    by_range = "deg" if largest > LARGEST_RAD else "rad"
    ratio = _steps_over_speed(positions, speeds)
    if ratio is not None and rate_hz is not None:
        ratio *= rate_hz
        off = {units: abs(ratio / expected - 1) for units, expected in ANGLE_UNITS.items()}
        units = min(off, key=lambda units: (off[units], units[0] != by_range))
        if off[units] < AGREE_WITHIN:
            # of one unit they agree whichever it is
            told = "" if ANGLE_UNITS[units] != 1.0 else ", by the range alone"
            why = f"largest {largest:.3g}{told}; its steps agree with the speed"
            return Guess(units[0], why), Guess(units[1], f"largest {fastest:.3g}; as the position")
    speed = "deg/s" if fastest > LARGEST_RAD else "rad/s"
    doubt, told = "", "by the range alone"
    if ratio is not None and rate_hz:
        if 1 / ONE_UNIT < ratio < ONE_UNIT:
            speed, told = f"{by_range}/s", "as the position"
        power = round(math.log10(ratio))
        tenfold = power and abs(ratio / 10.0**power - 1) < AGREE_WITHIN
        gear, side = max((ratio, "position"), (1 / ratio, "speed"))
        geared = round(gear) > 1 and abs(gear / round(gear) - 1) < AGREE_WITHIN
        blame = f": the {side} may be the motor's" if geared else ""
        blame += " or the unit of the time wrong" if tenfold else ""
        doubt = f" (its steps are {ratio:.3g} of the speed{blame})"
    return (
        Guess(by_range, f"largest {largest:.3g}, by the range alone{doubt}"),
        Guess(speed, f"largest {fastest:.3g}, {told}"),
    )


def rate_from_speed(positions: Mapping[int, Float], speeds: Mapping[int, Float]) -> float | None:
    """Return the rate at which steps of the position agree with the speed, in the same unit."""
    ratio = _steps_over_speed(positions, speeds)
    if ratio is None:
        return None
    rate = float(f"{1 / ratio:.2g}")
    return rate if RATES_HZ[0] <= rate <= RATES_HZ[1] else None


def wraps(positions: Mapping[int, Float], unit: str) -> bool:
    """Return whether a position jumps by a turn."""
    turn = 1 / turns(1.0, unit)
    steps = [np.abs(np.diff(v[np.isfinite(v)])) for v in positions.values()]
    return any(bool(((s > 0.75 * turn) & (s < 1.05 * turn)).any()) for s in steps)


def turns(largest: float, unit: str) -> float:
    """Return how many turns a position holds.

    Examples
    --------
    >>> turns(5440, "deg") > 15
    True
    """
    known = conversion(unit, "position")
    return largest * known.factor / (2 * math.pi) if known else 0.0


def time_unit(stamps: Float) -> Guess | None:
    """Return the unit of time stamps by the date that they are, or their steps.

    None where they are no stamps, or no unit makes a log's rate of them.
    """
    known = stamps[np.isfinite(stamps)]
    steps = np.diff(known)
    if len(known) < 3 or float(np.mean(steps > 0)) < 0.9:
        return None
    step = float(np.median(steps))
    rates = {unit: 1 / (step * to_s.factor) for unit, to_s in CONVERSIONS["time"].items()}
    for unit, rate in rates.items():
        since_s = date_s(float(known[0]), unit) or 0.0
        if DATES_S[0] <= since_s < DATES_S[1] and DATED_HZ <= rate <= RATES_HZ[1]:
            return Guess(unit, f"dates of {datetime.fromtimestamp(since_s, UTC).year}")
    if step == 1.0 and bool(np.all(known == np.round(known))):
        return Guess("samples", "counts rows")
    why, slow = f"steps of {step:.6g}", SLOWEST_HZ <= rates["s"] < RATES_HZ[0]
    for unit in ("s", "ms", "us", "ns"):
        if RATES_HZ[0] <= rates[unit] <= RATES_HZ[1]:
            lasts_s = float(np.ptp(known)) * CONVERSIONS["time"][unit].factor
            if not slow:
                return Guess(unit, why)
            if lasts_s < SHORTEST_S:
                return Guess("s", f"{why}, or {unit} if all of it lasts {lasts_s:.2g} s")
            return Guess(unit, f"{why}, or s if it is logged at {rates['s']:.2g} Hz")
    return Guess("s", f"steps of {step:.6g}") if RATES_HZ[1] < rates["s"] <= FASTEST_HZ else None


def are_phases(a: Float, b: Float, c: Float) -> bool:
    """Return whether three currents are as large as each other and add up to little.

    Three that know nothing of each other add up to 1.7 times one of them, phases to nothing but
    what their sensors differ by.
    """
    sizes = [float(np.nanstd(x)) for x in (a, b, c)]
    together = float(np.nanstd(a + b + c))
    return min(sizes) > 0.5 * max(sizes) > 0 and together < 0.8 * max(sizes)


def _largest(values: Float) -> float:
    known = np.abs(values[np.isfinite(values)])
    return float(known.max()) if known.size else 0.0


def _steps_over_speed(positions: Mapping[int, Float], speeds: Mapping[int, Float]) -> float | None:
    """Return the step of a position from sample to sample over the speed, least squares."""
    product = square = 0.0
    for axis in positions.keys() & speeds.keys():
        position, speed = positions[axis], speeds[axis]
        step = (position[2:] - position[:-2]) / 2
        if not np.isfinite(step).any():
            continue
        # the mean of the speed over both steps, by Simpson: the middle's alone is 6 % more where a
        # motion of 1 Hz is logged at 10 Hz
        middle = (speed[:-2] + 4 * speed[1:-1] + speed[2:]) / 6
        size = np.abs(step)
        # of the steps that are some: a joint that rests for most of a log moves all the same
        moved = size[size > 0]
        jump = size > 10 * (np.median(moved) if moved.size else 0.0)
        known = np.isfinite(step) & np.isfinite(middle) & ~(jump & (np.abs(step) > 1))
        product += float(np.dot(step[known], middle[known]))
        square += float(np.dot(middle[known], middle[known]))
    return product / square if square > 0 and product > 0 else None
