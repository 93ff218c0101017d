"""Recordings: same seed, same bytes; sensors; the truth beside them."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.testbed.parameters import Damage, Robot
from opamc_cli.testbed.program import Program
from opamc_cli.testbed.robot import simulate, top_velocity_rad_s
from opamc_cli.testbed.sensors import phase_currents, quantise
from opamc_cli.testbed.session import draw_session


def test_a_seed_and_session_give_the_same_recording(robot: Robot, program: Program) -> None:
    first = simulate(robot, program, seed=4, session=2, axes=[3])
    again = simulate(robot, program, seed=4, session=2, axes=[3])
    other = simulate(robot, program, seed=4, session=3, axes=[3])
    assert np.array_equal(first.axes[3].phases_a, again.axes[3].phases_a)
    n = min(len(first.axes[3].iq_a), len(other.axes[3].iq_a))
    assert not np.array_equal(first.axes[3].phases_a[:n], other.axes[3].phases_a[:n])


def test_an_axis_does_not_depend_on_which_others_are_recorded(
    robot: Robot, program: Program
) -> None:
    alone = simulate(robot, program, seed=4, axes=[3])
    among = simulate(robot, program, seed=4, axes=[2, 3, 5])
    assert np.array_equal(alone.axes[3].phases_a, among.axes[3].phases_a)


def test_the_electrical_frequency_is_the_same_on_every_axis(robot: Robot, program: Program) -> None:
    """Thesis, Table 5-1: 314 Hz at 100 %, whatever the axis and the payload (Table 5-5)."""
    for speed, payload_kg in ((20.0, 0.0), (100.0, 0.0), (100.0, 2.0)):
        moves = replace(
            program,
            axes=(1, 3, 6),
            order="together",
            speed_percent=speed,
            payload_kg=payload_kg,
        )
        recording = simulate(robot, moves, seed=0, axes=[1, 3, 6])
        for number, axis in recording.axes.items():
            pairs = robot.joints[number - 1].motor.pole_pairs
            electrical = np.abs(axis.motor_velocity_rad_s) * pairs / (2 * np.pi)
            smooth = np.convolve(electrical, np.ones(41) / 41, "same")
            assert smooth.max() == pytest.approx(3.14 * speed, rel=0.02)


def test_segments_are_where_the_joint_moves(robot: Robot, program: Program) -> None:
    recording = simulate(robot, program, seed=1, axes=[3])
    axis = recording.axes[3]
    inside = np.zeros(len(axis.iq_a), dtype=bool)
    for segment in recording.segments:
        inside[segment.start : segment.stop] = True
    speed = np.abs(axis.joint_velocity_rad_s)
    assert speed[~inside].max() < 0.06 * speed.max()  # what swings out after a stop
    assert [s.motion for s in recording.segments] == [0, 1, 2, 3]


def test_phase_currents_carry_i_q_and_the_electrical_angle(robot: Robot, program: Program) -> None:
    ideal = replace(
        robot,
        sensor=replace(robot.sensor, noise_a=0.0, offset_a=0.0, gain=0.0, filter_share=0.49),
        spread=replace(robot.spread, sensor_gain=0.0, sensor_offset_a=0.0),
    )
    slow = replace(program, speed_percent=10.0, waypoints_rad=(0.0, 0.2))
    recording = simulate(ideal, slow, seed=1, axes=[3])
    axis = recording.axes[3]
    a, b, c = axis.phases_a.astype(float).T
    vector = 2 / 3 * (a + b * np.exp(2j * np.pi / 3) + c * np.exp(-2j * np.pi / 3))
    pairs = robot.joints[2].motor.pole_pairs
    dq = vector * np.exp(-1j * (pairs * axis.motor_angle_rad + np.pi / 2))
    assert np.abs(a + b + c).max() < 0.01
    # the filter's delay turns the vector by a few hundredths of a radian
    size = np.sqrt(np.mean(axis.iq_a**2))
    assert np.sqrt(np.mean((dq.real - axis.iq_a) ** 2)) < 0.01 * size
    assert np.sqrt(np.mean(dq.imag**2)) < 0.05 * size


def test_the_filter_keeps_out_what_the_sampling_rate_cannot_hold(
    robot: Robot, program: Program
) -> None:
    """Sampled at 500 Hz, a carrier of 314 Hz must be weakened, not folded down."""
    fast = simulate(robot, program, seed=1, axes=[3]).axes[3]
    slow = simulate(robot, program, seed=1, axes=[3], sampling_rate_hz=500.0).axes[3]
    cruise = np.abs(slow.motor_velocity_rad_s) > 0.95 * np.abs(slow.motor_velocity_rad_s).max()
    brisk = np.abs(fast.motor_velocity_rad_s) > 0.95 * np.abs(fast.motor_velocity_rad_s).max()
    ratio = slow.phases_a[cruise].std() / fast.phases_a[brisk].std()
    assert ratio < 0.4


def test_quantisation_and_clipping() -> None:
    values = np.array([-9.0, -0.1, 0.0, 0.12, 9.0])
    assert quantise(values, 1.0, 4).tolist() == [-1.0, -0.125, 0.0, 0.125, 0.875]
    phases = phase_currents(
        np.array([1.0]),
        np.array([0.0]),
        np.array([1.0, 2.0, 1.0]),
        np.array([0.0, 0.0, 0.5]),
        np.zeros((1, 3)),
        10.0,
        24,
    )
    assert np.allclose(phases, [[1.0, -1.0, 0.0]], atol=1e-5)


def test_sessions_differ_a_little(robot: Robot) -> None:
    sessions = [draw_session(robot, 3, 7, k) for k in range(200)]
    friction = np.array([s.friction for s in sessions])
    temperature = np.array([s.temperature_c for s in sessions])
    assert friction.std() == pytest.approx(robot.spread.friction, rel=0.2)
    assert temperature.std() == pytest.approx(robot.spread.temperature_c, rel=0.2)
    assert len({s.mount_rad[0] for s in sessions}) == 200


def test_the_motor_warms_up_while_it_works(robot: Robot, program: Program) -> None:
    axis = simulate(robot, replace(program, cycles=8), seed=0, axes=[3]).axes[3]
    session = draw_session(robot, 3, 0, 0)
    heated = axis.true_temperature_c - session.temperature_c
    ambient = robot.joints[2].thermal.ambient_c
    assert heated[-1] > min(0.0, ambient - session.temperature_c)
    assert np.abs(np.diff(axis.true_temperature_c)).max() < 1e-3


def test_severity_zero_is_healthy(robot: Robot, program: Program) -> None:
    healthy = simulate(robot, program, seed=2, axes=[3])
    ground = simulate(robot, program, seed=2, axes=[3], faults={3: Damage(severity=0.0)})
    assert np.array_equal(healthy.axes[3].phases_a, ground.axes[3].phases_a)


def test_more_severity_means_more_torque_ripple(robot: Robot, program: Program) -> None:
    healthy = simulate(robot, program, seed=2, axes=[3]).axes[3].iq_a
    growth = [
        np.std(
            simulate(
                robot,
                program,
                seed=2,
                axes=[3],
                faults={3: replace(robot.damage, severity=severity)},
            )
            .axes[3]
            .iq_a
            - healthy
        )
        for severity in (0.3, 0.6, 1.0)
    ]
    assert 0 < growth[0] < growth[1] < growth[2]


def test_an_axis_that_does_not_exist_is_refused(robot: Robot, program: Program) -> None:
    with pytest.raises(ValueError, match="axis 7 does not exist"):
        simulate(robot, replace(program, axes=(7,)), seed=0)
    assert top_velocity_rad_s(robot, 1) == pytest.approx(2 * np.pi * 314 / 5 / 100)
