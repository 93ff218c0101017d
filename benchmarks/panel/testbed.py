"""The testbed's whole arm with all its parts (configs/testbed.yaml), one axis at a time."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from opamc_cli.config.testbed import load_testbed
from opamc_cli.testbed.parameters import Effect
from opamc_cli.testbed.robot import AxisRecording, simulate
from panel.case import RIGID, Case, Floats, Logged, Wanted

CONFIG = load_testbed(Path(__file__).parents[2] / "configs" / "testbed.yaml")
SPEEDS = (20.0, 50.0, 100.0)
RATES_HZ = (2000.0, 500.0, 100.0)
SECONDS = 40.0
PRESENT = ("elasticity", "ripple", "stribeck", "load_friction", "hysteresis", "thermal_viscous",
           "offset", "time_delay", "sensor_offset", "sensor_gain")  # fmt: skip
"""What the whole arm has without anything being switched on (configs/testbed.yaml)."""
TOP_RAD_S = CONFIG.robot.electrical_hz_full_speed * 2 * np.pi / 500
UNITS: dict[str, tuple[float, dict[str, float]]] = {
    "ripple": (0.1, {"order": 2.0}),
    "stribeck": (0.2, {"velocity_rad_s": 0.1 * TOP_RAD_S}),
    "quadratic_friction": (0.05, {}),
    "sublinear_friction": (0.2, {"exponent": 0.5}),
    "asymmetric_friction": (0.1, {}),
    "load_friction": (0.01, {}),
    "thermal_viscous": (-0.02, {}),
    "warmup": (0.3, {"time_constant_s": 0.3 * SECONDS}),
    "spring": (0.3, {"angle_rad": 0.3}),
    "position_drag": (0.3, {"angle_rad": 0.4, "width_rad": 0.1}),
    "hysteresis": (0.2, {"width_rad": 0.15}),
    "mains_hum": (0.1, {"frequency_hz": 50.0}),
    "offset": (0.2, {}),
}
"""Magnitudes and parameters whose residual is measured, then scaled to the size asked for."""


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Every axis and speed, once as it is and once with an effect; 100 Hz and phases in turn.

    Last the program of configs/testbed.yaml on axes 1 and 5 with a large ripple, which a drive
    answers with another size and phase at every speed.
    """
    names = list(UNITS)
    for axis in range(1, 7):
        for k, speed in enumerate(SPEEDS):
            place = 3 * (axis - 1) + k
            sensing = "phases" if (place + seed) % 6 == 5 else "position"
            rate_hz = 2000.0 if sensing == "phases" else RATES_HZ[(axis + k + seed) % 3]
            effect = names[(place + 5 * seed) % len(names)]
            for hidden in ("", effect):
                size = wanted.turn(place + seed) if hidden else None
                yield _case("cyclic", axis, speed, rate_hz, hidden, size, seed, sensing)
    for axis in (1, 5):
        size = max(wanted.sizes)
        yield _case("four cycles", axis, 100.0, 2000.0, "ripple", size, seed, "position")


def _case(
    stroke: str, axis: int, speed: float, rate_hz: float, hidden: str, size: float | None,
    seed: int, sensing: str,
) -> Case:  # fmt: skip
    joint = CONFIG.robot.joints[axis - 1]
    cycles = 4
    if stroke == "cyclic":
        cycles = max(round(SECONDS / (3.0 + 225.0 / speed)), 2)
    return Case(
        "testbed",
        f"axis {axis} {speed:g}% {rate_hz:g} Hz {hidden or 'none'}",
        stroke,
        sensing,
        RIGID,
        hidden,
        partial(record, axis, speed, cycles, rate_hz, hidden, size or 0.0, seed, sensing),
        PRESENT,
        size,
        (joint.gear.ratio, joint.motor.pole_pairs) if axis % 2 else None,
        seed,
    )


def session(
    axis: int, speed: float, cycles: int, rate_hz: float, effect: Effect | None, seed: int
) -> AxisRecording:
    """Record one axis alone."""
    program = replace(CONFIG.program, axes=(axis,), speed_percent=speed, cycles=cycles)
    effects = [effect] if effect else []
    made = simulate(
        CONFIG.robot, program, seed=seed, sampling_rate_hz=rate_hz, axes=[axis], effects=effects
    )
    return made.axes[axis]


def noise_a(axis: int, sensing: str) -> float:
    """Return what does not repeat: the sensors' noise, and friction that fluctuates."""
    robot, joint = CONFIG.robot, CONFIG.robot.joints[axis - 1]
    fluctuation = joint.friction.fluctuation_nm / joint.motor.torque_constant_nm_per_a
    # Of three phases' noise two thirds fall on the vector, half of them on the torque's axis.
    sensor = robot.sensor.reported_noise_a
    if sensing == "phases":
        sensor = robot.sensor.noise_a * np.sqrt(2 / 3)
    return float(np.hypot(fluctuation, sensor))


def unexplained(change: Floats, axis_log: AxisRecording, rate_hz: float) -> float:
    """Root mean square of a change of the current that no rigid effect takes over, in motion."""
    q, v = axis_log.position_rad, axis_log.velocity_rad_s
    a = np.gradient(v) * rate_hz
    moving = np.abs(v) > 0.02 * np.abs(v).max()
    design = np.stack([a, np.sin(q), np.cos(q), np.sign(v), v], axis=1)[moving]
    left = change[moving] - design @ np.linalg.lstsq(design, change[moving], rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))


def record(
    axis: int,
    speed: float,
    cycles: int,
    rate_hz: float,
    hidden: str,
    size: float,
    seed: int,
    sensing: str,
) -> list[Logged]:
    """Record an axis; an effect is scaled to so many times the noise of what is logged."""
    effect = None
    if hidden:
        magnitude, parameters = UNITS[hidden]
        if hidden == "mains_hum" and rate_hz == 100.0:
            parameters = {"frequency_hz": 60.0}
        whole = session(axis, speed, cycles, rate_hz, None, seed)
        tried = session(
            axis, speed, cycles, rate_hz, Effect(hidden, axis, magnitude, parameters), seed
        )
        change = tried.reported_a.astype(float) - whole.reported_a.astype(float)
        left = unexplained(change, whole, rate_hz)
        wanted = size * noise_a(axis, sensing)
        effect = Effect(hidden, axis, magnitude * wanted / max(left, 1e-9), parameters)
    axis_log = session(axis, speed, cycles, rate_hz, effect, seed)
    warm = axis_log.temperature_c.astype(float)
    if sensing == "phases":
        return [Logged(rate_hz, phases=axis_log.phases_a.astype(float), temperature=warm)]
    return [
        Logged(
            rate_hz,
            current=axis_log.reported_a.astype(float),
            position=axis_log.position_rad,
            temperature=warm,
        )
    ]
