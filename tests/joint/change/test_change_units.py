"""Units of comparison: their samples, their own fit, and the phases that are followed."""

from dataclasses import replace

import numpy as np
import pytest
from closing import moved
from sessions import COEFFICIENTS, DECLARED, JOINT, LIBRARY, RATE, TERMS, recordings, units_of

from opamc_cli.joint.change.units import followed, own_fit, read_side, usable_terms
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.track import block_mean, coarsen


@pytest.fixture(scope="module")
def units():
    return units_of(before=3, after=1, spread=0.0)


def factor_of(unit):
    return round(unit.fine.rate_hz / unit.coarse.rate_hz)


def test_every_recording_that_moves_is_a_unit(units):
    assert [unit.after for unit in units] == [False, False, False, True]
    still = recordings(1)[0]
    rest = Recording("rest", RATE, current_a=still.current_a, position_rad=0 * still.position_rad)
    assert len(read_side([still, rest], JOINT, after=True, cycles=False)) == 1
    assert read_side([rest], JOINT, after=True, cycles=False) == []


def test_a_unit_s_samples_move_and_are_clear(units):
    unit = units[0]
    assert np.array_equal(unit.fine_rows, unit.fine.moving & unit.fine.clear)
    # A coarse sample counts where all of its samples move.
    whole = block_mean(unit.fine.moving.astype(float), unit.fine.bounds, factor_of(unit)) == 1
    assert np.array_equal(unit.coarse_rows, whole & unit.coarse.moving)
    assert unit.coarse.size == unit.fine.size // factor_of(unit)
    np.testing.assert_array_equal(unit.current_a(fine=True), unit.fine.current_a[unit.fine_rows])
    np.testing.assert_array_equal(unit.current_a(), unit.coarse.current_a[unit.coarse_rows])


@pytest.mark.parametrize("rate", [100.0, 450.0])
def test_the_coarse_grid_has_a_hundred_hertz_or_what_smoothing_leaves(rate):
    (unit,) = read_side(recordings(1, rate=rate), JOINT, after=False, cycles=False)
    width = 1 / np.sum(unit.fine.kernel**2)
    factor = max(int(rate / 100.0), int(0.8 * width), 1)
    assert unit.coarse.rate_hz == rate / factor


def test_cycles_of_one_recording_are_units_that_share_no_sample():
    (whole,) = read_side(recordings(1), JOINT, after=False, cycles=False)
    cycles = read_side(recordings(1), JOINT, after=False, cycles=True)
    assert len(cycles) > 3
    rows = np.sum([unit.fine_rows for unit in cycles], axis=0)
    assert rows.max() == 1
    assert not np.any(rows.astype(bool) & ~whole.fine_rows)
    # Each is one turn of the program, or two.
    sizes = [np.count_nonzero(unit.fine_rows) for unit in cycles]
    assert max(sizes) < 1.5 * min(sizes)


def test_regressors_are_those_of_the_unit_s_samples(units):
    unit = units[0]
    sine = unit.columns(Term(LIBRARY["gravity"], {}))[:, 0]
    np.testing.assert_allclose(sine, np.sin(unit.coarse.position_rad[unit.coarse_rows]), atol=0.02)
    both = unit.stacked(TERMS, fine=True)
    assert both.shape == (np.count_nonzero(unit.fine_rows), COEFFICIENTS.size)
    np.testing.assert_array_equal(both[:, 1], np.sin(unit.fine.position_rad[unit.fine_rows]))
    # Two guesses of one effect are two terms.
    slow, fast = (
        unit.columns(Term(LIBRARY["stribeck"], {"stribeck_speed": speed, "exponent": 2.0}))
        for speed in (0.1, 0.5)
    )
    assert not np.allclose(slow, fast)


def test_the_own_fit_finds_the_coefficients_and_leaves_the_noise(units):
    for fine in (True, False):
        coefficients, residual = own_fit(units[0], TERMS, fine)
        np.testing.assert_allclose(coefficients, COEFFICIENTS, atol=0.02)
        assert abs(residual.mean()) < 1e-3
        if fine:
            assert np.std(residual) == pytest.approx(0.02, rel=0.1)
        else:
            assert np.std(residual) < 0.02 / np.sqrt(factor_of(units[0]))


