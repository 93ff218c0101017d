"""The simulated joint against what mechanics says about it."""

from dataclasses import replace

import numpy as np
import pytest
from robot_variations import (
    QUIET_FRICTION,
    QUIET_GEAR,
    QUIET_MOTOR,
    SMOOTH_ENCODER,
    with_joint,
)

from opamc_cli.testbed.mechanics.constants import GRAVITY_M_S2, axis_constants
from opamc_cli.testbed.mechanics.kernel import AxisConstants, motor_friction, run_axis, smooth_sign
from opamc_cli.testbed.mechanics.mesh import damaged_share, zone_torque
from opamc_cli.testbed.parameters import Damage, Robot
from opamc_cli.testbed.program import Program
from opamc_cli.testbed.robot import AxisRecording, Recording, simulate
from opamc_cli.testbed.session import draw_session

EVERY_STEP_HZ = 16000.0  # sampling at the integration step


def _axis3(recording: Recording) -> AxisRecording:
    return recording.axes[3]


def _quiet(robot: Robot) -> Robot:
    return with_joint(
        robot,
        3,
        gear=QUIET_GEAR,
        motor=QUIET_MOTOR,
        friction=QUIET_FRICTION,
        control=SMOOTH_ENCODER,
    )


def _constants(robot: Robot, seed: int, payload_kg: float = 0.0) -> AxisConstants:
    values = axis_constants(
        robot.joints[2],
        robot.sensor,
        draw_session(robot, 3, seed, 0),
        Damage(),
        payload_kg=payload_kg,
        start_rad=0.0,
        sampling_rate_hz=EVERY_STEP_HZ,
        controls_per_sample=1,
        steps_per_control=1,
    )
    return AxisConstants(**{name: values[name] for name in AxisConstants._fields})


def _friction(c: AxisConstants, velocity, temperature, load):
    warmer = temperature - 25.0
    cold = np.exp(-c.coulomb_per_kelvin * warmer)
    return np.array(
        [
            motor_friction(
                v,
                t,
                c.coulomb * k,
                c.viscous * np.exp(-c.viscous_per_kelvin * w),
                c.stribeck * k,
                c.stribeck_velocity,
                c.smoothing_velocity,
                c.load_coefficient,
            )
            for v, t, k, w in zip(velocity, load, cold, warmer, strict=True)
        ]
    )


def test_a_rigid_joint_needs_the_closed_form_torque(robot: Robot, program: Program) -> None:
    rigid = with_joint(
        _quiet(robot),
        3,
        gear={
            "stiffness_nm_per_rad": 5e6,
            "stiffening_nm_per_rad3": 0.0,
            "damping_nms_per_rad": 2000.0,
        },
        friction={"load_coefficient": 0.0},
    )
    payload_kg = 1.5
    recording = simulate(
        rigid,
        replace(program, payload_kg=payload_kg),
        seed=5,
        axes=[3],
        sampling_rate_hz=EVERY_STEP_HZ,
    )
    axis = _axis3(recording)
    c = _constants(rigid, 5, payload_kg)
    joint = rigid.joints[2]
    n, link = joint.gear.ratio, joint.link
    acceleration = np.gradient(axis.motor_velocity_rad_s) * EVERY_STEP_HZ / n
    inertia = link.inertia_kgm2 + payload_kg * link.payload_arm_m**2
    gravity = link.gravity_torque_nm + payload_kg * GRAVITY_M_S2 * link.payload_arm_m
    velocity = axis.motor_velocity_rad_s
    load = (
        inertia * acceleration
        + gravity * np.sin(axis.motor_angle_rad / n - link.gravity_angle_rad)
        + joint.friction.output_viscous_nms_per_rad * velocity / n
        + joint.friction.output_coulomb_nm
        * velocity
        / np.hypot(velocity, joint.friction.smoothing_velocity_rad_s)
    )
    torque = (
        joint.motor.inertia_kgm2 * n * acceleration
        + load / n
        + _friction(c, velocity, axis.true_temperature_c, np.zeros_like(load))
    )
    simulated = joint.motor.torque_constant_nm_per_a * axis.iq_a
    error = np.sqrt(np.mean((simulated - torque) ** 2)) / np.sqrt(np.mean(torque**2))
    assert error < 0.01


