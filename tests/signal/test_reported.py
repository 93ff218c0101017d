"""Motions told from velocity or position."""

import numpy as np
import pytest

from opamc_cli.signal.motion.reported import (
    find_joint_motions,
    fluctuation_frequency,
    motor_frequency,
    velocity_from_position,
)

FS_HZ = 1000.0


def profile(signs=(1, -1, 1), speed=0.5, ramp=200, cruise=400, rest=300):
    up = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
    one = np.concatenate([up, np.ones(cruise), up[::-1]]) * speed
    pieces, truth, n = [np.zeros(rest)], [], rest
    for sign in signs:
        truth.append((n, n + one.size, sign))
        pieces += [sign * one, np.zeros(rest)]
        n += one.size + rest
    return np.concatenate(pieces), truth


def found(velocity):
    return find_joint_motions(velocity, FS_HZ, 0.1, 0.06)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_finds_moves_with_direction_and_speed(noise):
    velocity, truth = profile()
    velocity = velocity + noise * np.random.default_rng(0).standard_normal(velocity.size)
    motions = found(velocity)
    assert [m.direction for m in motions] == [s for _, _, s in truth]
    for motion, (start, stop, _) in zip(motions, truth, strict=True):
        assert abs(motion.start - start) < 40
        assert abs(motion.stop - stop) < 40
        assert motion.speed_rad_s == pytest.approx(0.5, rel=0.02)


def test_finds_the_same_moves_in_a_quantised_wrapped_position():
    velocity, truth = profile(speed=3.0)
    angle = np.cumsum(velocity) / FS_HZ
    position = (np.round(angle / 1e-4) * 1e-4 + np.pi) % (2 * np.pi) - np.pi
    derived = velocity_from_position(position, FS_HZ)
    assert np.abs(derived - velocity).max() < 0.06
    assert [m.direction for m in found(derived)] == [s for _, _, s in truth]


def test_a_reversal_without_rest_is_two_motions():
    velocity, _ = profile(signs=(1, -1), rest=1)
    assert [m.direction for m in found(velocity)] == [1, -1]


def test_a_controllers_quiver_is_no_motion():
    assert found(1e-3 * np.random.default_rng(1).standard_normal(5000)) == []
    assert found(np.zeros(100)) == []
    assert found(np.zeros(0)) == []
    assert found(np.full(100, np.nan)) == []


@pytest.mark.parametrize("n", [0, 1, 2, 3, 5, 50])
def test_velocity_of_short_positions(n):
    velocity = velocity_from_position(0.002 * np.arange(n), FS_HZ)
    assert velocity.shape == (n,)
    if n >= 3:
        assert velocity == pytest.approx(2.0)


def test_what_stands_for_the_carrier():
    turn = 2 * np.pi
    assert motor_frequency(turn, 100, 5) == pytest.approx(500)
    assert motor_frequency(turn, 100, None) == pytest.approx(100)
    assert motor_frequency(turn, None, None) == pytest.approx(1)


def test_fluctuations_of_too_few_samples_are_as_fast_as_can_be_told():
    sine = np.sin(2 * np.pi * 5 * np.arange(FS_HZ) / FS_HZ)
    assert fluctuation_frequency(sine, FS_HZ) == pytest.approx(5, rel=0.05)
    for known in (np.zeros(0), sine[:9], np.where(np.arange(FS_HZ) < 9, sine, np.nan)):
        assert fluctuation_frequency(known, FS_HZ) == FS_HZ / 4
