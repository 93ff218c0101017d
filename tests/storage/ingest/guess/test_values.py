"""What values say of a channel: units and rates of motions that are known."""

import numpy as np
import pytest

from opamc_cli.storage.ingest.guess.values import (
    angle_units,
    are_phases,
    current_unit,
    rate_from_speed,
    time_unit,
    wraps,
)
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
    # three quarters of a turn are one already, a twentieth more than one is none any more
    for step, turn in ((0.74, False), (0.76, True), (1.04, True), (1.06, False)):
        assert wraps({1: np.array([0.0, 0.0, step * 360.0])}, "deg") is turn
    assert not wraps({1: np.degrees(wrapped)}, "rad")
    assert wraps({1: wrapped / (2 * np.pi)}, "rev")
    assert not wraps({1: np.array([0.0, 1.9, 8.2, 2.0])}, "rev")


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


@pytest.mark.parametrize(
    ("position", "speed", "units"),
    [
        (1.0, 1.0, ("rad", "rad/s")),
        (180 / np.pi, 180 / np.pi, ("deg", "deg/s")),
        (180 / np.pi, 1.0, ("deg", "rad/s")),
        (1.0, 180 / np.pi, ("rad", "deg/s")),
        (180 / np.pi, 30 / np.pi, ("deg", "rpm")),
        (1.0, 30 / np.pi, ("rad", "rpm")),
        (180 / np.pi, 0.5 / np.pi, ("deg", "rev/s")),
        (1.0, 0.5 / np.pi, ("rad", "rev/s")),
        (1.0, 1.02, ("rad", "rad/s")),
    ],
)
def test_units_of_an_angle_are_those_whose_steps_agree_with_the_speed(position, speed, units):
    found = angle_units({1: position * ANGLE}, {1: speed * SPEED}, 250.0)
    assert (found[0].unit, found[1].unit) == units
    assert found[0].why.endswith("; its steps agree with the speed")


def test_degrees_by_rpm_are_no_radians_by_revolutions_though_both_are_few():
    few = 0.05 * ANGLE
    found = angle_units({1: 180 / np.pi * few}, {1: 0.05 * 30 / np.pi * SPEED}, 250.0)
    assert (found[0].unit, found[1].unit) == ("deg", "rpm")
    found = angle_units({1: few}, {1: 0.05 * 0.5 / np.pi * SPEED}, 250.0)
    assert (found[0].unit, found[1].unit) == ("rad", "rev/s")


def test_units_by_the_range_alone():
    for largest, angle, speed in ((12.5, "rad", "rad/s"), (12.6, "deg", "deg/s")):
        found = angle_units({1: ANGLE, 2: np.array([-largest])}, {3: np.array([largest])}, None)
        assert (found[0].unit, found[1].unit) == (angle, speed)
        assert found[0].why == f"largest {largest:.3g}, by the range alone"
    found = angle_units({1: ANGLE}, {1: 1.2 * SPEED}, 250.0)
    assert found[0].why == "largest 1.69, by the range alone (its steps are 0.833 of the speed)"
    assert [guess.why for guess in angle_units({}, {}, 250.0)] == [
        "largest 0, by the range alone",
        "largest 0, by the range alone",
    ]


@pytest.mark.parametrize(("angle", "unit"), [(1.0, "rad"), (180 / np.pi, "deg")])
def test_a_coarse_speed_has_the_unit_of_its_position_whatever_its_range(angle, unit):
    # 8 % of noise in the mean square make more of the speed than the steps are
    noise = np.random.default_rng(0).normal(0.0, 0.3 * SPEED.std(), SPEED.size)
    for size in (0.05, 5.0):
        found = angle_units({1: angle * ANGLE}, {1: angle * (SPEED + noise)}, 250.0)
        assert (found[0].unit, found[1].unit) == (unit, f"{unit}/s")
        assert found[1].why.endswith("as the position")
        slow = {1: size * angle * ANGLE}, {1: size * angle * (SPEED + noise)}
        position, speed = angle_units(*slow, 250.0)
        assert speed.unit == f"{position.unit}/s"


