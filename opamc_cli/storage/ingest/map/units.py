"""Units of foreign recordings, converted by declaration and never guessed.

A unit belongs to one quantity: a current declared in degrees is refused, not scaled by chance.
"""

from collections.abc import Mapping

from opamc_cli.storage.schemas.channels import LOGGED, Conversion

CONVERSIONS: dict[str, Mapping[str, Conversion]] = {
    "current": {
        "A": Conversion(1.0),
        "mA": Conversion(1e-3),
        "uA": Conversion(1e-6),
        "kA": Conversion(1e3),
        "Arms": Conversion(2**0.5),
        "Nm": Conversion(1.0),
        "mNm": Conversion(1e-3),
    },
    **{name: channel.units for name, channel in LOGGED.items()},
    "time": {
        "s": Conversion(1.0),
        "ms": Conversion(1e-3),
        "us": Conversion(1e-6),
        "ns": Conversion(1e-9),
        "min": Conversion(60.0),
        "h": Conversion(3600.0),
        # counts from another day than 1970: of Windows (1601), .NET (year 1), spreadsheets (1899)
        "filetime": Conversion(1e-7, -11_644_473_600.0),
        "ticks": Conversion(1e-7, -62_135_596_800.0),
        "days": Conversion(86_400.0, -2_209_161_600.0),
    },
    "rate": {"Hz": Conversion(1.0), "kHz": Conversion(1e3)},
}
"""Conversions to A (a torque: Nm), a logged channel's first unit, s and Hz, by quantity. The offset
of a time is that of a stamp which is a date."""

EARLIEST_S = 5e8
"""A stamp later than this many seconds (in 1985) counts from 1970; a smaller one from a start."""

LATEST_S = 3.471e9
"""From there on (2080) it counts in another unit, or from another year, as LabVIEW from 1904."""

ONE_UNIT = 1.5
"""Up to this ratio, either way, a speed that is coarse, noisy or filtered is its position's in the
same unit: the next pair of units is 6 apart, and hardly any gear is as small."""

TORQUES = frozenset({"Nm", "mNm"})
"""Units in which a joint's torque stands for its motor's current; it stays a torque."""

SAMPLES = "samples"
"""Unit of a time column that counts samples; the sampling rate turns it into seconds."""

ISO8601 = "iso8601"
"""Unit of a time column that holds dates and times, such as 2022-10-26T08:17:21.847Z."""

ALIASES = {
    "µA": "uA",
    "Aeff": "Arms",
    "A rms": "Arms",
    "°": "deg",
    "°/s": "deg/s",
    "1/min": "rpm",
    "rev/min": "rpm",
    "°C": "degC",
    "°F": "degF",
    "µs": "us",
    "sec": "s",
    "N·m": "Nm",
    "N m": "Nm",
}


def conversion(unit: str, quantity: str) -> Conversion | None:
    """Return how a unit becomes the run format's, or None where it is not known.

    Examples
    --------
    >>> conversion("mA", "current").factor
    0.001
    >>> conversion("deg", "current") is None
    True
    """
    return CONVERSIONS[quantity].get(ALIASES.get(unit, unit))


def date_s(stamp: float, unit: str) -> float | None:
    """Return the seconds from 1970 to a time stamp; None where it counts from another start.

    Examples
    --------
    >>> date_s(1.7e12, "ms"), date_s(12.5, "s"), round(date_s(46314.5, "days"))
    (1700000000.0, None, 1792411200)
    """
    known = conversion(unit, "time")
    seconds = stamp * known.factor + known.offset if known else 0.0
    return seconds if seconds >= EARLIEST_S else None


def is_torque(unit: str) -> bool:
    """Return whether a unit is one of torque."""
    return ALIASES.get(unit, unit) in TORQUES


def known_units(quantity: str) -> str:
    """Return the units of a quantity, for a message."""
    names = list(CONVERSIONS[quantity])
    if quantity == "time":
        names += [SAMPLES, ISO8601]
    return ", ".join(names)
