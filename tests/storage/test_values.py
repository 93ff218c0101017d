"""What values say of a channel: units and rates of motions that are known."""

import numpy as np
import pytest

from opamc_cli.storage.ingest.guess.values import are_phases, rate_from_speed, time_unit, wraps
from opamc_cli.storage.ingest.guess.write import _fits

T = np.arange(2000) / 250.0
ANGLE = 1.3 * np.sin(1.7 * T) + 0.4 * np.sin(4.1 * T)
SPEED = 1.3 * 1.7 * np.cos(1.7 * T) + 0.4 * 4.1 * np.cos(4.1 * T)


@pytest.mark.parametrize("scale", [1.0, 180 / np.pi])
def test_the_rate_is_where_steps_agree_with_the_speed(scale):
    gap = np.where(np.arange(T.size) % 97 == 0, np.nan, 1.0)
    angles, speeds = (
        {1: scale * ANGLE * gap, 2: -scale * ANGLE},
        {1: scale * SPEED, 2: -scale * SPEED},
    )
    assert rate_from_speed(angles, speeds) == 250.0
    # one axis alone, an axis that only one of the two has, and none
    assert rate_from_speed({1: angles[1]}, speeds) == 250.0
    assert rate_from_speed({3: angles[1]}, speeds) is None
    # a speed of the other sign is another motion
    assert rate_from_speed({2: angles[1]}, {2: speeds[2]}) is None


def test_a_turn_of_the_encoder_is_no_step_and_no_turn_is_missed():
    turns = np.cumsum(SPEED + 5.0) / 250.0
    wrapped = np.mod(turns, 2 * np.pi)
    assert rate_from_speed({1: wrapped}, {1: SPEED + 5.0}) == 250.0
    assert wraps({1: wrapped}, "rad")
    assert wraps({1: np.degrees(wrapped)}, "deg")
    assert not wraps({1: turns}, "rad")
    assert not wraps({1: np.degrees(wrapped)}, "rad")


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_stamps_are_told_by_their_steps(factor, unit):
    assert time_unit(T * factor).unit == unit
    assert time_unit(np.arange(50.0)).unit == "samples"
    assert time_unit(ANGLE) is None
    assert time_unit(T[:2]) is None


def test_phases_add_up_to_little():
    angle = np.cumsum(SPEED)
    phases = [np.cos(angle - k * 2 * np.pi / 3) for k in range(3)]
    assert are_phases(*phases)
    assert not are_phases(phases[0], phases[1], np.roll(phases[0], 500))
    assert not are_phases(phases[0], phases[1], 0.3 * phases[2])
    assert not are_phases(*np.zeros((3, 10)))


@pytest.mark.parametrize(
    ("unit", "kind", "fits"),
    [
        *(("A", "a", True), ("mA", "current", True), ("rad", "a", False), ("V", "current", False)),
        # a torque stands for a drive's current, never for a phase's
        *(("Nm", "current", True), ("Nm", "b", False), ("deg", "position", True)),
    ],
)
def test_a_declared_unit_is_believed_where_it_is_one_of_the_quantity(unit, kind, fits):
    assert _fits(unit, kind) is fits
