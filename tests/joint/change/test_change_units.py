"""Units of comparison: their samples, their own fit, and the phases that are followed."""

from dataclasses import replace

import numpy as np
import pytest
from closing import moved
from sessions import (
    COEFFICIENTS,
    JOINT,
    RATE,
    TERMS,
    columns_of,
    current_of,
    recordings,
    rows_of,
    units_of,
    with_track,
)

from opamc_cli.joint.change.lines import fast_residuals
from opamc_cli.joint.change.slow import learn, with_model
from opamc_cli.joint.change.units import own_fit, read_side, side_by_side, turned
from opamc_cli.joint.fit.parts import ROUNDING
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import Joint, block_mean
from opamc_cli.signal.motion.smoothing import CORNER_WINDOW, SHORTEST_WINDOW, averaging_kernel


@pytest.fixture(scope="module")
def units():
    return units_of(before=3, after=1, spread=0.0)


def test_every_recording_that_moves_is_a_unit(units):
    assert units.after.tolist() == [False, False, False, True]
    still = recordings(1)[0]
    rest = Recording("rest", RATE, current_a=still.current_a, position_rad=0 * still.position_rad)
    assert len(read_side([still, rest], JOINT, cycles=False)) == 1
    assert read_side([rest], JOINT, cycles=False) == []


def test_a_unit_s_samples_move_and_are_clear(units):
    (track,) = read_side(recordings(1, seed=1, spread=0.0), JOINT, cycles=False)
    assert np.array_equal(rows_of(units, 0, True), np.flatnonzero(track.moving & track.clear))
    # A coarse sample counts where all of its samples move.
    whole = block_mean(track.moving.astype(float), track.bounds, units.dataset.factor) == 1
    assert np.array_equal(rows_of(units, 0), np.flatnonzero(whole))
    # The next unit comes after it.
    assert rows_of(units, 1, True).min() >= track.size
    assert units.track.size == sum(stop - start for start, stop in units.track.bounds)


def test_motions_too_short_for_the_coarse_grid_are_compared_at_the_full_rate():
    """A delta robot's at 50 Hz, of 0.2 to 0.5 s: no cause was sought of twice the friction."""
    sides = []
    for seed in (1, 2):
        tracks = read_side(recordings(1, seed=seed, rate=450.0), JOINT, cycles=False)
        sides.append([replace(t, moving=t.moving & (np.arange(t.size) % 4 > 0)) for t in tracks])
    units = side_by_side(*sides)
    assert units.after.tolist() == [False, True]
    assert (units.dataset.factor, units.dataset.coarse.track.rate_hz) == (1, 450.0)


@pytest.mark.parametrize("rate", [100.0, 450.0])
def test_the_coarse_grid_has_a_hundred_hertz_or_what_smoothing_leaves(rate):
    units = units_of(before=1, after=1, rate=rate)
    assert units.track.kernel.size == SHORTEST_WINDOW
    width = 1 / np.sum(averaging_kernel(CORNER_WINDOW, 2) ** 2)
    factor = max(int(rate / 100.0), int(0.8 * width), 1)
    assert units.dataset.coarse.track.rate_hz == rate / factor


def test_cycles_of_one_recording_are_units_that_share_no_sample():
    whole = units_of(before=1, after=0)
    cycles = units_of(before=1, after=0, cycles=True)
    assert cycles.after.size > 3
    rows = cycles.dataset.fine.parts.rows
    assert np.unique(rows).size == rows.size
    assert set(rows) <= set(whole.dataset.fine.parts.rows)
    # Each is one turn of the program, or two.
    sizes = cycles.dataset.fine.parts.counts
    assert max(sizes) < 1.5 * min(sizes)


def test_units_that_are_left_out_are_in_no_sum(units):
    fewer = units.only(np.array([True, False, True, True]))
    assert fewer.after.tolist() == [False, False, True]
    for fine in (False, True):
        found, whole = fewer.sums(TERMS, fine), units.sums(TERMS, fine)
        np.testing.assert_allclose(found.gram, whole.gram[[0, 2, 3]])
        np.testing.assert_allclose(found.power, whole.power[[0, 2, 3]])


