"""Lines of i_q over the motor angle: where the gear ratio says, healthy and faulty."""

from dataclasses import replace

import numpy as np
import pytest
from robot_variations import NO_ERROR, with_joint

from opamc_cli.testbed.parameters import Robot
from opamc_cli.testbed.program import Program
from opamc_cli.testbed.robot import simulate

TURNS = 200
"""Motor turns of the spectrum: lines at 2 and 2 (N + 1) / N are 4 bins apart."""


def _order_spectrum(
    robot: Robot, program: Program, fault: bool, distance_rad: float = 14.0
) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude of i_q by order per motor turn, from one long move at half speed."""
    long_move = replace(program, waypoints_rad=(0.0, distance_rad), speed_percent=50.0)
    faults = {3: robot.damage} if fault else None
    recording = simulate(robot, long_move, seed=3, axes=[3], faults=faults)
    axis = recording.axes[3]
    segment = recording.segments[0]
    inside = slice(segment.start, segment.stop)
    angle, current = axis.motor_angle_rad[inside], axis.iq_a[inside]
    middle = (angle[0] + angle[-1]) / 2
    start = middle - np.pi * TURNS
    grid = start + 2 * np.pi * TURNS * np.arange(TURNS * 64) / (TURNS * 64)
    assert grid[0] > angle[0] + 20
    assert grid[-1] < angle[-1] - 20
    series = np.interp(grid, angle, current)
    slow = np.polynomial.Polynomial.fit(grid, series, 8)(grid)  # gravity over the joint angle
    window = np.hanning(len(grid))
    spectrum = np.abs(np.fft.rfft((series - slow) * window)) / window.sum() * 2
    return np.arange(len(spectrum)) / TURNS, spectrum


def _line(orders: np.ndarray, spectrum: np.ndarray, order: float) -> float:
    return float(spectrum[np.abs(orders - order) <= 0.0051].max())


def _floor(orders: np.ndarray, spectrum: np.ndarray, order: float) -> float:
    away = np.abs(orders - order)
    return float(np.median(spectrum[(away > 0.1) & (away < 0.4)]))


@pytest.fixture(scope="module")
def flat(testbed) -> Robot:
    """Without gravity, whose change of load along the move would blur the lines."""
    return with_joint(testbed.robot, 3, link={"gravity_torque_nm": 0.0})


def test_a_healthy_gear_shows_its_kinematic_error_in_both_frames(
    flat: Robot, program: Program
) -> None:
    orders, spectrum = _order_spectrum(flat, program, fault=False)
    n = flat.joints[2].gear.ratio
    for order in (2.0, 2 * (n + 1) / n, 4.0, 4 * (n + 1) / n):
        assert _line(orders, spectrum, order) > 4 * _floor(orders, spectrum, order)
    assert _line(orders, spectrum, 2.5) < 4 * _floor(orders, spectrum, 2.5)


def test_a_damaged_gear_adds_the_flexspline_passage_and_no_other_frame(
    flat: Robot, program: Program
) -> None:
    ideal = with_joint(flat, 3, gear=NO_ERROR)
    n = ideal.joints[2].gear.ratio
    passage = 2 * (n + 1) / n
    _, healthy = _order_spectrum(ideal, program, fault=False)
    orders, faulty = _order_spectrum(ideal, program, fault=True)
    assert _line(orders, faulty, passage) > 20 * _line(orders, healthy, passage)
    assert _line(orders, faulty, passage) > 5 * _line(orders, faulty, 2.0)
    strongest = orders[1:][np.argmax(faulty[1:])]
    assert strongest == pytest.approx(passage, abs=0.006)


def test_the_passage_follows_the_ratio(flat: Robot, program: Program) -> None:
    ideal = with_joint(flat, 3, gear={**NO_ERROR, "ratio": 80.0})
    orders, faulty = _order_spectrum(ideal, program, fault=True, distance_rad=18.0)
    assert orders[1:][np.argmax(faulty[1:])] == pytest.approx(2 * 81 / 80, abs=0.006)


def test_payload_weakens_the_passage(testbed, program: Program) -> None:
    """Wind-up under load closes the play; nothing tells the fault about the payload."""
    robot = with_joint(testbed.robot, 3, gear=NO_ERROR)

    def passage(payload_kg: float, fault: bool) -> float:
        """Mean amplitude of i_q at two per relative turn, over the four motions."""
        recording = simulate(
            robot,
            replace(program, payload_kg=payload_kg),
            seed=8,
            axes=[3],
            faults={3: robot.damage} if fault else None,
        )
        axis = recording.axes[3]
        sizes = []
        for segment in recording.segments:
            inside = slice(segment.start + 300, segment.stop - 300)
            turn = axis.motor_angle_rad[inside] + axis.joint_angle_rad[inside]
            current = axis.iq_a[inside]
            slow = np.polynomial.Polynomial.fit(turn, current, 5)(turn)
            sizes.append(2 * abs(np.mean((current - slow) * np.exp(-2j * turn))))
        return float(np.mean(sizes))

    added = [passage(kg, True) - passage(kg, False) for kg in (0.0, 1.0, 2.0)]
    assert added[0] > added[1] > added[2]
    assert added[2] < 0.8 * added[0]
