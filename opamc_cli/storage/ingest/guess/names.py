"""What the name of a channel says: which quantity, of which axis, measured or commanded."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from opamc_cli.storage.ingest.map.axes import MOST_AXES, has_placeholder
from opamc_cli.storage.ingest.map.units import CONVERSIONS, conversion, is_torque
from opamc_cli.storage.ingest.source import Listed, Name
from opamc_cli.storage.schemas.channels import LOGGED

WORDS = {
    **{name: channel.words for name, channel in reversed(LOGGED.items()) if not channel.vague},
    "torque": ("torque", "torques", "effort", "tau", "moment", "trq", "tor"),
    "current": ("cur", "curr", "current", "currents", "i", "iq", "amp", "amps", "ampere", "strom"),
    **{name: channel.words for name, channel in LOGGED.items() if channel.vague},
    "time": ("time", "timestamp", "timestamps", "stamp", "t", "clock", "zeit", "ts", "epoch"),
}
"""Words of a name by quantity, in the order in which they decide."""

TIME_UNITS = ("ms", "us", "ns", "msec", "usec", "millis", "micros", "sec", "secs", "seconds")
"""Last words of a name that is of time if nothing else is in it, such as `host_ms`."""

NOT_MEASURED = (
    *("target", "command", "commanded", "cmd", "cmptd", "computed", "desired", "des", "setpoint"),
    *("ref", "reference", "limit", "error", "sm", "model", "std", "planned", "nominal"),
    *("set", "soll", "sollwert"),
)
"""Words of what a controller wanted, not what was."""

ACTUAL = ("act", "actual", "ist", "istwert", "meas", "measured", "fbk", "feedback")
"""Words of what was, beside other names for the same."""

OF_JOINT = ("motor", "joint", "axis", "gear", "winding", "wicklung", "coil")
OF_DRIVE = ("drive", "driver", "board", "pcb", "mosfet", "fet", "mcu", "cpu", "inverter", "ambient")
"""With `OF_JOINT`: words of where a temperature is taken; grease is as warm as its joint."""

ELSEWHERE = (
    "mm",
    "tcp",
    "tool",
    "gripper",
    "base",
    "cartesian",
    "flange",
    "elbow2",
    "io",
    "voltage",
)
"""Words of what is not a joint's angle, speed or current."""

PHASES = {"a": "a", "b": "b", "c": "c", "u": "a", "v": "b", "w": "c"}
PHASE_NAME = re.compile(r"(?:^|.*[^a-z])(?:i|ia|cur|current|phase|ph|is)[ _.\-]?([abcuvw])$", re.I)
"""Such as `I_u`, `phase_b`, `axis1_current_c`, once the axis' number is taken out."""


TOLD_BY_UNIT = ("current", *LOGGED)
"""Quantities that a unit tells where the name does not; a second may be of anything."""


UNIT = re.compile(r"\s*[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$|(?:(?<=[^\W_])_|^(?=rpm$))(deg|rad|rpm)$")
"""Such as `Current J1 [mA]`, `time (ms)`, `J1_act_deg`, `rpm`."""

COUNTED = re.compile(r"([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*[*x·]?\s*(\D\S*)")
"""Such as `0.1 deg`."""

PERCENT = re.compile(r"%|per[ _]?cent|pct|prozent|\$(curr|vel_axis)_act", re.I)
"""Of what is counted in shares of a rated value, unless the file declares a unit; the variables are
of KUKA's KR C."""

KUKAS_ANGLE = re.compile(r"\$?AXIS_ACT(_MEAS)?\.A", re.I)
"""Of a KR C's joint angles, `$AXIS_ACT.A1`: degrees by the controller's manual."""

ODRIVES = re.compile(r"odrive|odrv\d|(pos|vel)_estimate", re.I)
"""Of an ODrive, such as `ODrive 0 Position` and `odrv0.axis0.pos_estimate`."""

IN_TURNS = {"position": "rev", "velocity": "rev/s"}
"""What it counts in by its manual, unless the file declares a unit."""

AXIS_WORD = re.compile(r"(axis|joint|motor|j)[ _.\-]*(?=[_ .\-]|$)", re.I)


@dataclass(frozen=True)
class Meant:
    """What a channel seems to be."""

    quantity: str
    """One of `WORDS`, or phase "a", "b", "c"."""
    number: int | None
    """The number in its name that counts axes, None where it has none."""
    pattern: str
    """Its name with ``#`` for that number."""
    source: Name
    index: int | None
    """With `source`: what a map calls it."""
    measured: bool
    """It is not a controller's wish."""
    unit: str | None
    """As the file declares it."""
    scale: float = 1.0
    """So many of it, as of `0.1 deg`."""


