"""Sense and frequency of rotation, frame by frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.signal.motion.rotation import (
    RotationStream,
    join_rotation,
    torque_current,
    turned,
    turning_parts,
)


def rotation_of(z, step=16):
    stream = RotationStream(step)
    return join_rotation([stream.push(z), stream.finish()])


def vector(frequency_hz, n=1000, fs_hz=2048.0):
    return np.exp(2j * np.pi * frequency_hz * np.arange(n) / fs_hz).astype(np.complex64)


@pytest.mark.parametrize("frequency_hz", [-400.0, -3.0, 50.0, 900.0])
def test_frequency_of_a_turning_vector(frequency_hz):
    rotation = rotation_of(vector(frequency_hz))
    assert rotation.frequency_hz(2048.0)[1:] == pytest.approx(frequency_hz, abs=0.01)
    assert rotation.direction() == np.sign(frequency_hz)


def test_a_change_of_sign_does_not_change_the_sense():
    torque = np.cos(2 * np.pi * np.arange(1000) / 300)
    rotation = rotation_of((torque * vector(100.0)).astype(np.complex64))
    clear = rotation.along > 0.5 * rotation.along.max()
    # The first frame has one step less: its first sample has none before it.
    assert rotation.frequency_hz(2048.0)[1:][clear[1:]] == pytest.approx(100, rel=0.01)


def test_noise_adds_nothing_on_the_whole():
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(100_000) + 1j * rng.standard_normal(100_000)
    rotation = rotation_of(vector(100.0, 100_000) + 0.5 * noise.astype(np.complex64))
    angle = np.arctan2(rotation.turn.sum(), rotation.along.sum())
    assert angle * 2048 / (2 * np.pi) == pytest.approx(100, rel=0.05)


@settings(max_examples=50)
@given(st.lists(st.integers(0, 70), max_size=8), st.integers(1, 20))
def test_does_not_depend_on_the_pieces(pieces, step):
    rng = np.random.default_rng(sum(pieces))
    z = rng.standard_normal(sum(pieces)) + 1j * rng.standard_normal(sum(pieces))
    z = z.astype(np.complex64)
    whole = rotation_of(z, step)
    stream = RotationStream(step)
    parts = [stream.push(p) for p in np.split(z, np.cumsum(pieces)[:-1])] if pieces else []
    found = join_rotation([*parts, stream.finish()])
    assert found.turn.size == -(-z.size // step)
    assert np.array_equal(found.turn, whole.turn)
    assert np.array_equal(found.along, whole.along)
    by_definition = np.imag(z[1:] * np.conj(z[:-1])).sum()
    assert found.turn.sum() == pytest.approx(by_definition, abs=1e-3)


def test_smoothing_sums_neighbours():
    rotation = rotation_of(vector(100.0, 160))
    smooth = rotation.smoothed(3)
    assert smooth.turn[4] == pytest.approx(rotation.turn[3:6].sum())
    assert smooth.turn[0] == pytest.approx(rotation.turn[:2].sum())


def test_missing_samples_are_passed_over():
    z = vector(100.0)
    z[500] = np.nan
    assert np.isfinite(rotation_of(z).turn).all()


@pytest.mark.parametrize("n_turns", [-25, 40])
@pytest.mark.parametrize("torque", [1.0, "changing sign"])
def test_a_motion_s_turns_are_told_beneath_noise(n_turns, torque):
    rng = np.random.default_rng(1)
    fs_hz, s = 2000.0, np.linspace(0, 1, 4000)
    angle = 2 * np.pi * n_turns * (10 * s**3 - 15 * s**4 + 6 * s**5)
    if torque == "changing sign":
        torque = np.cos(np.pi * s)
    noise = rng.normal(size=s.size) + 1j * rng.normal(size=s.size)
    z = torque * np.exp(1j * angle) + 0.05 * noise
    z[100] = np.nan
    f_max_hz = abs(n_turns) * 1.875 / 2
    parts, turns = turning_parts(z, f_max_hz, fs_hz)
    assert parts.size == turns.size == pytest.approx(16 * f_max_hz * 2, rel=0.3)
    assert turns.sum() == pytest.approx(n_turns, abs=0.7)


def test_what_is_too_short_does_not_turn():
    one_hz = vector(100.0, 3)
    parts, turns = turning_parts(one_hz, 100.0, 2048.0)
    assert parts == pytest.approx(one_hz)
    assert turns == pytest.approx(100 / 2048, rel=1e-3)
    for n in (0, 1):
        assert turning_parts(one_hz[:n], 100.0, 2048.0)[1].tolist() == [0.0] * n


def swinging(f_hz, noise, seed=0):
    """A vector that turns there and back, of a current that passes zero three times."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 4000)
    rate = f_hz * np.sin(np.pi * t)
    torque = np.sin(2 * np.pi * 1.7 * t) + 0.05 * np.sin(2 * np.pi * 23 * t)
    turns = np.cumsum(rate) / 2000
    z = torque * np.exp(1j * (2 * np.pi * turns + 0.7))
    return z + noise * (rng.normal(size=t.size) + 1j * rng.normal(size=t.size)), torque, turns


@pytest.mark.parametrize("f_hz", [15.0, 60.0, -200.0])
def test_a_current_gets_its_sign_back_wherever_it_passes_zero(f_hz):
    z, torque, _ = swinging(f_hz, 0.01)
    z[1700:1703] = np.nan
    found = torque_current(z, abs(f_hz), 2000.0)
    assert np.isnan(found[1700:1703]).all()
    known = np.isfinite(found)
    sign = np.sign(found[known] @ torque[known])
    np.testing.assert_allclose(sign * found[known], torque[known], atol=0.08)


def test_a_vector_tells_how_far_it_has_turned_whatever_its_current():
    z, torque, turns = swinging(60.0, 0.01)
    found = turned(z, 60.0, 2000.0)
    np.testing.assert_allclose(found - found[2000], turns - turns[2000], atol=0.2)
    warm = turned(z * np.where(torque > 0, 0.5, 1.5), 60.0, 2000.0)
    np.testing.assert_allclose(warm, found, atol=0.2)
    assert not turned(z[:1], 60.0, 2000.0).any()
