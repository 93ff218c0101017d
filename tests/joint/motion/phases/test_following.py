"""The current vector is followed through its zeros, and freed of what sensors add to it."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from simulator import simulate

from opamc_cli.joint.motion.phases.following import _followed, follow_phases
from opamc_cli.signal.plausible.sensor_errors import FEWEST_FAST_SAMPLES
from opamc_cli.signal.transform.angle_filter import averaged_angle


def test_speed_is_the_electrical_one():
    made = simulate(3, rate=2048.0)
    angle = follow_phases(made.phases, made.rate_hz)
    true = made.velocity * made.gear_ratio * made.pole_pairs
    clear = np.abs(true) > 0.2 * np.abs(true).max()
    side = np.sign(np.dot(angle.velocity_rad_s, true))
    error = (side * angle.velocity_rad_s - true)[clear & angle.strong]
    assert np.median(np.abs(error)) < 0.01 * np.abs(true).max()


@pytest.mark.parametrize(
    ("share", "gain"), [(0.0, 1.0), (0.1, 1.0), (0.3, 1.0), (1.5, 1.0), (0.0, 1.5), (0.5, 3.0)]
)
def test_errors_of_the_sensors_do_not_turn_the_angle(share, gain):
    """Beside a zero error that is larger than the current its vector does not even turn."""
    made = simulate(3, rate=2048.0)
    error = share * float(np.quantile(np.abs(made.current), 0.9))
    phases = made.phases * np.array([1.0, 1.0, gain]) + error * np.array([1.0, -0.3, -0.7])
    angle = follow_phases(phases, made.rate_hz)
    true = made.velocity * made.gear_ratio * made.pole_pairs
    clear = angle.strong & (np.abs(true) > 0.2 * np.abs(true).max())
    side = np.sign(np.dot(angle.velocity_rad_s, true))
    wrong = np.abs(side * angle.velocity_rad_s - true)[clear] > 0.05 * np.abs(true).max()
    assert np.mean(wrong) < 0.01


@pytest.mark.parametrize(("carrier_hz", "tells"), [(80.0, True), (52.0, True), (40.0, False)])
def test_errors_are_sought_where_the_carrier_is_fast_or_else_fast_enough(carrier_hz, tells):
    """A joint of 50 Hz kept its zero error, and lost half turns at each zero of the torque."""
    angle = 2 * np.pi * carrier_hz * np.arange(4000) / 2000.0
    vector = np.exp(1j * angle) + 0.001 * np.random.default_rng(11).normal(size=4000)
    assert (_followed(vector, vector, 2000.0, 30.0).fast.sum() >= FEWEST_FAST_SAMPLES) == tells


def test_weak_currents_tell_their_angle_together():
    rng = np.random.default_rng(10)
    angle = np.linspace(0, 400, 4000)
    size = np.where(np.arange(4000) < 2000, 0.25, 0.0)
    noise = 0.1
    vector = size * np.exp(1j * angle) + noise * (
        rng.normal(size=4000) + 1j * rng.normal(size=4000)
    )
    strong, measured = averaged_angle(vector, angle + 0.2, noise, 0.0, 2048.0)
    assert np.mean(strong[50:1950]) > 0.95
    assert np.mean(strong[2050:]) < 0.02
    error = np.angle(np.exp(2j * (measured - angle)))[50:1950] / 2
    assert np.std(error[strong[50:1950]]) < 0.2
    # One by one they would be off by more.
    assert np.std(np.angle((vector * np.exp(-1j * angle)) ** 2)[50:1950] / 2) > 0.3


@pytest.mark.parametrize("seed", range(3))
def test_a_weak_current_for_a_second_does_not_carry_the_angle_away(seed):
    """Gravity and friction balance in the middle of a slow sweep: 1200 half turns were made up."""
    rate, rng = 2000.0, np.random.default_rng(seed)
    time_s = np.arange(int(16 * rate)) / rate
    turned = cumulative_trapezoid(np.where(time_s < 1, 150.0, 12.0), dx=1 / rate, initial=0.0)
    torque = 2.0 - 0.2 * time_s
    vector = 1j * torque * np.exp(1j * turned)
    phases = np.stack([(vector * np.exp(-2j * np.pi * k / 3)).real for k in range(3)], axis=1)
    found = follow_phases(phases + 0.03 * rng.normal(size=phases.shape), rate)
    known = found.strong & (np.abs(torque) > 0.2) & (time_s > 1.2)
    assert np.ptp((found.angle_rad - turned)[known]) < 1.0


@pytest.mark.parametrize("seed", [0, 6, 9, 11])
def test_noise_leads_nothing_away_that_counts_where_the_torque_is_small_for_long(seed):
    """One joint was followed at five times its speed; by 324 to 602 samples each of these was."""
    rate, rng = 2000.0, np.random.default_rng(seed)
    time_s = np.arange(int(6 * rate)) / rate
    speed = -450.0 + 300.0 * np.sin(2 * (time_s - 3.0))
    size = np.clip(0.2 * (time_s - 3.0), -0.5, 0.5)
    vector = size * np.exp(1j * cumulative_trapezoid(speed, dx=1 / rate, initial=0.0))
    vector += 0.033 * (rng.normal(size=time_s.size) + 1j * rng.normal(size=time_s.size))
    angle = follow_phases((vector[:, None] * np.exp(-2j * np.pi / 3 * np.arange(3))).real, rate)
    side = np.sign(np.dot(angle.velocity_rad_s, speed))
    wrong = np.abs(side * angle.velocity_rad_s - speed) > 0.3 * np.abs(speed).max()
    assert np.count_nonzero(wrong & angle.clear) < 100
    assert np.mean(angle.clear[np.abs(time_s - 3.0) > 1.5]) > 0.95
