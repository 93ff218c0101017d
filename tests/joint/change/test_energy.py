"""How much of the current changed, and how much of it a shift or a ripple holds."""

from types import SimpleNamespace

import numpy as np
import pytest
from sessions import LIBRARY, current_of, units_of

from opamc_cli.joint.change.energy import comb_energy, rest_growth
from opamc_cli.joint.change.lines import strokes
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


def test_the_rest_grows_by_its_share_of_the_current():
    units = compared_of([(square(1.0), 0.0)] * 2, [(square(3.0), 0.0)])
    # 25 and 1, 25 and 3 are the mean squares of the constant and the rest.
    assert rest_growth(units, POPULATION, None) == pytest.approx(3 / (25 + 3) * 26)


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
