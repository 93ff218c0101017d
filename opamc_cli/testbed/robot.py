"""One recording of the virtual robot: program in, phase currents and truth out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter

from opamc_cli.testbed.effects import (
    apply_to_constants,
    apply_to_reported,
    apply_to_sensors,
    complete,
)
from opamc_cli.testbed.mechanics.constants import axis_constants
from opamc_cli.testbed.mechanics.kernel import SIGNALS, AxisConstants, run_axis
from opamc_cli.testbed.parameters import Damage, Effect, Joint, Robot
from opamc_cli.testbed.program import Program, Schedule, reference, schedule
from opamc_cli.testbed.sensors import phase_currents
from opamc_cli.testbed.session import AxisSession, draw_session, stream

_CONTROL_HZ = 4000.0
_STEP_HZ = 16000.0
_SETTLE_S = 0.75
"""Simulated before the first sample, so that the arm hangs at rest when the recording starts."""


@dataclass(frozen=True)
class TrueSegment:
    """One motion as it was taught, in samples, half-open."""

    axis: int
    cycle: int
    motion: int
    start: int
    stop: int


@dataclass(frozen=True)
class AxisRecording:
    """What one axis's sensors give, and what truly happened."""

    phases_a: NDArray[np.float32]
    """Shape (n, 3)."""
    reported_a: NDArray[np.float32]
    """Signed motor current as the drive reports it; shape (n,)."""
    position_rad: NDArray[np.float64]
    velocity_rad_s: NDArray[np.float64]
    """With `position_rad`: joint side, from the motor encoder, as a drive reports; shape (n,)."""
    temperature_c: NDArray[np.float32]
    """Shape (n,)."""
    iq_a: NDArray[np.float64]
    motor_angle_rad: NDArray[np.float64]
    motor_velocity_rad_s: NDArray[np.float64]
    """With `iq_a`, `motor_angle_rad`: truth; shape (n,)."""
    joint_angle_rad: NDArray[np.float64]
    joint_velocity_rad_s: NDArray[np.float64]
    true_temperature_c: NDArray[np.float64]
    """With `joint_angle_rad`, `joint_velocity_rad_s`: truth; shape (n,)."""


@dataclass(frozen=True)
class Recording:
    """One recording: the axes' signals, the true segments, and what was switched on."""

    sampling_rate_hz: float
    axes: dict[int, AxisRecording]
    segments: tuple[TrueSegment, ...]
    faults: dict[int, Damage]
    effects: tuple[Effect, ...]
    sessions: dict[int, AxisSession]


def simulate(
    robot: Robot,
    program: Program,
    *,
    seed: int,
    session: int = 0,
    sampling_rate_hz: float = 2048.0,
    faults: Mapping[int, Damage] | None = None,
    effects: Sequence[Effect] = (),
    axes: Sequence[int] | None = None,
    refinement: int = 1,
) -> Recording:
    """Record one session of a robot that runs a program.

    Parameters
    ----------
    robot : Robot
    program : Program
    seed, session : int
        Not negative. The same pair gives the same recording, whatever else is simulated.
    sampling_rate_hz : float
        Of the recording.
    faults : mapping, optional
        Damage by axis.
    effects : sequence of Effect
        What is undeclared.
    axes : sequence of int, optional
        Axes to record; all by default. An axis's recording does not depend on the others'.
    refinement : int
        Divides the integration step.

    Returns
    -------
    Recording

    Raises
    ------
    ValueError
        If the program, the faults or the effects do not fit the robot, or a joint runs away.
    """
    faults = dict(faults or {})
    effects = tuple(complete(effect) for effect in effects)
    count = len(robot.joints)
    recorded = tuple(axes) if axes is not None else tuple(range(1, count + 1))
    for axis in {*program.axes, *faults, *recorded, *(e.axis for e in effects)}:
        if not 1 <= axis <= count:
            msg = f"axis {axis} does not exist; {robot.name} has axes 1 to {count}"
            raise ValueError(msg)
    plan = schedule(
        program,
        {axis: top_velocity_rad_s(robot, axis) for axis in program.axes},
        stream(seed, session + 1, 0, 1),
    )
    n_samples = ceil(plan.duration_s * sampling_rate_hz)
    sessions = {axis: draw_session(robot, axis, seed, session) for axis in recorded}
    return Recording(
        sampling_rate_hz=sampling_rate_hz,
        axes={
            axis: _record_axis(
                robot,
                axis,
                program,
                plan,
                n_samples,
                sampling_rate_hz,
                refinement,
                sessions[axis],
                faults.get(axis, Damage()),
                [effect for effect in effects if effect.axis == axis],
                stream(seed, session + 1, axis, 1),
            )
            for axis in recorded
        },
        segments=tuple(
            TrueSegment(
                move.axis,
                move.cycle,
                move.motion,
                round(move.start_s * sampling_rate_hz),
                round((move.start_s + move.move.duration_s) * sampling_rate_hz),
            )
            for move in plan.moves
        ),
        faults=faults,
        effects=effects,
        sessions=sessions,
    )