def test_another_current_is_fitted_instead_and_the_blur_beside_it(units):
    unit = units[0]
    columns = unit.stacked(TERMS, fine=True)
    coefficients, residual = own_fit(unit, TERMS, True, current=2 * columns[:, 3])
    np.testing.assert_allclose(coefficients[:6], [0, 0, 0, 2, 0, 0], atol=1e-6)
    assert np.abs(residual).max() < 1e-6
    blur = np.random.default_rng(0).normal(size=(unit.fine.size, 2))
    blurred = replace(unit, fine=replace(unit.fine, blur=blur))
    current = columns[:, 3] + blur[unit.fine_rows] @ [3.0, -1.0]
    coefficients, residual = own_fit(blurred, TERMS, True, current=current)
    np.testing.assert_allclose(coefficients, [0, 0, 0, 1, 0, 0, 3, -1], atol=1e-6)
    assert own_fit(blurred, TERMS)[0].size == 6


def test_a_model_puts_its_load_and_its_current_on_both_tracks(units):
    unit = units[0].with_model(TERMS, COEFFICIENTS)
    columns = np.concatenate([term.columns(unit.fine) for term in TERMS], axis=1)
    np.testing.assert_allclose(unit.fine.model_a, columns @ COEFFICIENTS)
    np.testing.assert_allclose(unit.fine.load_a, columns[:, :3] @ COEFFICIENTS[:3])
    means = block_mean(unit.fine.model_a, unit.fine.bounds, factor_of(unit))
    np.testing.assert_allclose(unit.coarse.model_a, means)


def test_a_term_is_usable_where_every_unit_can_show_it(units):
    effects = [LIBRARY[name] for name in (*DECLARED, "thermal_viscous")]
    assert usable_terms(units, effects) == TERMS
    warm = [
        replace(unit, fine=replace(unit.fine, channels=unit.fine.channels | {"temperature"}))
        for unit in units
    ]
    assert len(usable_terms(warm, effects)) == len(TERMS) + 1
    assert usable_terms([*warm, units[0]], effects) == TERMS


def test_by_phases_alone_the_joint_angle_s_zero_is_the_middle_of_its_travel():
    q, t = moved("cyclic", 500.0, 16.0)[0], np.arange(8000) / 500.0
    field = 4 * 50.0 * q + 1.0
    current = 1.0 + 0.1 * np.sin(t)
    phases = current[:, None] * np.cos(field[:, None] - np.arange(3) * 2 * np.pi / 3)
    (unit,) = read_side([Recording("phases", 500.0, phases_a=phases)], JOINT, False, cycles=False)
    assert "logged" not in unit.fine.channels
    inside = unit.fine.position_rad[unit.fine.moving]
    assert inside.max() == pytest.approx(-inside.min())
    assert np.ptp(inside) == pytest.approx(np.ptp(q), rel=0.1)


def by_phases(unit, current=None):
    """Return a unit as if its motion came from the phases alone."""
    fine = replace(unit.fine, channels=unit.fine.channels - {"logged"})
    if current is not None:
        fine = replace(fine, current_a=current)
    return replace(unit, fine=fine, coarse=coarsen(fine, factor_of(unit)))


def test_where_motion_was_logged_nothing_is_left_out(units):
    fine = replace(units[1].fine, current_a=-units[1].fine.current_a)
    before, after = [units[0], replace(units[1], fine=fine)], [units[3]]
    assert followed(before, after, TERMS) == (before, after)
    assert followed([], after, TERMS) == ([], after)


def test_what_fits_badly_is_left_out(units):
    noise = np.random.default_rng(0).normal(size=units[0].fine.size)
    wrong = by_phases(units[2], units[2].fine.current_a + 0.5 * noise)
    right = [by_phases(unit) for unit in units[:2]]
    late = by_phases(units[3])
    bad = by_phases(units[3], units[3].fine.current_a + 0.5 * noise)
    assert followed([*right, wrong], [late, bad], TERMS) == (right, [late])
    # A changed joint may leave more everywhere: then that is usual.
    assert followed(right, [bad], TERMS) == (right, [bad])
    assert followed(right, [], TERMS) == (right, [])