def test_currents_of_more_than_sixty_are_in_milliampere():
    assert (current_unit(60.0).unit, current_unit(60.1).unit) == ("A", "mA")


def test_rates_are_those_of_loggers():
    for rate, known in ((4.9, None), (5.0, 5.0), (20_000.0, 20_000.0), (21_000.0, None)):
        assert rate_from_speed({1: np.arange(50.0) / rate}, {1: np.ones(50)}) == known
    for step, unit in ((0.19, "s"), (0.21e3, "us"), (5.1e-5, "s")):
        assert time_unit(np.arange(50) * step + 0.5).unit == unit, step
    # five samples a second, or five a millisecond: nobody logs 10 ms of an arm
    short, long = (time_unit(np.arange(n) * 0.21 + 0.5) for n in (50, 50_000))
    assert (short.unit, short.why) == ("s", "steps of 0.21, or ms if all of it lasts 0.01 s")
    assert (long.unit, long.why) == ("ms", "steps of 0.21, or s if it is logged at 4.8 Hz")
    # a servo's current at 20 kHz, whose steps are 4.99999e-05: "t fits no unit of time"
    for step in (50e-6 * (1 - 1e-9), 1e-5, 1.1e-6):
        assert time_unit(np.arange(50) * step + 0.5).unit == "s", step
    assert time_unit(np.arange(50) * 1e-9 + 0.5) is None


@pytest.mark.parametrize(
    ("start", "per_s", "unit"),
    [
        *((1.7e9, 1, "s"), (1.7e12, 1e3, "ms"), (1.7e18, 1e9, "ns"), (2.9e7, 1 / 60, "min")),
        *((1.34e17, 1e7, "filetime"), (6.39e17, 1e7, "ticks"), (46_000.0, 1 / 86_400, "days")),
    ],
)
def test_dates_tell_the_unit_of_stamps_whatever_their_steps(start, per_s, unit):
    for rate in (250.0, 1.0):
        assert time_unit(start + np.arange(50) / rate * per_s).unit == unit
    assert time_unit(46_000 + T).unit == "s"


def test_a_speed_that_is_ten_times_too_large_is_of_a_wrong_clock_and_no_rpm():
    # of counts of 0.1 ms that are taken for milliseconds
    for scale in (1.0, 180 / np.pi):
        found = angle_units({1: scale * ANGLE}, {1: scale * SPEED}, 25.0)
        assert found[0].why.endswith(
            "(its steps are 0.1 of the speed: the speed may be the motor's or the unit of the time "
            "wrong)"
        )


def test_a_joint_that_rests_for_most_of_a_log_moves_all_the_same():
    """Its strokes were taken for wraps, and its speed for "the motor's"."""
    moves = np.arange(T.size) < 600
    angle = 4096 * np.where(moves, ANGLE, ANGLE[600])
    found = angle_units({1: angle}, {1: 4096 * np.where(moves, SPEED, 0.0)}, 250.0)
    assert "agree with the speed" in found[0].why


@pytest.mark.parametrize(("times", "side"), [(1 / 121, "speed"), (5.05, "position"), (1.2, None)])
def test_a_speed_that_is_a_whole_gear_ratio_off_may_be_of_the_motor(times, side):
    why = angle_units({1: ANGLE}, {1: SPEED / times}, 250.0)[0].why
    blame = f": the {side} may be the motor's" if side else ""
    assert why.endswith(f"(its steps are {times:.3g} of the speed{blame})")


def test_coarse_logs_agree_with_their_speed():
    times = np.arange(300) / 10
    found = angle_units(
        {1: np.sin(2 * np.pi * times)}, {1: 2 * np.pi * np.cos(2 * np.pi * times)}, 10.0
    )
    assert (found[0].unit, found[1].unit) == ("rad", "rad/s")
    assert "agree" in found[0].why


def test_stamps_may_stand_still_for_a_tenth_of_their_steps():
    stamps = np.arange(101.0) / 100
    stamps[10:20] = stamps[9]
    assert time_unit(stamps).unit == "s"
    stamps[20] = stamps[9]
    assert time_unit(stamps) is None
    stamps[10:20] = np.nan
    assert time_unit(np.r_[stamps[:10], stamps[21:]]).unit == "s"