def top_velocity_rad_s(robot: Robot, axis: int) -> float:
    """Joint velocity at full speed: the electrical frequency is the same on every axis."""
    joint = robot.joints[axis - 1]
    electrical = 2.0 * pi * robot.electrical_hz_full_speed
    return electrical / joint.motor.pole_pairs / joint.gear.ratio


def _record_axis(
    robot: Robot,
    axis: int,
    program: Program,
    plan: Schedule,
    n_samples: int,
    rate_hz: float,
    refinement: int,
    session: AxisSession,
    damage: Damage,
    effects: list[Effect],
    rng: np.random.Generator,
) -> AxisRecording:
    joint, sensor = robot.joints[axis - 1], robot.sensor
    controls = max(1, round(_CONTROL_HZ / rate_hz))
    steps = max(1, round(_STEP_HZ / (rate_hz * controls))) * refinement
    control_hz = rate_hz * controls
    settle = round(_SETTLE_S * rate_hz)
    n_total = n_samples + settle
    position, velocity, acceleration = _padded_reference(
        plan, axis, program.waypoints_rad[0], control_hz, n_samples * controls, settle * controls
    )
    constants = axis_constants(
        joint,
        sensor,
        session,
        damage,
        payload_kg=program.payload_kg,
        start_rad=position[0],
        sampling_rate_hz=rate_hz,
        controls_per_sample=controls,
        steps_per_control=steps,
    )
    ripples = apply_to_constants(effects, constants)
    constants["payload_change_s"] += settle / rate_hz
    # The same power per hertz whatever the control rate; the size is that at 2 kHz.
    spread_nm = joint.friction.fluctuation_nm * sqrt(control_hz * 1e-3 / 2)
    fluctuation = spread_nm * rng.standard_normal(len(position))
    sections = butter(
        sensor.filter_order,
        sensor.filter_share * rate_hz,
        fs=control_hz * steps,
        output="sos",
    )
    known = {name: constants[name] for name in AxisConstants._fields}
    out = run_axis(
        AxisConstants(**known),  # type: ignore[arg-type]  # counts stay int, flags bool
        position,
        velocity,
        acceleration,
        fluctuation,
        ripples,
        np.ascontiguousarray(sections),
        n_total,
    )[settle:]
    if not np.isfinite(out).all():
        names = ", ".join(f"{effect.name} {effect.magnitude:g}" for effect in effects)
        msg = f"axis {axis} runs away ({names or 'nothing undeclared'}): its control is not stable"
        raise ValueError(msg)
    return _measure(joint, robot, out, session, effects, rate_hz, rng)


def _padded_reference(
    plan: Schedule, axis: int, rest_rad: float, control_hz: float, n: int, settle: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    position, velocity, acceleration = reference(plan, axis, rest_rad, control_hz, n)
    before = np.zeros(settle)
    return (
        np.concatenate([before + position[0], position]),
        np.concatenate([before, velocity]),
        np.concatenate([before, acceleration]),
    )


def _measure(
    joint: Joint,
    robot: Robot,
    out: NDArray[np.float64],
    session: AxisSession,
    effects: list[Effect],
    rate_hz: float,
    rng: np.random.Generator,
) -> AxisRecording:
    sensor, ratio = robot.sensor, joint.gear.ratio
    signal = {
        name: np.ascontiguousarray(column) for name, column in zip(SIGNALS, out.T, strict=True)
    }
    n = len(out)
    noise = sensor.noise_a * rng.standard_normal((n, 3))
    vector = np.column_stack([signal["alpha_a"], signal["beta_a"]])
    gain, offset, hum, vector = apply_to_sensors(
        effects, session.phase_gain, session.phase_offset_a, vector, rate_hz
    )
    phases = phase_currents(
        vector[:, 0],
        vector[:, 1],
        gain,
        offset,
        noise + hum,
        sensor.full_scale_a,
        sensor.bits,
    )
    electrical = joint.motor.pole_pairs * signal["motor_angle_rad"]
    reported = apply_to_reported(effects, signal["reported_a"], electrical, rate_hz)
    reported = reported + sensor.reported_noise_a * rng.standard_normal(n)
    counts = joint.control.encoder_counts_per_turn
    step = 2.0 * pi / counts if counts else 0.0
    motor = signal["motor_angle_rad"]
    encoder = np.floor(motor / step) * step if step else motor
    resolution = sensor.temperature_resolution_c
    warm = signal["temperature_c"]
    shown = np.rint(warm / resolution) * resolution if resolution else warm
    return AxisRecording(
        phases_a=phases,
        reported_a=reported.astype(np.float32),
        position_rad=encoder / ratio,
        velocity_rad_s=signal["motor_velocity_rad_s"] / ratio,
        temperature_c=shown.astype(np.float32),
        iq_a=signal["iq_a"],
        motor_angle_rad=motor,
        motor_velocity_rad_s=signal["motor_velocity_rad_s"],
        joint_angle_rad=signal["joint_angle_rad"],
        joint_velocity_rad_s=signal["joint_velocity_rad_s"],
        true_temperature_c=warm,
    )
