"""Speeds of noisy angles: quiet enough to tell a slow part of a program from standstill."""

import numpy as np
import pytest

from opamc_cli.signal.motion.reported import (
    find_joint_motions,
    quiet_velocity,
    velocity_from_position,
)


def slow_program(seed, noise):
    time = np.arange(4000) / 100
    angle = 0.4 * np.sin(0.5 * time) + 0.1 * np.sin(1.5 * time + 1)
    return angle + noise * np.random.default_rng(seed).normal(size=time.size)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_recordings_of_one_program_have_the_same_motions(noise):
    found = [
        find_joint_motions(quiet_velocity(slow_program(seed, noise), 100.0), 100.0, 0.1, 0.06)
        for seed in range(4)
    ]
    assert len({tuple(m.direction for m in motions) for motions in found}) == 1
    for motions in found[1:]:
        starts = [(m.start, m.stop) for m in motions]
        np.testing.assert_allclose(starts, [(m.start, m.stop) for m in found[0]], atol=25)


def test_a_clean_angle_keeps_the_short_window():
    angle = slow_program(0, 0.0)
    np.testing.assert_array_equal(quiet_velocity(angle, 100.0), velocity_from_position(angle, 100))
