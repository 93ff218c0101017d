"""Cases of the industrial joint: every effect and two joints without any, from 100 to 1000 Hz."""

from collections.abc import Iterator
from functools import partial

from sources import servo_joint

from panel.case import Case, Logged, Wanted

SLOW = ("warmup", "payload_change", "thermal_viscous")
"""What one stroke there and back cannot show."""
NOTHING = 2


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Each effect once a seed; stroke, rate and size in turn, one stroke in five."""
    strokes = ("cyclic", "program", "cyclic", "program", "single")
    for k, hidden in enumerate([*servo_joint.EFFECTS, *[""] * NOTHING]):
        number = 100 * seed + k
        stroke = "cyclic" if hidden in SLOW else strokes[(k + seed) % 5]
        rate_hz = servo_joint.RATES_HZ[(3 * k + seed) % 5]
        size = wanted.turn(k + seed) if hidden else None
        yield Case(
            "servo",
            f"{hidden or 'none'} {stroke} {rate_hz:g} Hz {number}",
            stroke,
            "position",
            tuple(name for name in servo_joint.COLUMNS if name != hidden),
            hidden,
            partial(record, number, hidden, size or 0.0, stroke, rate_hz),
            size=size,
            seed=number,
        )


def record(number: int, hidden: str, size: float, stroke: str, rate_hz: float) -> list[Logged]:
    """Record one joint; the temperature is logged only where it matters."""
    made = servo_joint.record(number, hidden, size, stroke, rate_hz)
    warm = made.temperature if hidden == "thermal_viscous" else None
    return [Logged(rate_hz, made.current, position=made.position, temperature=warm)]
