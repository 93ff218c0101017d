"""Every name of the list can be switched on, and does what its name says."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.testbed.effects import KINDS, complete, delayed
from opamc_cli.testbed.parameters import Effect, Robot
from opamc_cli.testbed.program import Program
from opamc_cli.testbed.robot import AxisRecording, simulate

SIZES = {
    "inertia": 0.05,
    "viscous": 0.2,
    "quadratic_friction": 0.1,
    "load_friction": 0.02,
    "thermal_viscous": 0.05,
    "payload_change": 1.0,
    "elasticity": 0.5,
    "time_delay": 0.02,
    "sensor_gain": 0.1,
}
SENSOR_ONLY = {"time_delay", "sensor_offset", "sensor_gain", "mains_hum", "dead_time"}


def _record(robot: Robot, program: Program, *effects: Effect) -> AxisRecording:
    return simulate(robot, program, seed=11, axes=[3], effects=effects).axes[3]


@pytest.fixture(scope="module")
def plain(testbed) -> AxisRecording:
    return _record(testbed.robot, replace(testbed.program, axes=(3,), cycles=1))


def test_the_list_is_the_design_s() -> None:
    design = """
    inertia gravity offset coulomb viscous stribeck quadratic_friction sublinear_friction
    asymmetric_friction load_friction thermal_viscous warmup spring payload_change position_drag
    hysteresis elasticity ripple time_delay sensor_offset sensor_gain dead_time mains_hum
    """
    assert set(KINDS) == set(design.split())


@pytest.mark.parametrize("name", sorted(KINDS))
def test_each_effect_changes_both_styles_of_current(
    robot: Robot, program: Program, plain: AxisRecording, name: str
) -> None:
    changed = _record(robot, program, Effect(name, 3, SIZES.get(name, 0.3)))
    for before, after in (
        (plain.phases_a, changed.phases_a),
        (plain.reported_a, changed.reported_a),
    ):
        assert np.abs(after.astype(float) - before).max() > 0.03
    truly_same = np.array_equal(plain.iq_a, changed.iq_a)
    assert truly_same == (name in SENSOR_ONLY)


@pytest.mark.parametrize("name", sorted(KINDS))
def test_an_effect_stays_on_its_axis(
    robot: Robot, program: Program, plain: AxisRecording, name: str
) -> None:
    other = _record(robot, program, Effect(name, 2, SIZES.get(name, 0.3)))
    assert np.array_equal(plain.phases_a, other.phases_a)


def _change(plain: AxisRecording, changed: AxisRecording) -> np.ndarray:
    return changed.iq_a - plain.iq_a


def test_friction_effects_have_their_curve(
    robot: Robot, program: Program, plain: AxisRecording
) -> None:
    """What the current gains is the regressor times the magnitude, where the arm is settled."""
    velocity = plain.joint_velocity_rad_s
    top = np.abs(velocity).max()
    steady = np.abs(velocity) > 0.98 * top
    cases = {
        "coulomb": 0.3 * np.sign(velocity),
        "viscous": 0.2 * velocity,
        "quadratic_friction": 0.1 * velocity * np.abs(velocity),
        "asymmetric_friction": 0.3 * np.ones_like(velocity),
        "sublinear_friction": 0.3 * np.sign(velocity) * np.sqrt(np.abs(velocity)),
    }
    for name, expected in cases.items():
        change = _change(plain, _record(robot, program, Effect(name, 3, SIZES.get(name, 0.3))))
        for sign in (-1, 1):
            part = steady & (np.sign(velocity) == sign)
            assert change[part].mean() == pytest.approx(expected[part].mean(), rel=0.08), name


def test_a_constant_offset_and_a_spring_act_at_rest(
    robot: Robot, program: Program, plain: AxisRecording
) -> None:
    rest = slice(200, 1500)
    offset = _change(plain, _record(robot, program, Effect("offset", 3, 0.3)))
    assert offset[rest].mean() == pytest.approx(0.3, rel=0.02)
    spring = Effect("spring", 3, 0.4, {"angle_rad": -1.0})
    change = _change(plain, _record(robot, program, spring))
    assert change[rest].mean() == pytest.approx(0.4 * (program.waypoints_rad[0] + 1.0), rel=0.02)


def test_ripple_is_a_line_at_its_order(robot: Robot, program: Program) -> None:
    """At a speed at which the velocity loop still answers: 7 * 6 turns per second."""
    slow = replace(program, speed_percent=10.0, waypoints_rad=(0.0, 1.0))
    recordings = [
        _record(robot, slow, *effects)
        for effects in ((), (Effect("ripple", 3, 0.3, {"order": 7.0}),))
    ]

    def line(recording: AxisRecording, order: float) -> float:
        velocity = recording.motor_velocity_rad_s
        cruise = velocity > 0.9 * velocity.max()
        turn = np.exp(-1j * order * recording.motor_angle_rad[cruise])
        current = recording.iq_a[cruise]
        return float(2 * abs(np.mean((current - current.mean()) * turn)))

    plain, rippled = recordings
    assert line(rippled, 7.0) > 0.15
    for order in (5.0, 6.0, 8.0, 9.0):
        assert line(rippled, order) < line(plain, order) + 0.02


def test_payload_changes_when_it_is_told_to(
    robot: Robot, program: Program, plain: AxisRecording
) -> None:
    changed = _record(robot, program, Effect("payload_change", 3, 1.0, {"start_s": 3.0}))
    at = round(3.0 * 2048)
    assert np.array_equal(changed.iq_a[: at - 2], plain.iq_a[: at - 2])
    assert np.abs(changed.iq_a[at + 200 :] - plain.iq_a[at + 200 :]).max() > 0.2


def test_hum_and_delay_of_the_reported_current(
    robot: Robot, program: Program, plain: AxisRecording
) -> None:
    hum = _record(robot, program, Effect("mains_hum", 3, 0.2, {"frequency_hz": 60.0}))
    extra = hum.reported_a.astype(float) - plain.reported_a
    n = len(extra) // 2048 * 2048
    spectrum = np.abs(np.fft.rfft(extra[:n])) / n * 2
    assert np.argmax(spectrum) == 60 * n // 2048
    assert spectrum.max() == pytest.approx(0.2, rel=0.01)
    late = _record(robot, program, Effect("time_delay", 3, 10 / 2048)).reported_a
    assert np.abs(late[10:] - plain.reported_a[:-10]).max() < 0.1


def test_a_delay_need_not_be_whole() -> None:
    ramp = np.arange(10.0)
    assert np.allclose(delayed(ramp, 2.5)[3:], ramp[3:] - 2.5)
    assert delayed(ramp, 2.5)[0] == 0.0


def test_unknown_names_and_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="unknown"):
        complete(Effect("gremlin", 1, 1.0))
    with pytest.raises(ValueError, match="no parameter 'ordr'"):
        complete(Effect("ripple", 1, 1.0, {"ordr": 2.0}))
