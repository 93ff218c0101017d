import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.kinematics import Recording, build_track
from opamc_cli.joint.phases import follow_phases, lost, side_of_torque, torque_current
from opamc_cli.joint.track import Joint


@pytest.mark.parametrize("seed", range(6))
def test_torque_current_keeps_its_sign_through_zeros_and_reversals(seed):
    made = simulate(seed, rate=2048.0)
    angle = follow_phases(made.phases, made.rate_hz)
    torque, _ = torque_current(made.phases, angle.angle_rad, angle.velocity_rad_s)
    torque = torque * side_of_torque(torque, angle, made.rate_hz)
    clear = np.abs(made.current) > 5 * made.noise_rms
    clear &= np.abs(made.velocity) > 0.05 * np.abs(made.velocity).max()
    # Which way is positive is a convention of the drive: friction decides it here.
    wrong = np.mean(torque[clear] * made.current[clear] < 0)
    assert min(wrong, 1 - wrong) < 0.01
    np.testing.assert_allclose(
        np.abs(torque[clear]), np.abs(made.current[clear]), atol=6 * made.noise_rms
    )


def test_speed_is_the_electrical_one():
    made = simulate(3, rate=2048.0)
    angle = follow_phases(made.phases, made.rate_hz)
    true = made.velocity * made.gear_ratio * made.pole_pairs
    clear = np.abs(true) > 0.2 * np.abs(true).max()
    side = np.sign(np.dot(angle.velocity_rad_s, true))
    error = (side * angle.velocity_rad_s - true)[clear & angle.strong]
    assert np.median(np.abs(error)) < 0.01 * np.abs(true).max()


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


def test_short_gaps_of_current_are_bridged_and_long_ones_are_lost():
    strong = np.ones(1000, dtype=bool)
    strong[200:210] = False
    strong[500:600] = False
    gone = lost(strong, rate_hz=1000.0)
    assert np.array_equal(np.flatnonzero(gone), np.arange(500, 600))
    assert lost(np.zeros(10, dtype=bool), 1000.0).all()
