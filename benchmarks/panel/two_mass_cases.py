"""Cases of the two-mass simulator: every effect, stiff and compliant, all strokes and rates."""

from collections.abc import Iterator
from functools import partial

from panel import two_mass
from panel.case import SIZES, Case, Logged, Wanted

NOTHING = 1
"""Joints with nothing hidden, of every stroke, with a position and from phases alone."""


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Each effect once a seed; stroke, rate, size and stiffness in turn."""
    for k, hidden in enumerate([*two_mass.EFFECTS, *[""] * len(two_mass.STROKES) * NOTHING]):
        able = [s for s in two_mass.STROKES if hidden in two_mass.FEW.get(s, (hidden,))]
        if not hidden:
            able = [two_mass.STROKES[k % len(two_mass.STROKES)]]
        yield _case(hidden, "position", able[(k + seed) % len(able)], seed, k, wanted)
    for k, hidden in enumerate(("ripple", "load_friction", *two_mass.ELECTRICAL, "")):
        yield _case(hidden, "phases", "cyclic", seed, 30 + k, wanted)


def _case(hidden: str, sensing: str, stroke: str, seed: int, k: int, wanted: Wanted) -> Case:
    number = 100 * seed + k
    rates = two_mass.RATES_HZ
    rate_hz = 2000.0 if sensing == "phases" else rates[(k + seed // len(SIZES)) % 3]
    size = wanted.turn(k + seed) if hidden else None
    compliant = (
        hidden not in ("elasticity", *two_mass.ELECTRICAL)
        and sensing == "position"
        and stroke not in ("torque steps", "one stroke")
        and (k + seed) % 2 == 1
    )
    left_out = {hidden} | ({"gravity"} if stroke == "torque steps" else set())
    joint = two_mass.joint_of(number, stroke)
    return Case(
        "two-mass",
        f"{hidden or 'none'} {stroke} {rate_hz:g} Hz{' compliant' * compliant} {number}",
        stroke,
        sensing,
        tuple(name for name in two_mass.DECLARED if name not in left_out),
        hidden,
        partial(record, hidden, size or 0.0, number, stroke, rate_hz, compliant, sensing),
        ("elasticity",) if compliant else (),
        size,
        (joint.ratio, joint.pole_pairs) if number % 2 or sensing == "phases" else None,
        number,
    )


def record(
    hidden: str,
    size: float,
    number: int,
    stroke: str,
    rate_hz: float,
    compliant: bool,
    sensing: str,
) -> list[Logged]:
    """Record one joint; the temperature is logged only where it matters."""
    _joint, made, _noise_a = two_mass.record(
        hidden, size, number, stroke, rate_hz, compliant=compliant
    )
    phases = sensing == "phases"
    return [
        Logged(
            rate_hz,
            current=None if phases else r.current,
            phases=r.phases if phases else None,
            position=None if phases else r.position,
            temperature=r.temperature if hidden == "thermal_viscous" else None,
        )
        for r in made
    ]
