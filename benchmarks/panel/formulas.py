"""Joints whose current is a formula: of the tests, and of benchmarks/sources/algebraic_joint.py."""

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from panel.case import RIGID, SIZES, Case, Logged, Wanted

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "sources"))
import algebraic_joint
import simulator

PHASE_EFFECTS = (
    "stribeck", "ripple", "quadratic_friction", "position_drag", "hysteresis", "load_friction",
    "warmup", "mains_hum", *simulator.ELECTRICAL,
)  # fmt: skip
NOTHING = 4


def smooth_cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Yield every effect of the tests' simulator with a position, some from phases alone."""
    rates = (100.0, 500.0, 2000.0)
    effects = [*simulator.EFFECTS, *[""] * NOTHING]
    for sensing, names in (("position", effects), ("phases", [*PHASE_EFFECTS, ""])):
        for k, hidden in enumerate(names):
            size = wanted.turn(k + seed) if hidden else None
            rate_hz = 2000.0 if sensing == "phases" else rates[(k + seed // len(SIZES)) % 3]
            declared = tuple(name for name in RIGID if name != hidden)
            number = 100 * seed + k + (50 if sensing == "phases" else 0)
            yield Case(
                "smooth",
                f"{hidden or 'none'} {rate_hz:g} Hz {number}",
                "cyclic",
                sensing,
                declared,
                hidden,
                partial(smooth, hidden, size or 0.0, rate_hz, declared, sensing, number),
                size=size,
                gear=_smooth_gear(number, rate_hz, sensing),
                seed=number,
            )


def _smooth_gear(number: int, rate_hz: float, sensing: str) -> tuple[float, int] | None:
    if not (number % 2 or sensing == "phases"):
        return None
    made = simulator.simulate(number, (), 0.0, rate=rate_hz)
    return made.gear_ratio, made.pole_pairs


def smooth(
    hidden: str, size: float, rate_hz: float, declared: tuple[str, ...], sensing: str, number: int
) -> list[Logged]:
    """Record one joint of the tests' simulator."""
    phases = sensing == "phases"
    made = simulator.simulate(
        number, (hidden,) if hidden else (), size, rate=rate_hz, declared=declared,
        phase_errors=phases,
    )  # fmt: skip
    return [
        Logged(
            made.rate_hz,
            current=None if phases else made.current,
            phases=made.phases if phases else None,
            position=None if phases else made.position,
            temperature=made.temperature,
        )
    ]


def algebraic_cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Exact motion with steps of the acceleration, encoders of 1e-6 to 1e-3 rad."""
    effects = [*algebraic_joint.EFFECTS, *[""] * NOTHING]
    motions = list(algebraic_joint.MOTIONS)
    for k, hidden in enumerate(effects):
        number = 100 * seed + k
        motion = motions[(k + seed) % len(motions)]
        size = wanted.turn(k + 2 * seed) if hidden else None
        stroke = "several programs" if motion == "random" else "cyclic"
        joint = algebraic_joint.record(motion, None, 0.0, number).joint
        yield Case(
            "algebraic",
            f"{hidden or 'none'} {motion} {joint.path.rate_hz:g} Hz {number}",
            stroke,
            "position",
            RIGID,
            hidden,
            partial(algebraic, hidden, size or 0.0, motion, number),
            size=size,
            gear=(joint.gear_ratio, joint.pole_pairs) if number % 2 else None,
            seed=number,
        )


def algebraic(hidden: str, size: float, motion: str, number: int) -> list[Logged]:
    """Record one joint of benchmarks/sources/algebraic_joint.py."""
    made = algebraic_joint.record(motion, hidden or None, size, number)
    warm = np.asarray(made.temperature_c, float) if hidden == "thermal_viscous" else None
    rate_hz = made.joint.path.rate_hz
    return [Logged(rate_hz, current=made.current_a, position=made.position_rad, temperature=warm)]
