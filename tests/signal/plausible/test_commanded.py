"""A speed that is commanded is told from one that a sensor has measured, late or not."""

import numpy as np
import pytest

from opamc_cli.signal.motion.smoothing import derivatives
from opamc_cli.signal.plausible.commanded import apart

RATE, ENCODER = 250.0, 2e-6


def _filtered(values, lag_s):
    """Through a low-pass filter of first order."""
    share, found = 1 / (1 + lag_s * RATE), np.empty_like(values)
    found[0] = values[0]
    for k in range(1, values.size):
        found[k] = found[k - 1] + share * (values[k] - found[k - 1])
    return found


def _program(seed):
    rng = np.random.default_rng(seed)
    stops, places = np.cumsum(rng.uniform(0.8, 1.6, 30)), rng.uniform(-1.5, 1.5, 30)
    path = np.interp(np.arange(0, 35, 1 / RATE), stops, places)
    for _ in range(2):
        path = np.convolve(np.pad(path, 25, mode="edge"), np.ones(51) / 51, mode="valid")
    return path


@pytest.fixture(params=[0, 1, 2])
def logs(request):
    """Return a commanded speed, the joint's position behind it as logged, and its speed."""
    command = _program(request.param)
    path = _filtered(command, 0.02)
    position = np.round(path / ENCODER) * ENCODER
    return derivatives(command, RATE, 5, 1), position, derivatives(path, RATE, 5, 1)


@pytest.mark.parametrize("digits", [12, 2])
def test_a_command_is_told_however_it_is_rounded(logs, digits):
    command, position, _ = logs
    assert 0.01 < apart(position, np.round(command, digits), RATE) < 0.2


def test_gaps_are_bridged(logs):
    command, position, _ = logs
    command[1000:1010], position[2000:2004] = np.nan, np.nan
    assert apart(position, command, RATE) > 0.01


@pytest.mark.parametrize("lag_s", [0.0, 0.004, 0.02])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_measured_speed_is_the_joints_own_however_late(logs, lag_s, noise):
    _, position, speed = logs
    measured = _filtered(speed, lag_s) + noise * np.random.default_rng(0).normal(size=speed.size)
    assert apart(position, measured, RATE) is None


def test_a_joint_that_rests_and_steps_that_are_coarser_tell_nothing(logs):
    command, position, speed = logs
    assert apart(np.full_like(position, 0.3), 1e-3 * command, RATE) is None
    assert apart(position, np.round(speed, 1), RATE) is None


def test_noise_alone_keeps_a_speed(logs):
    """A tachometer that is 3 % off and noisy has measured something."""
    command, position, _ = logs
    noisy = command + 1e-3 * np.random.default_rng(0).normal(size=command.size)
    assert apart(position, noisy, RATE) is None


def test_a_coarse_position_tells_nothing_of_a_speed(logs):
    _, position, speed = logs
    coarse = np.round(position / 0.01) * 0.01
    assert apart(coarse, speed, RATE) is None