def test_the_free_spring_rings_at_the_two_mass_resonance(robot: Robot) -> None:
    free = with_joint(
        _quiet(robot),
        3,
        gear={"stiffening_nm_per_rad3": 0.0, "damping_nms_per_rad": 0.0},
        link={"gravity_torque_nm": 0.0},
        control={"velocity_bandwidth_hz": 0.0, "inertia_feedforward": 0.0},
        friction={
            "coulomb_nm": 0.0,
            "viscous_nms_per_rad": 0.0,
            "stribeck_nm": 0.0,
            "load_coefficient": 0.0,
            "output_coulomb_nm": 0.0,
            "output_viscous_nms_per_rad": 0.0,
        },
    )
    c = _constants(free, 1)._replace(start_joint=-2e-4)
    n = 32000
    rest = np.zeros(n)
    out = run_axis(c, rest, rest, rest, rest, np.empty((0, 4)), np.array([[1.0, 0, 0, 1, 0, 0]]), n)
    windup = out[:, 1] / c.ratio - out[:, 3]
    crossings = np.flatnonzero((windup[:-1] < 0) & (windup[1:] >= 0))
    at = crossings - windup[crossings] / (windup[crossings + 1] - windup[crossings])
    measured_hz = EVERY_STEP_HZ * (len(at) - 1) / (at[-1] - at[0])
    reflected = c.motor_inertia * c.ratio**2
    expected_hz = np.sqrt(c.stiffness * (1 / c.link_inertia + 1 / reflected)) / (2 * np.pi)
    assert measured_hz == pytest.approx(expected_hz, rel=1e-3)
    assert np.abs(windup).max() == pytest.approx(2e-4, rel=1e-2)  # nothing is gained or lost


@pytest.mark.parametrize("severity", [0.0, 1.0])
def test_energy_is_balanced(robot: Robot, program: Program, severity: float) -> None:
    """What the motor puts in is kinetic, elastic and gravity's, or lost; to 1 %."""
    plain = with_joint(
        robot, 3, motor=QUIET_MOTOR, friction=QUIET_FRICTION, gear={"tooth_mesh_torque_nm": 0.0}
    )
    damage = replace(robot.damage, severity=severity)
    recording = simulate(
        plain,
        program,
        seed=2,
        axes=[3],
        faults={3: damage} if severity else None,
        sampling_rate_hz=EVERY_STEP_HZ,
    )
    axis = _axis3(recording)
    c = _constants(plain, 2)
    damage_c = axis_constants(
        plain.joints[2],
        plain.sensor,
        recording.sessions[3],
        damage,
        payload_kg=0.0,
        start_rad=0.0,
        sampling_rate_hz=EVERY_STEP_HZ,
        controls_per_sample=1,
        steps_per_control=1,
    )
    motor, joint = axis.motor_angle_rad, axis.joint_angle_rad
    omega, joint_omega = axis.motor_velocity_rad_s, axis.joint_velocity_rad_s
    turn = motor + joint
    error = (
        c.error_2c * np.sin(2 * motor + c.phase_2c)
        + c.error_4c_sin * np.sin(4 * motor + 2 * c.phase_2c)
        + c.error_4c_cos * np.cos(4 * motor + 2 * c.phase_2c)
        + c.error_2f * np.sin(2 * turn + c.phase_2f)
        + c.error_4f_sin * np.sin(4 * turn + 2 * c.phase_2f)
        + c.error_4f_cos * np.cos(4 * turn + 2 * c.phase_2f)
    )
    windup = motor / c.ratio - joint - error
    elastic = np.empty(len(windup))
    torque = np.empty(len(windup))
    for i, (u, t) in enumerate(zip(windup, turn, strict=True)):
        elastic[i], torque[i] = _mesh(c, damage_c, severity, u, t)
    stored = (
        c.motor_inertia * omega**2 / 2
        + c.link_inertia * joint_omega**2 / 2
        + elastic
        - c.gravity * np.cos(joint - c.gravity_angle)
    )
    sliding = omega / c.ratio - joint_omega
    hysteresis = np.zeros(len(sliding))
    step = 1.0 / EVERY_STEP_HZ
    for i in range(1, len(sliding)):
        d = sliding[i] * step / c.hysteresis_width
        hysteresis[i] = hysteresis[i - 1] + d - abs(d) * hysteresis[i - 1]
    lost = (
        _friction(c, omega, axis.true_temperature_c, torque) * omega
        + c.damping * sliding**2
        + c.hysteresis_torque * hysteresis * sliding
        + c.output_viscous * joint_omega**2
        + c.output_coulomb * joint_omega**2 / np.hypot(joint_omega, c.smoothing_velocity / c.ratio)
    )
    power = c.torque_constant * axis.iq_a * omega
    imbalance = np.cumsum(power - lost) * step - (stored - stored[0])
    turnover = np.sum(np.abs(power)) * step
    assert np.abs(imbalance).max() < 0.01 * turnover


