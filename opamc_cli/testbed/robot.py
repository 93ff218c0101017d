"""One recording of the virtual robot: program in, phase currents and truth out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, cos, exp, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter

from opamc_cli.testbed.effects import (
    apply_to_constants,
    apply_to_phases,
    apply_to_reported,
    complete,
)
from opamc_cli.testbed.kernel import AxisConstants, run_axis
from opamc_cli.testbed.parameters import Damage, Effect, Joint, Robot
from opamc_cli.testbed.program import Program, Schedule, reference, schedule
from opamc_cli.testbed.sensors import phase_currents
from opamc_cli.testbed.session import AxisSession, draw_session, stream

GRAVITY_M_S2 = 9.80665
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
    """What one axis's sensors give, and what truly happened.

    Attributes
    ----------
    phases_a : ndarray of float32, shape (n, 3)
    reported_a : ndarray of float32, shape (n,)
        Signed motor current as the drive reports it.
    position_rad, velocity_rad_s : ndarray, shape (n,)
        Joint side, from the motor encoder, as a drive reports them.
    temperature_c : ndarray of float32, shape (n,)
    iq_a, motor_angle_rad, motor_velocity_rad_s : ndarray, shape (n,)
        Truth.
    joint_angle_rad, joint_velocity_rad_s, true_temperature_c : ndarray, shape (n,)
        Truth.
    """

    phases_a: NDArray[np.float32]
    reported_a: NDArray[np.float32]
    position_rad: NDArray[np.float64]
    velocity_rad_s: NDArray[np.float64]
    temperature_c: NDArray[np.float32]
    iq_a: NDArray[np.float64]
    motor_angle_rad: NDArray[np.float64]
    motor_velocity_rad_s: NDArray[np.float64]
    joint_angle_rad: NDArray[np.float64]
    joint_velocity_rad_s: NDArray[np.float64]
    true_temperature_c: NDArray[np.float64]


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
        If the program, the faults or the effects do not fit the robot.
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
    constants = _constants(joint, session, damage, program.payload_kg, position[0])
    constants["step_s"] = 1.0 / (control_hz * steps)
    constants["steps_per_control"] = steps
    constants["controls_per_sample"] = controls
    _digital(constants, joint, robot, control_hz)
    ripples = apply_to_constants(effects, constants)
    constants["payload_change_s"] += settle / rate_hz
    rest = sqrt(control_hz * 1e-3 / 2)  # white noise held over one control period -> about 1 kHz
    fluctuation = joint.friction.fluctuation_nm * rest * rng.standard_normal(len(position))
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


def _constants(
    joint: Joint, session: AxisSession, damage: Damage, payload_kg: float, start_rad: float
) -> dict[str, float]:
    """Physical constants of one axis in one session, by the names of `AxisConstants`."""
    motor, gear, friction, link = joint.motor, joint.gear, joint.friction, joint.link
    arm = link.payload_arm_m
    inertia_per_kg = arm**2
    gravity_per_kg = link.payload_gravity_share * GRAVITY_M_S2 * arm
    link_inertia = link.inertia_kgm2 + payload_kg * inertia_per_kg
    gravity = link.gravity_torque_nm + payload_kg * gravity_per_kg
    load = gravity * sin(start_rad - link.gravity_angle_rad)
    mount, error = session.mount_rad, session.error
    windup = load / gear.stiffness_nm_per_rad
    constants: dict[str, float] = dict.fromkeys(AxisConstants._fields, 0.0)
    constants.update(
        pole_pairs=float(motor.pole_pairs),
        torque_constant=motor.torque_constant_nm_per_a,
        motor_inertia=motor.inertia_kgm2,
        resistance=motor.resistance_ohm,
        inductance=motor.inductance_h,
        phase_voltage=motor.bus_voltage_v / sqrt(3.0),
        current_limit=motor.current_limit_a,
        cogging_order=motor.cogging_order,
        cogging_torque=motor.cogging_torque_nm,
        ratio=gear.ratio,
        stiffness=gear.stiffness_nm_per_rad,
        stiffening=gear.stiffening_nm_per_rad3,
        damping=gear.damping_nms_per_rad,
        hysteresis_torque=gear.hysteresis_torque_nm,
        hysteresis_width=gear.hysteresis_width_rad,
        error_2c=gear.error_2_circular_rad * error,
        error_4c_sin=gear.error_4_circular_rad * error * cos(mount[1]),
        error_4c_cos=gear.error_4_circular_rad * error * sin(mount[1]),
        error_2f=gear.error_2_flexspline_rad * error,
        error_4f_sin=gear.error_4_flexspline_rad * error * cos(mount[3]),
        error_4f_cos=gear.error_4_flexspline_rad * error * sin(mount[3]),
        phase_2c=mount[0],
        phase_2f=mount[2],
        tooth_mesh_order=2.0 * gear.ratio + 2.0,  # teeth of the circular spline
        tooth_mesh_torque=gear.tooth_mesh_torque_nm,
        severity=damage.severity,
        half_sector=pi * damage.share,
        half_zone=damage.zone_half_width_rad,
        half_play=0.5 * damage.gap_rad,
        stiffness_loss=damage.stiffness_loss,
        play_shared=damage.gap_shared,
        closing=damage.closing,
        sector_angle=mount[4],
        coulomb=friction.coulomb_nm * session.friction,
        viscous=friction.viscous_nms_per_rad * session.friction * session.viscous,
        stribeck=friction.stribeck_nm * session.friction,
        stribeck_velocity=friction.stribeck_velocity_rad_s,
        smoothing_velocity=friction.smoothing_velocity_rad_s,
        load_coefficient=friction.load_coefficient,
        viscous_per_kelvin=friction.viscous_per_kelvin,
        coulomb_per_kelvin=friction.coulomb_per_kelvin,
        output_coulomb=friction.output_coulomb_nm,
        output_viscous=friction.output_viscous_nms_per_rad,
        link_inertia=link_inertia,
        gravity=gravity,
        late_link_inertia=link_inertia,
        late_gravity=gravity,
        payload_change_s=np.inf,
        payload_inertia_per_kg=inertia_per_kg,
        payload_gravity_per_kg=gravity_per_kg,
        gravity_angle=link.gravity_angle_rad,
        ambient_c=joint.thermal.ambient_c,
        start_c=session.temperature_c,
        heat_resistance=joint.thermal.resistance_k_per_w,
        heat_time=joint.thermal.time_constant_s,
        start_joint=start_rad - windup,
        start_motor=start_rad * gear.ratio,
        start_current=load / gear.ratio / motor.torque_constant_nm_per_a,
        fx_stribeck_velocity=1.0,
        fx_warmup_time=1.0,
        fx_drag_width=1.0,
        fx_hysteresis_width=1.0,
    )
    return constants


def _digital(constants: dict[str, float], joint: Joint, robot: Robot, control_hz: float) -> None:
    """Set the controller's and the drive's constants; these know the nominal robot only."""
    motor, control, friction = joint.motor, joint.control, joint.friction
    ratio, k = joint.gear.ratio, joint.motor.torque_constant_nm_per_a
    inertia = motor.inertia_kgm2 + constants["link_inertia"] / ratio**2
    gain = 2.0 * pi * control.velocity_bandwidth_hz * inertia / k
    step_s = constants["step_s"]
    counts = control.encoder_counts_per_turn
    constants.update(
        position_gain=control.position_gain_per_s,
        velocity_gain=gain,
        velocity_integral=gain / control.velocity_integral_time_s,
        current_blend=1.0 - exp(-2.0 * pi * control.current_bandwidth_hz * step_s),
        velocity_blend=1.0 - exp(-2.0 * pi * control.velocity_filter_hz / control_hz),
        encoder_step=2.0 * pi / counts if counts else 0.0,
        feed_inertia=control.inertia_feedforward * inertia * ratio / k,
        feed_coulomb=control.friction_feedforward * friction.coulomb_nm / k,
        feed_viscous=control.friction_feedforward * friction.viscous_nms_per_rad * ratio / k,
        feed_gravity=control.gravity_feedforward * constants["gravity"] / ratio / k,
        report_blend=1.0 - exp(-2.0 * pi * robot.sensor.reported_filter_hz * step_s),
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
    n = len(out)
    noise = sensor.noise_a * rng.standard_normal((n, 3))
    wrong = [e for e in effects if e.name in ("sensor_offset", "sensor_gain", "mains_hum")]
    late = [e for e in effects if e.name == "time_delay"]
    vector = np.column_stack([out[:, 6], out[:, 7], np.zeros(n)])
    vector = apply_to_phases(late, vector, rate_hz)
    gain, offset = session.phase_gain.copy(), session.phase_offset_a.copy()
    disturbance = apply_to_phases(
        [e for e in wrong if e.name != "sensor_gain"], np.zeros((n, 3)), rate_hz
    )
    for effect in wrong:
        if effect.name == "sensor_gain":
            gain[int(effect.parameters["phase"])] *= 1.0 + effect.magnitude
    phases = phase_currents(
        vector[:, 0],
        vector[:, 1],
        gain,
        offset,
        noise + disturbance,
        sensor.full_scale_a,
        sensor.bits,
    )
    reported = apply_to_reported(effects, out[:, 8], rate_hz)
    reported = reported + sensor.reported_noise_a * rng.standard_normal(n)
    counts = joint.control.encoder_counts_per_turn
    step = 2.0 * pi / counts if counts else 0.0
    motor = np.floor(out[:, 1] / step) * step if step else out[:, 1]
    resolution = sensor.temperature_resolution_c
    warm = np.rint(out[:, 5] / resolution) * resolution if resolution else out[:, 5]
    return AxisRecording(
        phases_a=phases,
        reported_a=reported.astype(np.float32),
        position_rad=motor / ratio,
        velocity_rad_s=out[:, 2] / ratio,
        temperature_c=warm.astype(np.float32),
        iq_a=out[:, 0].copy(),
        motor_angle_rad=out[:, 1].copy(),
        motor_velocity_rad_s=out[:, 2].copy(),
        joint_angle_rad=out[:, 3].copy(),
        joint_velocity_rad_s=out[:, 4].copy(),
        true_temperature_c=out[:, 5].copy(),
    )
