"""Noise level and signs of channels that cannot be trusted."""

import numpy as np
import pytest
from carriers import Move, record

from opamc_cli.signal.motion.noise import noise_level
from opamc_cli.signal.plausible.quality import (
    LIMITS,
    Size,
    bridged,
    clipped_share,
    held_for,
    spikes,
    strided_speed,
)
from opamc_cli.signal.transform.analytic import clarke


@pytest.mark.parametrize("noise", [0.01, 0.05, 0.1])
def test_noise_is_told_from_a_recording_that_moves_and_stands(noise):
    recording = record([Move(157), Move(314, -1)], noise=noise)
    # The Clarke vector takes sqrt(2/3) of each phase's noise.
    assert noise_level(clarke(*recording.phases)) == pytest.approx(noise * np.sqrt(2 / 3), rel=0.15)
    assert noise_level(recording.phases[0]) == pytest.approx(noise, rel=0.15)


def test_short_gaps_are_filled_by_straight_lines_and_no_others():
    x = np.arange(20.0)
    x[[0, 3, 5, 6, 7, 10, 11, 12, 13, 19]] = np.nan
    expected = np.arange(20.0)
    expected[[0, 10, 11, 12, 13, 19]] = np.nan
    assert bridged(x) == pytest.approx(expected, nan_ok=True)
    assert np.isnan(x[3])  # the recording's own samples stay as they are
    assert np.isnan(bridged(np.full(3, np.nan))).all()


@pytest.mark.parametrize("n", range(6))
def test_noise_of_next_to_nothing(n):
    assert noise_level(np.zeros(n)) == 0


def test_noise_passes_over_missing_samples():
    x = np.random.default_rng(0).standard_normal(10_000)
    x[::100] = np.nan
    assert noise_level(x) == pytest.approx(1, rel=0.15)


def test_a_clipped_carrier_is_told_from_a_quantised_one():
    carrier = np.sin(2 * np.pi * 0.0137 * np.arange(20_000))
    quantised = np.round(carrier * 2048) / 2048
    assert clipped_share(quantised) == 0
    assert clipped_share(carrier) == 0
    assert clipped_share(np.clip(quantised, -0.9, 0.9)) == pytest.approx(0.287, abs=0.01)
    assert clipped_share(np.clip(carrier, None, 0.9)) == pytest.approx(0.1435, abs=0.01)
    assert clipped_share(np.array([1.0])) == 0


def test_a_limit_is_reached_more_than_five_times_as_often_as_the_value_inside():
    inside = np.repeat([1.0, 2.0, 3.0, 4.0], 10)
    assert clipped_share(np.append(inside, np.full(50, 5.0))) == 0
    assert clipped_share(np.append(inside, np.full(51, 5.0))) == pytest.approx(51 / 91)


@pytest.mark.parametrize("rows", [3, 8, 50])
def test_a_channel_that_comes_less_often_than_its_rows_is_told(rows):
    own = np.random.default_rng(rows).normal(size=40).round(2)
    assert held_for(np.repeat(own, rows)) == rows
    # a bus is late by a row now and then, and a value comes twice
    late = np.random.default_rng(1).integers(0, 2, 48)
    twice = own.repeat(np.where(np.arange(40) % 5, 1, 2))
    assert held_for(np.repeat(twice, rows + late)) in (rows, rows + 1)


@pytest.mark.parametrize(
    "own",
    [
        np.random.default_rng(0).normal(size=900),
        np.repeat(np.random.default_rng(0).normal(size=450), 2),
        # one step of a coarse encoder after the other, at an even speed and at another
        np.floor(np.arange(900) / 8),
        np.floor(300 * np.sin(np.arange(900) / 150)),
        # a noise below a converter's step, a value that rests, missing values, next to nothing
        np.random.default_rng(0).normal(0.0, 0.3, 900).round(),
        np.r_[np.random.default_rng(0).normal(size=30), np.zeros(900)],
        np.where(np.arange(900) % 8, np.nan, np.arange(900)),
        *(np.zeros(0), np.zeros(1), np.zeros(900), np.full(9, np.nan)),
    ],
)
def test_a_channel_of_its_own_rate_is_not_held(own):
    assert held_for(own) is None


def test_numbers_that_no_joint_has_are_told_from_disturbances():
    current = np.sin(np.arange(1000.0))
    for values, impossible, words in (
        (current, False, None),
        (3000 * current, True, "mA taken for A"),
        (300 * current, False, "as few robots' joints are"),
        (np.where(np.arange(1000) == 7, 5e5, current), False, "1 samples beyond 1000 A"),
        (np.full(10, np.nan), False, None),
    ):
        size = Size(LIMITS["A"])
        for block in np.split(values, 2):
            size.add(block)
        assert size.is_impossible is impossible
        assert (size.doubt() is None) if words is None else (words in size.doubt())


@pytest.mark.parametrize(
    ("degrees", "refused"), [(180.0, False), (-40.0, False), (300.0, True), (-200.0, True)]
)
def test_a_temperature_of_no_joint_is_another_unit_or_no_sensor(degrees, refused):
    size = Size(LIMITS["temperature"])
    size.add(np.full(100, degrees))
    assert size.is_impossible is refused
    assert not refused or size.doubt().startswith("is below -60 or above 250 °C in 100% of its")


def test_a_handful_of_samples_beyond_any_joint_are_spikes():
    current = 5 * np.sin(np.arange(1000.0))
    spiked = current.copy()
    spiked[[7, 8, 500]] = 1e4, 2000, -3e5
    assert spikes(spiked, LIMITS["A"]).tolist() == [7, 8, 500]
    assert spikes(np.where(np.arange(1000) == 3, np.nan, spiked), LIMITS["A"]).size == 3
    assert not spikes(spiked, LIMITS["Nm"])[:-1].size
    # a log in mA, whose largest samples alone are beyond; one with more than a few; none at all
    for others in (np.where(current > 4.99, 1010.0, 200 * current), 1000 * current, current):
        assert not spikes(others, LIMITS["A"]).size
    assert not spikes(np.full(10, np.nan), LIMITS["A"]).size
    assert not spikes(np.zeros(0), LIMITS["A"]).size


def test_a_turn_passed_is_no_speed():
    path = 4 * np.arange(0, 10, 0.01)
    wrapped = (path + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(strided_speed(wrapped, 100.0), 4.0)
    assert strided_speed(np.zeros(3), 100.0).size == 0
