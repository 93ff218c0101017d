"""Every channel of a run: what stands after `axisN_`, its units, and what foreign logs call it.

A channel that is logged beside the currents is a row of `LOGGED` and a field of `Recording`, which
hands it to the science; ingest, its maps, `--guess` and the run format know it by the row alone.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Conversion:
    """A linear conversion to the unit of the run format: value · factor + offset."""

    factor: float
    offset: float = 0.0


@dataclass(frozen=True)
class Channel:
    """A channel of an axis beside its currents."""

    field: str
    """What `Recording` calls it."""
    units: Mapping[str, Conversion]
    """How it is declared in foreign recordings; the run format's own unit first."""
    words: tuple[str, ...]
    """Of names of channels that mean it."""
    vague: bool = False
    """Other names hold its words, too: it is thought of last."""


PHASES = ("a", "b", "c")
CURRENTS = (*PHASES, "current")

LOGGED = {
    "position": Channel(
        "position_rad",
        {
            "rad": Conversion(1.0),
            "mrad": Conversion(1e-3),
            "deg": Conversion(math.pi / 180),
            "rev": Conversion(2 * math.pi),
        },
        (
            *("pos", "position", "positions", "angle", "angles", "q", "phi", "theta", "enc"),
            *("lage", "winkel"),
        ),
        vague=True,
    ),
    "velocity": Channel(
        "velocity_rad_s",
        {
            "rad/s": Conversion(1.0),
            "deg/s": Conversion(math.pi / 180),
            "rpm": Conversion(2 * math.pi / 60),
            "rev/s": Conversion(2 * math.pi),
        },
        (
            *("vel", "velocity", "velocities", "speed", "speeds", "qd", "dq", "omega", "qdot"),
            "drehzahl",
        ),
    ),
    "temperature": Channel(
        "temperature_c",
        {
            "degC": Conversion(1.0),
            "K": Conversion(1.0, -273.15),
            "degF": Conversion(5 / 9, -160 / 9),
        },
        ("temp", "temps", "temperature", "temperatures", "temperatur"),
    ),
}
"""By name and quantity, in the order in which a map lists them."""

CHANNELS = (*CURRENTS, *LOGGED)
LEAST_HZ, MOST_HZ = 1e-3, 1e6
"""A current that is sampled once in a quarter of an hour has a clock in another unit. So has one
above the other: drives switch at some ten thousand times a second, and days that were taken for
seconds are 86 400 times as fast."""

SAME_CLOCK = 1e-3
"""Relative difference of rates that is a clock's drift, or how well it was measured, no other rate:
frequencies and lengths of motions differ by more from night to night."""


def same_clock(rate_hz: float, other_hz: float) -> bool:
    """Tell whether two rates are one.

    Examples
    --------
    >>> same_clock(200.006, 200.0), same_clock(200.3, 200.0)
    (True, False)
    """
    return abs(rate_hz / other_hz - 1.0) <= SAME_CLOCK


COLUMN = re.compile(rf"axis([1-9][0-9]*)_({'|'.join(CHANNELS)})")
"""Name of a run's column."""

NEARLY_COLUMN = re.compile(
    rf"\s*axis[\s_-]*0*([0-9]+)[\s_-]+({'|'.join(CHANNELS)})\s*", re.IGNORECASE | re.ASCII
)
"""What somebody may have written for one."""


def quantity_of(column: str) -> str:
    """Return the quantity of a run's column.

    Examples
    --------
    >>> quantity_of("axis2_b")
    'current'
    """
    channel = column.partition("_")[2]
    return "current" if channel in CURRENTS else channel


def axes_phrase(axes: Sequence[int]) -> str:
    """Return "axis 3", "axes 1 and 4" or "axes 1-6"."""
    numbers = sorted(axes)
    if not numbers:
        return "no axis"
    if len(numbers) == 1:
        return f"axis {numbers[0]}"
    if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"axes {numbers[0]}-{numbers[-1]}"
    return "axes " + ", ".join(str(n) for n in numbers[:-1]) + f" and {numbers[-1]}"
