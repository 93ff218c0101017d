"""From logged channels to motion: which samples move, in which direction, and in what units."""

import numpy as np
import pytest

from opamc_cli.joint.motion.kinematics import (
    Motion,
    Recording,
    build_track,
    direction_of,
    motion_from_position,
    motion_from_velocity,
    moving_samples,
    smoothings,
)
from opamc_cli.joint.motion.track import Joint

RATE = 200.0
TIME = np.arange(2000) / RATE
PLACE = np.sin(1.5 * TIME)
SPEED = 1.5 * np.cos(1.5 * TIME)


def recorded(**channels):
    return Recording("run", RATE, **({"current_a": np.cos(TIME)} | channels))


def motion(velocity, noise=0.0, window=11):
    zeros = np.zeros_like(velocity)
    return Motion(zeros, velocity, zeros, window, noise, np.ones(1))


def test_a_part_of_a_recording_has_that_part_of_every_channel():
    run = recorded(position_rad=PLACE, phases_a=np.zeros((2000, 3)), temperature_c=TIME)
    part = run.cut(slice(10, 25))
    assert (run.size, part.size) == (2000, 15)
    assert part.phases_a.shape == (15, 3)
    np.testing.assert_array_equal(part.temperature_c, TIME[10:25])
    assert part.velocity_rad_s is None
    assert Recording("run", RATE, position_rad=PLACE).size == 2000


def test_ways_to_differentiate_are_windows_that_fit_and_speeds_that_were_logged():
    alone = smoothings([recorded(position_rad=PLACE)])
    assert [(one.window_s, one.from_velocity) for one in alone] == [
        (0.01, False), (0.02, False), (0.05, False), (0.12, False)
    ]  # fmt: skip
    both = smoothings([recorded(position_rad=PLACE, velocity_rad_s=SPEED)])
    assert len(both) == 2 * len(alone)
    assert smoothings([recorded(position_rad=PLACE), recorded()]) == []
    short = recorded(position_rad=PLACE).cut(slice(0, 10))
    assert [one.window_s for one in smoothings([short])] == [0.01, 0.02]


@pytest.mark.parametrize("lag_s", [0.0, 0.01, 0.03])
def test_the_lag_of_a_logged_speed_is_taken_off(lag_s):
    """A drive's filter of first order; the position's steps are coarse, so that the speed is used.

    A speed that is not late stays as it is.
    """
    decay = np.exp(-1 / (lag_s * RATE)) if lag_s else 0.0
    late = np.empty_like(SPEED)
    late[0] = SPEED[0]
    for n in range(1, late.size):
        late[n] = decay * late[n - 1] + (1 - decay) * SPEED[n]
    steps = np.round(PLACE / 1e-4) * 1e-4
    found = motion_from_position(steps, late, RATE)
    alone = motion_from_position(steps, None, RATE)
    inside = slice(50, -50)
    assert found.window < alone.window
    off = np.std((found.velocity - SPEED)[inside]) / np.std(SPEED)
    assert off < 0.005
    off = np.std((found.acceleration + 2.25 * PLACE)[inside]) / 2.25
    assert off < 0.01


def test_motion_is_the_derivative_of_what_was_logged():
    inside = slice(50, -50)
    found = motion_from_position(PLACE, None, RATE)
    np.testing.assert_allclose(found.velocity[inside], SPEED[inside], atol=1e-4)
    np.testing.assert_allclose(found.acceleration[inside], -2.25 * PLACE[inside], atol=1e-3)
    found = motion_from_velocity(SPEED, RATE)
    np.testing.assert_allclose(found.position_rad, PLACE, atol=1e-3)
    np.testing.assert_allclose(found.acceleration[inside], -2.25 * PLACE[inside], atol=1e-3)


@pytest.mark.parametrize(("factor", "cleaner"), [(1.0, True), (1.3, False)])
def test_a_logged_speed_that_agrees_is_taken_where_it_is_cleaner(factor, cleaner):
    noisy = PLACE + np.random.default_rng(1).normal(0, 1e-3, PLACE.size)
    by_both = motion_from_position(noisy, factor * SPEED, RATE)
    by_place = motion_from_position(noisy, None, RATE)
    assert (by_both.window < by_place.window) == cleaner
    np.testing.assert_array_equal(by_both.position_rad, by_place.position_rad)