@pytest.mark.parametrize("fine", [True, False])
def test_sums_are_those_of_the_unit_s_samples(units, fine):
    sums = units.sums(TERMS, fine)
    for unit in range(4):
        columns = columns_of(units, TERMS, unit, fine)
        current = current_of(units, unit, fine)
        np.testing.assert_allclose(sums.gram[unit], columns.T @ columns, atol=1e-9)
        np.testing.assert_allclose(sums.moment[unit], columns.T @ current, atol=1e-9)
        assert sums.power[unit] == pytest.approx(current @ current)


def test_the_own_fit_finds_the_coefficients_and_leaves_the_noise(units):
    for fine in (True, False):
        coefficients, left = own_fit(units, TERMS, fine)
        np.testing.assert_allclose(coefficients, [COEFFICIENTS] * 4, atol=0.02)
        for unit in range(4):
            columns, current = (of(units, *a) for of, a in (
                (columns_of, (TERMS, unit, fine)), (current_of, (unit, fine)),
            ))  # fmt: skip
            slow = np.linalg.lstsq(columns, current)[0]
            assert left[unit] == pytest.approx(np.mean((current - columns @ slow) ** 2))
        factor = 1 if fine else units.dataset.factor
        np.testing.assert_allclose(left, 0.02**2 / factor, rtol=0.2)


def test_what_is_taken_is_fitted_no_more_and_the_blur_stands_beside(units):
    friction = 2 * TERMS[2].columns(units.track)[:, 0]
    taken = units.track.current_a - friction
    coefficients, left = own_fit(units, TERMS, True, taken)
    np.testing.assert_allclose(coefficients, [[0, 0, 0, 2, 0, 0]] * 4, atol=1e-6)
    # Of a power of 4 nothing is left but its rounding.
    np.testing.assert_allclose(left, 4 * ROUNDING)
    blur = np.random.default_rng(0).normal(size=(units.track.size, 2))
    blurred = with_track(units, blur=blur)
    taken = units.track.current_a - friction - blur @ [3.0, -1.0]
    coefficients, left = own_fit(blurred, TERMS, True, taken)
    np.testing.assert_allclose(coefficients, [[0, 0, 0, 2, 0, 0, 3, -1]] * 4, atol=1e-6)
    assert own_fit(blurred, TERMS)[0].shape == (4, 6)


def test_by_phases_alone_the_joint_angle_s_zero_is_the_middle_of_its_travel():
    q, t = moved("cyclic", 500.0, 16.0)[0], np.arange(8000) / 500.0
    field = 4 * 50.0 * q + 1.0
    current = 1.0 + 0.1 * np.sin(t)
    phases = current[:, None] * np.cos(field[:, None] - np.arange(3) * 2 * np.pi / 3)
    (track,) = read_side([Recording("phases", 500.0, phases_a=phases)], JOINT, cycles=False)
    assert "logged" not in track.channels
    inside = track.position_rad[track.moving]
    assert inside.max() == pytest.approx(-inside.min())
    assert np.ptp(inside) == pytest.approx(np.ptp(q), rel=0.1)


def by_phases(sides, before=3, after=2, logged=False):
    """Sessions side by side as if motion came from phases alone; `sides` of a session, (n,)."""
    tracks = read_side(recordings(before + after, spread=0.0), JOINT, cycles=False)
    for number, track in enumerate(tracks):
        channels = track.channels if logged else track.channels - {"logged"}
        current = track.current_a * sides.get(number, lambda _: 1.0)(track)
        tracks[number] = replace(track, channels=channels, current_a=current)
    return side_by_side(tracks[:before], tracks[before:])


def mirrored(track):
    return -1.0


def one_way(track):
    """Turn one stroke of every cycle, as where a joint rests before and after it."""
    return np.where(track.velocity > 0, -1.0, 1.0)


def since_a_reversal(track):
    slow = np.flatnonzero(~track.moving)
    since = slow[slow > 0.6 * track.size][0]
    return np.where(np.arange(track.size) > since, -1.0, 1.0)


