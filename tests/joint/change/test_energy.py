"""How much of the current changed, and how much of it a shift or a ripple holds."""

from types import SimpleNamespace

import numpy as np
import pytest
from sessions import LIBRARY, TERMS, current_of, rows_of, units_of

from opamc_cli.joint.change.energy import comb_energy, energy_of, rest_growth
from opamc_cli.joint.change.lines import strokes
from opamc_cli.joint.change.slow import Shift, shift_power
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.fit.parts import Sums, whole_parts
from opamc_cli.joint.spectra import highest_order

SPRING = Term(LIBRARY["spring"], {})


def compared_of(before, after):
    """Units of one regressor, ones: residuals, and by what their own fit is off the mean."""
    count = len(before) + len(after)
    currents = np.array([5.0 + moved + residual for residual, moved in (*before, *after)])
    parts = whole_parts(np.split(np.arange(currents.size), count))

    def sums(terms, fine=False, taken=None):
        ones = np.ones((count, len(terms)))
        gram = currents.shape[1] * ones[:, :, None] * ones[:, None, :]
        moment, power = currents.sum(axis=1)[:, None] * ones, (currents**2).sum(axis=1)
        return Sums(gram, moment, power, parts, np.zeros(len(terms)))

    return SimpleNamespace(after=np.arange(count) >= len(before), sums=sums)


POPULATION = SimpleNamespace(terms=("one",), mean=np.array([5.0]))


def square(size):
    """Noise of a mean square and no mean."""
    return np.sqrt(size) * np.array([1.0, -1.0, 1.0, -1.0])


def energy(before, after):
    """Of mean squares and offsets of both sides."""
    sides = ([(square(size), moved) for size, moved in side] for side in (before, after))
    return energy_of(compared_of(*sides), POPULATION)


def test_what_the_mean_model_leaves_more_is_slow():
    before = [(1.0, 0.3), (1.0, -0.3), (1.0, 0.0)]
    # Each of three is a third of their mean: 4 / 2 of what they show is what they differ by.
    expected = (4.0 + 1.0) / 2 - (4 / 2) * (0.09 + 0.09) / 3
    found = energy(before, [(1.0, 2.0), (1.0, 1.0)])
    assert found == (pytest.approx(expected), 0.0)
    assert energy(before, [(1.0, 0.1)])[0] == 0.0


def test_what_the_own_fits_leave_more_is_fast_where_it_is_clear():
    before = [(0.9, 0.0), (1.0, 0.0), (1.1, 0.0)]
    # A spread of 0.1 of three and one: 2.5 of its errors are 0.289.
    limit = 2.5 * 0.1 * np.sqrt(1 / 3 + 1)
    assert energy(before, [(1 + 1.01 * limit, 0.0)])[1] == pytest.approx(1.01 * limit)
    assert energy(before, [(1 + 0.99 * limit, 0.0)])[1] == 0.0
    # More units make it surer: their median counts.
    three = [(5.0, 0.0), (1.25, 0.0), (1.2, 0.0)]
    assert energy(before, three)[1] == pytest.approx(0.25)


def test_sessions_that_agree_by_chance_differ_by_a_twentieth():
    before = [(2.0, 0.0)] * 3
    limit = 2.5 * 0.05 * 2 * np.sqrt(1 / 3 + 1)
    assert energy(before, [(2 + 0.99 * limit, 0.0)])[1] == 0.0
    assert energy(before, [(2 + 1.01 * limit, 0.0)])[1] > 0.0


def test_the_rest_grows_by_its_share_of_the_current():
    units = compared_of([(square(1.0), 0.0)] * 2, [(square(3.0), 0.0)])
    # 25 and 1, 25 and 3 are the mean squares of the constant and the rest.
    assert rest_growth(units, POPULATION, None) == pytest.approx(3 / (25 + 3) * 26)


def stiff(q, v, a, t):
    return 0.5 * q


def test_a_shift_that_is_taken_away_leaves_nothing_slow():
    units = units_of(stiff, spread=0.0)
    mean = np.array([0.2, 1.0, 0.4, 0.5, 0.3, 0.1])
    population = SimpleNamespace(terms=TERMS, mean=mean)
    shift = Shift((SPRING,), np.array([0.5, 0.0]), 0.0, 2)
    position = units.dataset.coarse.track.position_rad
    angles = [position[rows_of(units, unit)] for unit in range(4, 7)]
    power = np.mean((0.5 * np.concatenate(angles)) ** 2)
    before = energy_of(units, population)
    assert sum(before) == pytest.approx(power, rel=0.05)
    assert sum(energy_of(units, population, shift)) < 0.02 * power
    assert shift_power(units, shift) == pytest.approx(power, rel=1e-2)
    assert rest_growth(units, population, None) > 2
    assert rest_growth(units, population, shift) == pytest.approx(1.0, abs=0.3)


def combed(units, order, size, noise=0.01, harmonic=1, everywhere=False):
    rng = np.random.default_rng(0)
    track = units.track
    new = np.append(units.after | everywhere, False)[track.group]
    wave = np.cos(harmonic * order * track.machine_angle_rad + 1.0)
    residual = noise * rng.normal(size=track.size) + new * size * wave
    return np.where(units.dataset.fine.fit, residual, 0.0)


@pytest.fixture(scope="module")
def units():
    return units_of(before=2, after=2, rate=500.0)


def slow_comb(units, residual, orders):
    """Fit straight pieces between six places of every stroke to both phases of each order."""
    totals = np.zeros(units.after.size)
    fit = units.dataset.fine.fit
    for start, stop in strokes(units.track, fit):
        rows = start + np.flatnonzero(fit[start:stop])
        angle, values = units.track.machine_angle_rad[rows], residual[rows]
        place = 5 * (angle - angle.min()) / np.ptp(angle)
        weights = np.clip(1 - np.abs(place[:, None] - np.arange(6)), 0, 1)
        for order in orders:
            waves = [np.cos(order * angle), np.sin(order * angle)]
            columns = np.concatenate([weights * wave[:, None] for wave in waves], axis=1)
            left = values - columns @ np.linalg.lstsq(columns, values)[0]
            totals[units.track.group[start]] += values @ values - left @ left
    return totals / [current_of(units, unit, True).size for unit in range(units.after.size)]


@pytest.mark.parametrize("harmonic", [1, 4])
def test_a_comb_holds_the_power_of_a_ripple_and_of_its_harmonics(units, harmonic):
    residual = combed(units, 3.0, 0.2, harmonic=harmonic)
    found = comb_energy(units, residual, 3.0)
    slow = slow_comb(units, residual, [3, 6, 9, 12])
    assert found == pytest.approx(np.median(slow[2:]) - np.median(slow[:2]))
    assert found == pytest.approx(0.2**2 / 2, rel=0.1)


def test_a_comb_holds_little_of_another_line_and_no_noise(units):
    assert comb_energy(units, combed(units, 3.0, 0.2, harmonic=1.5), 3.0) < 0.2 * 0.2**2 / 2
    assert comb_energy(units, combed(units, 3.0, 0.0), 3.0) < 0.1 * 0.01**2
    # What the baseline has as well is no growth.
    assert comb_energy(units, combed(units, 3.0, 0.2, everywhere=True), 3.0) < 0.02 * 0.2**2 / 2


def test_harmonics_that_fold_are_no_part_of_a_comb(units):
    top = highest_order(units.track)
    assert comb_energy(units, combed(units, top, 0.2), 1.01 * top) == 0.0
