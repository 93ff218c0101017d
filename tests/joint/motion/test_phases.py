from dataclasses import replace

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.phases.angle_filter import acceleration_noise, smoothed_angle
from opamc_cli.joint.motion.phases.following import (
    averaged_angle,
    follow_phases,
    without_sensor_errors,
)
from opamc_cli.joint.motion.phases.half_turns import bridged, lost, without_slips
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.phases.torque_axis import side_of_torque, torque_current
from opamc_cli.joint.motion.track import Joint


@pytest.mark.parametrize("seed", range(6))
def test_torque_current_keeps_its_sign_through_zeros_and_reversals(seed):
    made = simulate(seed, rate=2048.0)
    angle = follow_phases(made.phases, made.rate_hz)
    torque, _ = torque_current(made.phases, angle.angle_rad, angle.velocity_rad_s, angle.angle_rad)
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


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3])
def test_a_sensor_s_zero_error_does_not_turn_the_angle(share):
    """A third of the current: what was told of it in one round left swings of half a turn."""
    made = simulate(3, rate=2048.0)
    error = share * float(np.quantile(np.abs(made.current), 0.9))
    angle = follow_phases(made.phases + error * np.array([1.0, -0.3, -0.7]), made.rate_hz)
    true = made.velocity * made.gear_ratio * made.pole_pairs
    clear = angle.strong & (np.abs(true) > 0.2 * np.abs(true).max())
    side = np.sign(np.dot(angle.velocity_rad_s, true))
    wrong = np.abs(side * angle.velocity_rad_s - true)[clear] > 0.05 * np.abs(true).max()
    assert np.mean(wrong) < 0.01


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


def test_noise_of_the_acceleration_is_that_of_a_smoothed_white_angle():
    rate, size = 1000.0, 200_000
    angle = 0.01 * np.random.default_rng(2).normal(size=size)
    every, none = np.ones(size, dtype=bool), np.zeros(size, dtype=bool)
    for bandwidth in (10.0, 30.0):
        _, _, acceleration = smoothed_angle(angle, every, np.zeros(size), none, rate, bandwidth)
        found = float(np.std(acceleration[2000:-2000]))
        assert found == pytest.approx(acceleration_noise(0.01, rate, bandwidth), rel=0.05)


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
    freed = without_slips(angle, period, rate).angle_rad
    np.testing.assert_allclose((freed - true)[strong], 3.0, atol=1e-6)
    drifting = replace(angle, angle_rad=path + 0.1 * np.arange(true.size))
    assert without_slips(drifting, period, rate) is drifting


def test_zero_errors_and_unequal_gains_are_taken_out_of_the_vector():
    angle = np.linspace(0, 300, 5000)
    torque = 2 + np.sin(angle / 40)
    clean = torque * np.exp(1j * angle)
    vector = clean + (0.1 - 0.2j) + (0.03 + 0.02j) * np.conj(clean)
    every = np.ones(angle.size, dtype=bool)
    mended = without_sensor_errors(vector, angle, every)
    assert np.std(np.angle(vector * np.exp(-1j * angle))) > 0.05
    assert np.std(np.angle(mended * np.exp(-1j * angle))) < 0.005
    assert without_sensor_errors(vector, angle, ~every) is vector


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


def test_a_torque_that_passes_zero_while_braking_keeps_its_sign():
    """Gaps of some milliseconds at a reversal: counted as one stretch, 3 % had the wrong sign."""
    rng = np.random.default_rng(1)
    rate, place, moves = 2000.0, 0.0, []
    for _ in range(8):
        to, seconds = rng.uniform(-200, 200), rng.uniform(0.4, 0.9)
        part = np.arange(int(seconds * rate)) / (seconds * rate)
        moves += [place + (to - place) * part**3 * (10 - 15 * part + 6 * part**2)]
        moves += [np.full(int(0.05 * rate), to)]
        place = to
    angle = np.concatenate(moves)
    speed = np.gradient(angle) * rate
    torque = 1.2e-3 * np.gradient(speed) * rate + 0.4 * np.tanh(speed / 3) + 3e-3 * speed
    torque += 2.0 * np.cos(angle / 120)
    phases = np.stack([torque * np.cos(angle - k * 2 * np.pi / 3) for k in range(3)], axis=1)
    phases += 0.02 * rng.normal(size=phases.shape)
    track = build_track([Recording("run", rate, phases_a=phases)], Joint(100.0, 5))
    rows = track.moving & track.clear
    assert np.mean(rows) > 0.5
    assert np.mean(np.abs(track.current_a - torque)[rows] > 0.3) < 0.005


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
    freed = without_slips(angle, period, rate).angle_rad
    assert np.ptp((freed - true)[strong]) < 1e-6


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
    electrical, lag = angle.aligned_with(position, speed, None, rate)
    assert lag == pytest.approx(lag_s, abs=5e-5)
    rest = (electrical - path)[100:-100]
    assert np.ptp(rest) < 0.1
    assert abs(np.angle(np.exp(2j * rest.mean()))) < 0.1


def test_friction_tells_the_side_of_the_torque_where_gravity_is_large():
    time_s = np.arange(4000) / 1000.0
    # Slowly up, fast down, and not closed: as time goes, gravity seems to drive backwards.
    position = np.interp(time_s, [0, 2.6, 3.0, 4.0], [0.0, 1.2, 0.1, 0.4])
    velocity = np.gradient(position) * 1000
    torque = -3 * np.sin(position + 0.2) + 0.4 * np.sign(velocity) + 0.1 * velocity
    electrical = 500 * position
    vector = torque * np.exp(1j * electrical)
    phases = np.stack([(vector * np.exp(-2j * np.pi * k / 3)).real for k in range(3)], axis=1)
    for turned in (0.0, np.pi):
        found, flux = torque_current(phases, electrical + turned, velocity, position)
        np.testing.assert_allclose(found, torque, atol=1e-9)
        np.testing.assert_allclose(flux, 0.0, atol=1e-9)


def _strokes(torque_of) -> tuple[np.ndarray, np.ndarray, PhaseAngle]:
    """Six strokes with rests between, current throughout, and an angle without a slip."""
    rate = 1000.0
    part = np.arange(1000) / rate
    to_and_fro = 300 * part**3 * (10 - 15 * part + 6 * part**2)
    rest = np.ones(200)
    once = np.concatenate([to_and_fro, 300 * rest, 300 - to_and_fro, 0 * rest])
    angle = np.tile(once, 3)
    speed = np.gradient(angle) * rate
    torque = torque_of(speed, angle)
    every = np.ones(angle.size, dtype=bool)
    blur = np.zeros((angle.size, 2))
    followed = PhaseAngle(
        angle, speed, np.gradient(speed) * rate, every, every, 1, np.ones(1), blur
    )
    return torque, np.abs(speed) > 0.1 * speed.max(), followed


def test_a_stroke_that_slipped_at_rest_is_turned_back():
    torque, rows, angle = _strokes(lambda v, q: np.sign(v) + 2e-3 * v + 0.5 * np.cos(q / 200))
    seen = torque.copy()
    seen[2400:3400] *= -1  # the third stroke, with no gap of the current before it
    turned = seen * side_of_torque(seen, angle, 1000.0)
    np.testing.assert_allclose(turned[rows], torque[rows])


def test_friction_resists_though_it_grows_with_the_square_of_the_speed():
    torque, rows, angle = _strokes(lambda v, q: 1e-5 * v * np.abs(v))
    for sign in (1.0, -1.0):
        turned = sign * torque * side_of_torque(sign * torque, angle, 1000.0)
        np.testing.assert_allclose(turned[rows], torque[rows])
