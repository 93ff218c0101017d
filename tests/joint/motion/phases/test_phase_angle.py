"""A followed angle beside a logged position."""

import numpy as np
import pytest

from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.track import Joint


def test_delay_of_the_phase_sensors_does_not_turn_the_torque_axis():
    rate, delay_s, poles, ratio = 2048.0, 1e-3, 5, 100.0
    time_s = np.arange(int(8 * rate)) / rate
    wave = np.sin(2 * np.pi * 0.4 * time_s)
    velocity = 3.0 * np.sign(wave) * np.maximum(np.abs(wave) - 0.5, 0.0)
    position = np.cumsum(velocity) / rate
    # At rest nothing is held: from the phases alone the angle is lost there.
    torque = 2.0 * np.sign(velocity) + 4.0 * np.sin(3 * position) * (velocity != 0)
    field = poles * ratio * np.interp(time_s - delay_s, time_s, position)
    phases = np.stack([torque * np.cos(field - k * 2 * np.pi / 3) for k in range(3)], axis=1)
    phases += 0.02 * np.random.default_rng(1).normal(size=phases.shape)
    recording = Recording("run", rate, phases_a=phases, position_rad=position)
    track = build_track([recording], Joint(ratio, poles))
    rows = track.moving
    assert np.max(np.abs(track.current_a[rows] - torque[rows])) < 0.3
    # The angle comes from the position: it does not slip at rest.
    assert np.ptp(track.electrical_rad - field) < 0.3


@pytest.mark.parametrize(("other", "aligned"), [(0.0, True), (0.02, False)])
def test_an_angle_that_zero_errors_scatter_follows_the_position_where_that_moves_with_it(
    other, aligned
):
    """By half a radian, as those of a joint that creeps under little load do."""
    rate, ratio = 500.0, 200.0
    time_s = np.arange(5000) / rate
    position = 0.9 * np.sin(1.3 * time_s)
    speed = np.gradient(position) * rate
    path = ratio * (position + other * np.sin(2.1 * time_s)) + 0.4
    scattered = path + 0.45 * np.random.default_rng(5).normal(size=path.size)
    every, blur = np.ones(path.size, dtype=bool), np.zeros((path.size, 2))
    angle = PhaseAngle(scattered, ratio * speed, speed, every, every, 5, np.ones(1), blur)
    electrical, _, turns = angle.aligned_with(position, speed, rate)
    rest = np.exp(2j * (electrical - path))
    assert (np.abs(rest.mean()) > 0.99) == aligned
    assert (electrical is scattered) != aligned
    assert turns == (pytest.approx((ratio,), rel=2e-4) if aligned else ())


def test_the_angle_follows_a_position_of_unknown_ratio_through_half_turns_lost():
    rate, ratio, lag_s = 1000.0, 812.7, 0.0021
    rng = np.random.default_rng(12)
    time_s = np.arange(9000) / rate
    position, speed = 0.9 * np.sin(1.3 * time_s) + 0.2 * np.sin(3.1 * time_s), np.zeros(9000)
    speed[:] = np.gradient(position) * rate
    path = ratio * np.interp(time_s - lag_s, time_s, position) + 0.4
    # Within a stroke the torque passes zero, and the count of half turns is lost.
    slips = np.zeros(9000)
    slips[rng.integers(0, 9000, 25)] = np.pi * rng.choice([-2, -1, 1, 2], 25)
    followed = path + np.cumsum(slips) + 0.05 * rng.normal(size=9000)
    every, blur = np.ones(9000, dtype=bool), np.zeros((9000, 2))
    angle = PhaseAngle(followed, np.gradient(path) * rate, speed, every, every, 5, np.ones(1), blur)
    electrical, lag, turns = angle.aligned_with(position, speed, rate)
    assert turns == pytest.approx((ratio,), rel=1e-4)
    assert lag == pytest.approx(lag_s, abs=5e-5)
    rest = (electrical - path)[100:-100]
    assert np.ptp(rest) < 0.1
    assert abs(np.angle(np.exp(2j * rest.mean()))) < 0.1