def meanings(listed: Sequence[Listed], counted: bool = True) -> list[Meant]:
    """Return what the channels of a recording seem to be; those without a meaning are left out.

    Parameters
    ----------
    listed
        The channels.
    counted
        Numbers in names count axes; else they are part of a joint's name, as in `wrist_1`.
    """
    found: list[Meant] = []
    for channel in listed:
        if isinstance(channel.name, int):
            continue
        name = str(channel.name)
        bare, unit = _without_unit(name)
        unit = channel.unit or unit or ("deg" if KUKAS_ANGLE.match(name) else None)
        scale, unit = counted_unit(unit)
        if PERCENT.search(f"{name} {unit}") and not _is_known(unit):
            unit = "%"
        if channel.width is not None:
            quantity = _quantity(bare, unit)
            if quantity and quantity != "time":
                found += [
                    Meant(quantity, k, name, name, k, _is_measured(name), unit, scale)
                    for k in range(channel.width)
                ]
            continue
        number, pattern = _numbered(bare) if counted else (None, bare)
        pattern += name[len(bare) :]  # of `1/min` the 1 counts no axes
        quantity = "time" if channel.dates else _quantity(_without_unit(pattern)[0], unit)
        if quantity is None or has_placeholder(name):
            continue
        measured = _is_measured(pattern)
        if unit is None and ODRIVES.search(name):
            unit = IN_TURNS.get(quantity)
        found.append(Meant(quantity, number, pattern, name, None, measured, unit, scale))
    # a drive's parameter, as in `r0078 Stromistwert`, stands alone: no arm has as many axes
    alone = Counter(each.pattern for each in found)
    found = [
        replace(each, number=None, pattern=str(each.source))
        if (each.number or 0) > MOST_AXES and alone[each.pattern] == 1
        else each
        for each in found
    ]
    if {"a", "b", "c"} <= {each.quantity for each in found}:
        return found
    # what ends in `_a` and has no `_b` and `_c` beside it is in ampere
    return [
        replace(each, quantity="current") if each.quantity in PHASES else each for each in found
    ]


def _without_unit(name: str) -> tuple[str, str | None]:
    """Return a name without the unit in brackets at its end, and that unit."""
    found = UNIT.search(name)
    unit = found and (found[1] or found[2])
    known = found is not None and _is_known(counted_unit(unit)[1])
    return (name[: found.start()], unit) if found is not None and known else (name, None)


def _is_known(unit: str | None) -> bool:
    return unit is not None and any(conversion(unit, quantity) for quantity in CONVERSIONS)


def counted_unit(unit: str | None) -> tuple[float, str | None]:
    """Return how many of a unit one stands for, and that unit.

    Examples
    --------
    >>> counted_unit("0.1 deg"), counted_unit("mA"), counted_unit("1/min")
    ((0.1, 'deg'), (1.0, 'mA'), (1.0, '1/min'))
    """
    found = COUNTED.fullmatch(unit or "")
    many = float(found[1]) if found is not None and found[1].count(".") < 2 else 0.0
    known = found is not None and _is_known(found[2])
    return (many, found[2]) if found is not None and known and many > 0 else (1.0, unit)


def _quantity(pattern: str, unit: str | None) -> str | None:
    """Return what a name means; where it has no word for it, what its unit is one of."""
    words = _words(pattern)
    if any(word in ELSEWHERE for word in words):
        return None
    bare = re.sub(r"[#\[\]()]", "", pattern).rstrip(" _.-")
    phase = PHASE_NAME.match(AXIS_WORD.sub("", bare))
    if phase:
        return PHASES[phase[1].lower()]
    for quantity, known in WORDS.items():
        # shares of a rated current are compared as well, those of an angle or a speed are no motion
        if any(word in known for word in words) and not (unit == "%" and quantity in LOGGED):
            return quantity
    if unit is None and counts_time(pattern):
        return "time"
    if unit is None or is_torque(unit):
        return None  # a torque may be of anything
    return next((each for each in TOLD_BY_UNIT if conversion(unit, each)), None)


def _is_measured(pattern: str) -> bool:
    return not any(word in NOT_MEASURED for word in _words(pattern))


def counts_time(pattern: str) -> bool:
    """Return whether a name says by a unit at its end alone that it is of time.

    Examples
    --------
    >>> counts_time("host_ms"), counts_time("time_ms"), counts_time("millis"), counts_time("msg")
    (True, False, True, False)
    """
    words = _words(pattern)
    return bool(words) and words[-1] in TIME_UNITS and not any(w in WORDS["time"] for w in words)


def says_actual(pattern: str) -> bool:
    """Return whether a name says that it is of what was.

    Examples
    --------
    >>> says_actual("Iq_act_#"), says_actual("Axis#.ActPos"), says_actual("Iq_#")
    (True, True, False)
    """
    return any(word in ACTUAL for word in _words(pattern))


def nearness(pattern: str) -> int:
    """Return 1 of a temperature that is by its name the motor's or joint's, -1 of a drive's.

    Examples
    --------
    >>> nearness("MOTOR_TEMPERATURE"), nearness("TEMPERATURE"), nearness("drive_temp_#")
    (1, 0, -1)
    """
    words = _words(pattern)
    return any(word in OF_JOINT for word in words) - any(word in OF_DRIVE for word in words)


def _words(pattern: str) -> list[str]:
    """Split a name at everything that is no letter, and where small letters turn to capitals.

    German compounds, such as `Stromistwert`, are split before what they say of themselves.
    """
    spaced = re.sub(r"([a-z])([A-Z]|(?:ist|soll)wert(?![a-z]))", r"\1 \2", pattern)
    return [word.lower() for word in re.findall(r"[^\W\d_]+", spaced)]


def _numbered(name: str) -> tuple[int | None, str]:
    """Return the last number of a name and the name without it: `actual_q_3` gives 3."""
    matches = list(re.finditer(r"[0-9]+", name))
    if not matches:
        return None, name
    last = matches[-1]
    return int(last[0]), name[: last.start()] + "#" + name[last.end() :]