def test_a_motion_is_delayed_by_a_fraction_of_a_sample():
    late = motion_from_position(PLACE, None, RATE).later(0.002, RATE)
    inside = slice(50, -50)
    np.testing.assert_allclose(late.position_rad[inside], np.sin(1.5 * (TIME - 0.002))[inside],
                               atol=1e-4)  # fmt: skip


def test_the_direction_is_open_where_noise_could_have_made_it():
    speeds = np.array([1.0, -1.0, 0.2, -0.2, 0.0005, 0.0] * 20)
    assert direction_of(motion(speeds))[:6].tolist() == [1, -1, 1, -1, 0, 0]
    assert direction_of(motion(speeds, noise=0.1))[:6].tolist() == [1, -1, 0, 0, 0, 0]


def test_moving_is_half_a_window_from_reversals_ends_and_gaps_and_not_too_slow():
    velocity = np.concatenate([np.ones(100), -np.ones(100), np.full(100, -0.01), -np.ones(100)])
    usable = np.ones(400, dtype=bool)
    moving = moving_samples(motion(velocity), usable)
    expected = np.ones(400, dtype=bool)
    expected[:5] = expected[395:] = expected[95:106] = expected[200:300] = False
    np.testing.assert_array_equal(moving, expected)
    usable[150] = False
    assert np.flatnonzero(expected & ~moving_samples(motion(velocity), usable)).tolist() == [150]


def test_recordings_lie_one_after_the_other_on_a_common_clock_if_they_have_one():
    first, second = (
        Recording(f"run {k}", RATE, current_a=np.cos(TIME), position_rad=PLACE, started_s=start)
        for k, start in enumerate((100.0, 3700.0))
    )
    track = build_track([first, second], Joint())
    assert track.bounds == ((0, 2000), (2000, 4000))
    assert track.time_s[2000] == 3600.0
    assert track.run_time_s[2000] == 0.0
    # one that begins before the other has ended comes after it all the same
    early = Recording("run", RATE, current_a=np.cos(TIME), position_rad=PLACE, started_s=101.0)
    assert build_track([first, early], Joint()).time_s[2000] == 10.0
    unknown = [recorded(position_rad=PLACE)] * 2
    assert build_track(unknown, Joint()).starts_s.tolist() == [0.0, 10.0]


def test_only_what_all_recordings_hold_is_known_of_them():
    warm = recorded(position_rad=PLACE, temperature_c=TIME)
    cold = recorded(position_rad=PLACE)
    assert "temperature" in build_track([warm], Joint()).channels
    both = build_track([warm, cold], Joint())
    assert "temperature" not in both.channels
    assert both.temperature_c is None


def test_a_gap_in_any_channel_that_is_needed_does_not_move():
    current, place = np.cos(TIME), PLACE.copy()
    current[300], place[500] = np.nan, np.inf
    whole = build_track([recorded(position_rad=PLACE)], Joint()).moving
    track = build_track([recorded(current_a=current, position_rad=place)], Joint())
    assert {300, 500} <= set(np.flatnonzero(whole & ~track.moving).tolist())
    assert np.isfinite(track.current_a).all()


@pytest.mark.parametrize(
    ("joint", "kind", "turns"),
    [(Joint(), "joint", 1.0), (Joint(100.0, 5), "motor", 100.0), (Joint(None, 5), "joint", 1.0)],
)
def test_orders_are_of_the_motor_where_the_gear_is_known(joint, kind, turns):
    track = build_track([recorded(position_rad=PLACE)], joint)
    assert track.angle_kind == kind
    np.testing.assert_allclose(track.machine_angle_rad, turns * track.position_rad)


def test_what_cannot_be_a_recording_is_refused():
    with pytest.raises(ValueError, match="position, a velocity or three phase"):
        build_track([recorded()], Joint())
    with pytest.raises(ValueError, match="signed current or three phase"):
        build_track([Recording("run", RATE, position_rad=PLACE)], Joint())


def test_no_window_is_longer_than_the_shortest_recording():
    place = np.sin(np.arange(400) / 50)
    recordings = [
        Recording(name, 4000.0, current_a=place[:size], position_rad=place[:size])
        for name, size in (("long", 400), ("short", 300))
    ]
    assert [one.window_s for one in smoothings(recordings)] == [0.01, 0.02, 0.05]
    for smoothing in smoothings(recordings):
        assert build_track(recordings, Joint(), smoothing).size == 700
