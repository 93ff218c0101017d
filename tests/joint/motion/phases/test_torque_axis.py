"""The current along the torque axis, and on which side of it the torque lies."""

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.motion.kinematics import Recording, build_track
from opamc_cli.joint.motion.phases.following import (
    follow_phases,
)
from opamc_cli.joint.motion.phases.phase_angle import PhaseAngle
from opamc_cli.joint.motion.phases.torque_axis import side_of_torque, torque_current
from opamc_cli.joint.motion.track import Joint


@pytest.mark.parametrize("seed", range(6))
def test_torque_current_keeps_its_sign_through_zeros_and_reversals(seed):
    made = simulate(seed, rate=2048.0)
    angle = follow_phases(made.phases, made.rate_hz)
    torque = torque_current(made.phases, angle.angle_rad, angle.velocity_rad_s, angle.angle_rad)
    torque = torque * side_of_torque(torque, angle, made.rate_hz)
    clear = np.abs(made.current) > 5 * made.noise_rms
    clear &= np.abs(made.velocity) > 0.05 * np.abs(made.velocity).max()
    # Which way is positive is a convention of the drive: friction decides it here.
    wrong = np.mean(torque[clear] * made.current[clear] < 0)
    assert min(wrong, 1 - wrong) < 0.01
    np.testing.assert_allclose(
        np.abs(torque[clear]), np.abs(made.current[clear]), atol=6 * made.noise_rms
    )


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
        found = torque_current(phases, electrical + turned, velocity, position)
        np.testing.assert_allclose(found, torque, atol=1e-9)


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
