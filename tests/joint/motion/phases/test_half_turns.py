"""Half turns are counted where the current is too small to be followed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from opamc_cli.joint.motion.phases.half_turns import bridged, lost, without_slips
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle


def test_short_gaps_of_current_are_bridged_and_long_ones_are_lost():
    strong = np.ones(1000, dtype=bool)
    strong[200:210] = False
    strong[500:600] = False
    gone = lost(strong, rate_hz=1000.0)
    assert np.array_equal(np.flatnonzero(gone), np.arange(500, 600))
    assert lost(np.zeros(10, dtype=bool), 1000.0).all()


def test_an_angle_that_repeats_is_freed_of_slips():
    rate, period, cycles = 500.0, 1000, 5
    true = 200 * np.sin(2 * np.pi * np.arange(period * cycles) / period)
    strong = np.ones(true.size, dtype=bool)
    path = true + 3.0
    rng = np.random.default_rng(3)
    for cycle in range(cycles):
        for gap in (230, 740):
            start = cycle * period + gap
            strong[start : start + 40] = False
            # One slip in three, so that the median of the cycles has none.
            path[start + 20 :] += np.pi * rng.integers(-3, 4) * (cycle % 3 == 1)
    speed, blur = np.gradient(path) * rate, np.zeros((true.size, 2))
    angle = PhaseAngle(path, speed, speed, strong, strong, 5, np.ones(1), blur)
    freed = without_slips(angle, strong, period, rate)
    np.testing.assert_allclose((freed.angle_rad - true)[strong], 3.0, atol=1e-6)
    # What the angle has lost in a gap the speed has not run through (a half turn is 3.1).
    turned = cumulative_trapezoid(freed.velocity_rad_s, initial=0.0) / rate
    left = (turned - freed.angle_rad)[strong]
    np.testing.assert_allclose(left, left[0], atol=0.5)
    drifting = replace(angle, angle_rad=path + 0.1 * np.arange(true.size))
    same = without_slips(drifting, strong, period, rate)
    assert same.angle_rad is drifting.angle_rad
    # A cycle that does not close tells nothing of its gaps.
    np.testing.assert_allclose(same.guessed_s, [40 / rate] * 10)


@pytest.mark.parametrize("gap_s", [0.03, 0.09, 0.12])
def test_half_turns_are_counted_through_gaps_of_the_current(gap_s):
    rate = 2048.0
    time_s = np.arange(int(6 * rate)) / rate
    true = 150 * np.sin(1.7 * time_s) + 60 * np.sin(4.1 * time_s + 1)
    rng = np.random.default_rng(8)
    strong = np.ones(true.size, dtype=bool)
    for centre in np.arange(0.4, 5.8, 0.3):
        strong[np.abs(time_s - centre) < gap_s / 2] = False
    noise = np.where(strong, 0.02, 10.0) * rng.normal(size=true.size)
    measured = np.mod(true + noise, np.pi)
    none = np.zeros(true.size, dtype=bool)
    angle, _ = bridged(measured, strong, np.zeros(true.size), none, None, rate, 30.0)
    error = (angle - true)[strong]
    # The recording begins in full motion: the filter needs a moment to know the speed.
    settled = np.flatnonzero(strong) > 0.2 * rate
    assert np.ptp(error[settled]) < 0.5


def test_a_joint_that_rests_without_current_has_not_turned():
    rate = 2048.0
    time_s = np.arange(int(4 * rate)) / rate
    velocity = 400 * np.clip(np.sin(np.pi * time_s), -0.5, 0.5)
    velocity[np.abs(time_s - 2) < 0.4] = 0.0
    true = np.cumsum(velocity) / rate
    strong = np.abs(time_s - 2) > 0.3
    measured = np.mod(true + 0.05 * np.random.default_rng(9).normal(size=true.size), np.pi)
    none = np.zeros(true.size, dtype=bool)
    angle, _ = bridged(measured, strong, np.zeros(true.size), none, None, rate, 30.0)
    before, after = time_s < 1.7, time_s > 2.3
    assert abs(np.median((angle - true)[after]) - np.median((angle - true)[before])) < 0.1


def test_a_cycle_of_gaps_is_counted_as_most_cycles_say():
    rate, period, cycles = 500.0, 1000, 5
    true = 200 * np.sin(2 * np.pi * np.arange(period * cycles + 300) / period)
    strong = np.ones(true.size, dtype=bool)
    path = true.copy()
    for cycle in range(cycles):
        start = cycle * period + 230
        strong[start : start + 40] = False
        # The first cycle is wrong: only the others tell.
        path[start + 20 :] += np.pi * 3 * (cycle == 0)
    speed, blur = np.gradient(path) * rate, np.zeros((true.size, 2))
    angle = PhaseAngle(path, speed, speed, strong, strong, 5, np.ones(1), blur)
    freed = without_slips(angle, strong, period, rate)
    assert np.ptp((freed.angle_rad - true)[strong]) < 1e-6
    assert freed.guessed_s == ()


def slipping(rate=500.0, period=1000, cycles=5, slips=(450,)):
    """Return a path that repeats, and an angle that slips by hundreds of turns in some gaps."""
    rng = np.random.default_rng(5)
    true = 200 * np.sin(2 * np.pi * np.arange(period * cycles + 300) / period)
    strong = np.ones(true.size, dtype=bool)
    path = true.copy()
    for cycle in range(cycles):
        for gap in (100, 450, 800):
            start = cycle * period + gap
            strong[start : start + 100] = False
            path[start + 50 :] += np.pi * rng.integers(20, 200) * (gap in slips)
    speed, blur = np.gradient(path) * rate, np.zeros((true.size, 2))
    angle = PhaseAngle(path, speed, speed, strong, strong, 5, np.ones(1), blur)
    return true, strong, angle, without_slips(angle, strong, period, rate)


def test_where_no_cycles_agree_what_is_left_of_a_cycle_was_turned():
    true, strong, _, freed = slipping()
    assert np.ptp((freed.angle_rad - true)[strong]) < 1e-6
    assert freed.guessed_s == ()


def test_where_no_cycles_agree_in_two_gaps_these_are_guesses():
    *_, freed = slipping(slips=(100, 450))
    np.testing.assert_allclose(freed.guessed_s, [0.2, 0.2] * 5, atol=0.01)


def test_without_a_cycle_long_gaps_are_guesses_but_rests_are_none():
    _, strong, angle, _ = slipping(slips=())
    lengths = without_slips(angle, strong, None, 500.0).guessed_s
    np.testing.assert_allclose(lengths, [100 / 500.0] * 15)
    resting = np.where(np.arange(strong.size) % 1000 < 400, 0.0, angle.velocity_rad_s)
    moving = without_slips(replace(angle, velocity_rad_s=resting), strong, None, 500.0)
    assert len(moving.guessed_s) == 10
    dark = replace(angle, strong=np.zeros(strong.size, dtype=bool))
    assert without_slips(dark, strong, None, 500.0).guessed_s == ()


def test_a_spark_of_current_within_a_gap_stays_on_the_axis():
    rate, period = 500.0, 1000
    true, strong, angle, _ = slipping()
    spark = np.zeros(true.size, dtype=bool)
    spark[[1472, 2530]] = True
    with_spark = replace(angle, strong=strong | spark)
    freed = without_slips(with_spark, strong, period, rate).angle_rad
    turns = (freed - angle.angle_rad)[spark] / np.pi
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)


@pytest.mark.parametrize("slip", [0, 3])
def test_the_way_to_the_first_cycle_is_no_cycle(slip):
    """It was held against the cycle: 441 half turns were made up where none was missed."""
    rate, period, cycles = 500.0, 1000, 6
    place = np.arange(period * cycles) / period
    true = 200 * np.sin(2 * np.pi * place)
    true[:300] = true[300] - 250 * (1 + np.cos(np.pi * np.arange(300) / 300))
    strong = np.ones(true.size, dtype=bool)
    for start in np.flatnonzero(np.isin(np.arange(true.size) % period, (140, 460, 730))):
        strong[start : start + 30] = False
    path = true.copy()
    path[4745:] += slip * np.pi
    speed, blur = np.gradient(path) * rate, np.zeros((true.size, 2))
    angle = PhaseAngle(path, speed, speed, strong, strong, 5, np.ones(1), blur)
    freed = without_slips(angle, strong, period, rate)
    np.testing.assert_allclose((freed.angle_rad - true)[strong], 0.0, atol=1e-6)
