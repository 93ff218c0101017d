"""Sign and unit of what was logged."""

import numpy as np
import pytest

from opamc_cli.signal.motion.signs import (
    friction_drives,
    lacks_sign,
    signed_by_speed,
    speed_ratio,
)

FS_HZ = 1000.0
RATE = 200.0
TIME = np.arange(2000) / RATE
PLACE = np.sin(1.5 * TIME)
SPEED = 1.5 * np.cos(1.5 * TIME)


def steps(*parts):
    return np.concatenate([np.full(n, speed, dtype=float) for speed, n in parts])


def test_a_current_without_its_sign():
    """It is larger either way than at rest; a load's is larger one way alone."""
    v = steps((0, 20), (1, 20), (0, 20), (-1, 20))
    friction, load = np.abs(v) + 0.5, 0.3 * v + 0.5
    assert lacks_sign(friction, v) is True
    assert lacks_sign(-friction, v) is True
    assert lacks_sign(load, v) is False
    assert lacks_sign(v, v) is False  # both signs
    assert lacks_sign(np.full(v.size, np.nan), v) is False
    # too little on its way, and too little at rest, to tell
    assert lacks_sign(friction[:69], v[:69]) is False
    assert lacks_sign(friction[:70], v[:70]) is True
    moving = np.abs(v) > 0
    rests = np.cumsum(~moving)
    for n_rest, found in ((9, None), (10, True)):
        chosen = moving | ((rests > 20) & (rests <= 20 + n_rest))  # between the two ways
        assert lacks_sign(friction[chosen], v[chosen]) is found
    # less than a third of the largest speed is neither rest nor way
    slow = np.where(v == 0, 0.29, v)
    assert lacks_sign(friction, slow) is None


def test_a_current_takes_the_sign_of_the_speed_and_fades_at_rest():
    v = np.array([1.0] * 200 + [-1.0] * 200 + [0.0, 0.01, -0.02, 0.03])
    found = signed_by_speed(np.full(v.size, -2.0), v)
    assert found[[0, 399]].tolist() == [2, -2]
    assert found[-4:] == pytest.approx([0, 1, -2, 2])
    assert signed_by_speed(np.ones(3), np.zeros(3)).tolist() == [0, 0, 0]


def held_joint(inertia=0.5):
    """Speed and current of a joint that its loop holds at rest against its own friction."""
    ramp, held = np.linspace(0, 1, 50), np.ones(100)
    one_way = np.concatenate([ramp, held, ramp[::-1]])
    still = np.zeros(80)
    v = np.concatenate([still, one_way, still, -one_way, still])
    friction = np.sign(v)
    last = np.cumsum(v != 0) > 0
    friction[last & (v == 0)] = 1.05
    return v, friction + 0.1 * v + 50 * inertia * np.gradient(v)


def test_a_modulus_is_told_where_the_joint_is_held_at_rest_by_its_friction():
    v, current = held_joint()
    assert lacks_sign(np.abs(current), v) is True
    assert lacks_sign(-np.abs(current), v) is True
    assert lacks_sign(current, v) is False
    for load in (4.0, -4.0):
        assert lacks_sign(current + load, v) is False
    moving = v != 0
    assert lacks_sign(np.abs(current[moving]), v[moving]) is True


def test_a_current_that_never_comes_near_zero_has_not_changed_its_sign():
    """Under a heavy load another axis's motion may look like growth with the speed."""
    v, _ = held_joint()
    coupled = 50 * np.gradient(np.abs(v))
    assert lacks_sign(5.0 + coupled, v) is False
    assert lacks_sign(-5.0 - coupled, v) is False
    # twice the smallest size is less than the largest step: it may have stepped over zero
    step = float(np.abs(np.diff(coupled)).max())
    lifted = coupled - coupled.min()
    assert lacks_sign(lifted + 0.49 * step, v) is True
    assert lacks_sign(lifted + 0.51 * step, v) is False