def _mesh(c, damage, severity, windup, turn):
    if severity == 0.0:
        k, k3 = c.stiffness, c.stiffening
        return k * windup**2 / 2 + k3 * windup**4 / 4, k * windup + k3 * windup**3
    here = damaged_share(turn - damage["sector_angle"], damage["half_sector"], damage["half_zone"])[
        0
    ]
    there = damaged_share(
        turn - damage["sector_angle"] + np.pi, damage["half_sector"], damage["half_zone"]
    )[0]
    energy = torque = 0.0
    for own, other in ((here, there), (there, here)):
        weight = 0.5 - 0.5 * damage["stiffness_loss"] * own
        play = damage["half_play"] * (own + damage["play_shared"] * other)
        t, _, e = zone_torque(windup, play, damage["closing"], weight, c.stiffness, c.stiffening)
        energy += weight * e
        torque += t
    return energy, torque


def test_constant_speed_runs_recover_the_friction_curve(robot: Robot, program: Program) -> None:
    base = with_joint(robot, 3, link={"gravity_torque_nm": 0.0}, friction=QUIET_FRICTION)
    c = _constants(base, 4)
    n = c.ratio
    for speed in (5.0, 15.0, 40.0, 100.0):
        turns = 0.8 + 0.06 * speed
        recording = simulate(
            base,
            replace(program, waypoints_rad=(0.0, turns), speed_percent=speed),
            seed=4,
            axes=[3],
        )
        axis = _axis3(recording)
        first, second = recording.segments
        for segment in (first, second):
            inner = slice(
                segment.start + (segment.stop - segment.start) // 3,
                segment.stop - (segment.stop - segment.start) // 3,
            )
            velocity = axis.motor_velocity_rad_s[inner]
            load = np.full_like(
                velocity, c.output_coulomb + c.output_viscous * abs(velocity[0]) / n
            )
            expected = _friction(c, velocity, axis.true_temperature_c[inner], load)
            expected += (
                c.output_coulomb * smooth_sign(velocity.mean(), c.smoothing_velocity)
                + c.output_viscous * velocity / n
            ) / n
            measured = c.torque_constant * axis.iq_a[inner].mean()
            assert measured == pytest.approx(expected.mean(), rel=0.02)


@pytest.mark.parametrize("fault", [False, True])
def test_half_the_step_gives_the_same_current(robot: Robot, program: Program, fault: bool) -> None:
    """Quantised encoder readings are chaotic in their last bit, so they are left out."""
    smooth = with_joint(robot, 3, control=SMOOTH_ENCODER)
    faults = {3: robot.damage} if fault else None
    coarse, fine = (
        _axis3(
            simulate(smooth, program, seed=6, axes=[3], faults=faults, refinement=refinement)
        ).iq_a
        for refinement in (1, 2)
    )
    difference = np.sqrt(np.mean((coarse - fine) ** 2)) / np.sqrt(np.mean(fine**2))
    assert difference < 0.005


def test_nothing_gets_out_of_hand_on_any_axis(robot: Robot, program: Program) -> None:
    heavy = replace(program, axes=(1, 2, 3, 4, 5, 6), order="together", payload_kg=2.0)
    recording = simulate(robot, heavy, seed=9, faults=dict.fromkeys(range(1, 7), robot.damage))
    for number, axis in recording.axes.items():
        limit = robot.joints[number - 1].motor.current_limit_a
        assert np.abs(axis.iq_a).max() < limit
        assert np.abs(axis.joint_angle_rad - axis.position_rad).max() < 5e-3


def test_a_weak_drive_saturates(robot: Robot, program: Program) -> None:
    weak = with_joint(robot, 3, motor={"current_limit_a": 2.0})
    axis = _axis3(simulate(weak, program, seed=0, axes=[3]))
    assert np.abs(axis.iq_a).max() == pytest.approx(2.0, rel=1e-3)