@pytest.mark.parametrize("number", [0, 2, 4])
@pytest.mark.parametrize("side", [mirrored, one_way, since_a_reversal])
def test_what_lies_on_the_other_side_in_a_session_is_turned(number, side):
    right = by_phases({})
    found = turned(by_phases({number: side}), TERMS)
    for grid, truth in (
        (found.dataset.fine, right.dataset.fine),
        (found.dataset.coarse, right.dataset.coarse),
    ):
        wrong = grid.fit & (np.sign(grid.track.current_a) != np.sign(truth.track.current_a))
        assert np.sum(grid.track.current_a[wrong] ** 2) < 1e-4 * np.sum(truth.track.current_a**2)
    wanted, _ = own_fit(right, TERMS)
    np.testing.assert_allclose(own_fit(found, TERMS)[0][number], wanted[number], atol=0.05)


def test_nothing_is_turned_where_sides_agree_or_motion_was_logged():
    for units in (by_phases({}), by_phases({1: one_way}, logged=True)):
        found = turned(units, TERMS)
        np.testing.assert_array_equal(found.track.current_a, units.track.current_a)


def test_more_friction_is_no_other_side():
    units = by_phases({4: lambda track: 1 + np.sign(track.velocity * track.current_a)})
    found = turned(units, TERMS)
    np.testing.assert_array_equal(found.track.current_a, units.track.current_a)


def beside(load, extra=None, before=4, after=2, joint=JOINT):
    """Units of both sides under another axis's load, which the declared effects do not hold."""
    sides = []
    for seed, count, more in ((1, before, None), (2, after, extra)):
        made = recordings(count, more, seed, spread=0.0)
        v = np.gradient(made[0].position_rad)
        asked = load * np.sin(5 * made[0].position_rad) * np.sign(v)
        sides.append([replace(one, current_a=one.current_a + asked) for one in made])
    units = side_by_side(*(read_side(side, joint, cycles=False) for side in sides))
    return with_model(units, learn(units, TERMS))


@pytest.mark.parametrize("joint", [JOINT, Joint()])
def test_what_repeats_with_the_motion_is_taken_out(joint):
    units = beside(0.5, joint=joint)
    found = units.less_repeated(TERMS)
    assert found.after.tolist() == units.after.tolist()
    before, left = (own_fit(one, TERMS)[1] for one in (units, found))
    assert before.min() > 0.05
    # The noise of the current is 0.02 A, on the mean of the units.
    assert left.max() < 0.1 * before.min()
    assert joint is not JOINT or left.mean() < 0.02**2


def test_what_the_target_has_besides_and_a_ripple_stay():
    units = beside(0.5, lambda q, v, a, t: 0.2 * np.sign(v) + 0.1 * np.cos(2 * 50.0 * q))
    found = units.less_repeated(TERMS)
    dry = own_fit(found, TERMS)[0][:, 3]
    assert dry[found.after] - dry[~found.after].mean() == pytest.approx(0.2, abs=0.02)
    residual = fast_residuals(found, TERMS, None)
    wave = np.exp(2j * found.track.machine_angle_rad)
    rows = [rows_of(found, unit, True) for unit in (0, -1)]
    held = [2 * abs(np.mean(wave[one] * residual[one])) for one in rows]
    assert held == pytest.approx([0.0, 0.1], abs=0.02)


def test_what_repeats_follows_the_sensor_s_gain():
    units = beside(0.5)
    late = np.append(units.after, False)
    track = units.track
    louder = with_track(units, current_a=track.current_a * np.where(late[track.group], 1.1, 1.0))
    left = own_fit(louder.less_repeated(TERMS), TERMS, fine=True)[1]
    assert left[units.after].max() < 1.3 * left[~units.after].max()


def test_nothing_is_taken_where_strokes_do_not_repeat_or_nobody_knows_the_place():
    units = beside(0.5)
    phases = with_track(units, channels=frozenset({"phases"}))
    assert phases.less_repeated(TERMS) is phases
    late = np.append(units.after, False)
    track = units.track
    shifted = track.machine_angle_rad + np.where(late[track.group], 40.0, 0.0)
    elsewhere = with_track(units, machine_angle_rad=shifted)
    assert elsewhere.less_repeated(TERMS) is elsewhere


@pytest.mark.parametrize("ratio", [400.0, 3000.0])
def test_a_course_has_no_more_corners_than_a_slow_log_tells(ratio):
    def left(joint):
        return float(np.mean(own_fit(units_of(joint=joint).less_repeated(TERMS), TERMS)[1]))

    # one turn of the motor and seven a sample: corners on each turn would leave ten times as much
    assert left(Joint(ratio, 4)) < 2 * left(JOINT)