def test_a_load_that_friction_takes_near_zero_once_has_its_sign():
    """Its current grows with the speed where the axis that bears it moves alike."""
    v, _ = held_joint()
    current = 2.0 + 50 * np.gradient(np.abs(np.tile(v, 3)))
    current[-70:-50] -= 2.0 * np.hanning(20)
    assert lacks_sign(current, np.tile(v, 3)) is False


def test_an_overshoot_of_resampling_is_no_sign():
    v, current = held_joint()
    size = np.abs(current)
    size[7] = -0.002 * size.max()
    assert lacks_sign(size, v) is True
    size[7] = -0.02 * size.max()
    assert lacks_sign(size, v) is False


def rigid_joint(friction, seconds=12.0, seed=0):
    """Current, angle: gravity, inertia, a constant and friction, none of it small."""
    t = np.arange(int(seconds * FS_HZ)) / FS_HZ
    q = 0.8 * np.sin(1.3 * t) + 0.5 * np.sin(2.1 * t + 1)
    v, a = np.gradient(q) * FS_HZ, np.gradient(np.gradient(q)) * FS_HZ**2
    noise = 0.1 * np.random.default_rng(seed).normal(size=t.size)
    return 3 * np.cos(q + 0.4) + 0.7 * a - 0.5 + friction * np.sign(v) + noise, q


@pytest.mark.parametrize("friction", [0.3, 2.0])
def test_friction_drives_where_current_and_motion_have_opposite_signs(friction):
    current, q = rigid_joint(friction)
    assert friction_drives([(current, q)], FS_HZ) is False
    assert friction_drives([(-current, q)], FS_HZ) is True
    assert friction_drives([(current, -q)], FS_HZ) is True
    # Two recordings decide together, gaps are left out.
    current[2000:2300] = np.nan
    half = q.size // 2
    pair = [(-current[:half], q[:half]), (-current[half:], q[half:])]
    assert friction_drives(pair, FS_HZ) is True


def test_without_friction_or_a_way_back_nothing_drives():
    runs = [rigid_joint(0.0, seed=seed) for seed in range(20)]
    assert not any(friction_drives([(-current, q)], FS_HZ) for current, q in runs)
    q = np.linspace(0, 2, 3000)
    assert friction_drives([(-np.ones(q.size), q)], FS_HZ) is False


@pytest.mark.parametrize("unit", [1.0, 180 / np.pi])
def test_a_speed_tells_its_unit_beside_the_position(unit):
    assert speed_ratio(PLACE, unit * SPEED, RATE) == pytest.approx(unit, rel=0.01)
    gaps = PLACE.copy()
    gaps[300:400] = np.nan
    assert speed_ratio(gaps, unit * SPEED, RATE) == pytest.approx(unit, rel=0.01)


def test_no_unit_is_told_where_two_channels_have_nothing_in_common():
    assert speed_ratio(PLACE, np.random.default_rng(0).normal(size=PLACE.size), RATE) is None
    assert speed_ratio(np.zeros(2000), SPEED, RATE) is None
    assert speed_ratio(PLACE[:300], SPEED[:300], RATE) is None


@pytest.mark.parametrize("ratio", [1.0, 180 / np.pi, 30 / np.pi, np.pi / 180])
def test_the_ratio_of_a_logged_speed_to_the_position_s_change_is_told(ratio):
    position = 1e-4 * np.round(1e4 * PLACE)
    noise = np.random.default_rng(0).normal(0, 0.05, SPEED.size)
    found = speed_ratio(position, ratio * (SPEED + noise), RATE)
    assert found == pytest.approx(ratio, rel=0.01)


def test_no_ratio_is_told_where_speed_and_position_are_of_different_motions_or_of_none():
    other = 1.4 * np.cos(1.4 * TIME + 1)
    assert speed_ratio(PLACE, other, RATE) is None
    assert speed_ratio(np.zeros(TIME.size), np.zeros(TIME.size), RATE) is None
