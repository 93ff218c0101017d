import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.phases import follow_phases, side_of_torque, torque_current


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
