"""Slow effects by generalised least squares, against the same with the whole covariance."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import f as fisher
from sessions import COEFFICIENTS, LIBRARY, TERMS, units_of

from opamc_cli.joint.change.slow import Shift, learn, prepared, shifts, slow_candidates, without
from opamc_cli.joint.change.units import own_fit
from opamc_cli.joint.fit.model import Term

SPRING = Term(LIBRARY["spring"], {})
QUADRATIC = Term(LIBRARY["quadratic_friction"], {})
GAIN, FRICTION, COMMON = 0.02, 0.05, 0.005
BORROWED = 4


def lifted(q, v, a, t):
    return 0.2 * q


@pytest.fixture(scope="module")
def units():
    return units_of(lifted)


@pytest.fixture(scope="module")
def population(units):
    return learn(units[:4], TERMS)


def test_a_population_has_the_mean_and_the_noise_of_its_units(units, population):
    fits = [own_fit(unit, TERMS) for unit in units[:4]]
    np.testing.assert_allclose(population.mean, np.mean([found for found, _ in fits], axis=0))
    np.testing.assert_allclose(population.mean, COEFFICIENTS, atol=0.02)
    assert population.variance == np.median([np.mean(residual**2) for _, residual in fits])
    power = np.mean([np.mean(unit.current_a() ** 2) for unit in units[:4]])
    assert population.power == pytest.approx(power)
    assert (population.terms, population.between) == (TERMS, 0.0)
    assert learn(units[:4], TERMS, 0.01).between == 0.01


def scaled(unit, gain):
    return replace(unit, coarse=replace(unit.coarse, current_a=gain * unit.coarse.current_a))


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.0, 1.0), (0.7, 1.0, 1.1, 1.4)])
def test_healthy_sessions_are_expected_to_differ_by_friction_and_gain(gains):
    units = units_of(before=4, after=0)
    units = [scaled(unit, gain) for unit, gain in zip(units, gains, strict=True)]
    found = learn(units, TERMS)
    sample = np.stack([own_fit(unit, TERMS)[0] for unit in units])
    centre = np.median(sample, axis=0)
    sizes = np.mean([np.mean(unit.stacked(TERMS) ** 2, axis=0) for unit in units], axis=0)
    own = FRICTION * centre * [0, 0, 0, 1, 1, 1]
    prior = np.diag(own**2 + COMMON**2 * found.power / sizes) + GAIN**2 * np.outer(centre, centre)
    ratio = max(np.median(sample.var(axis=0, ddof=1) / np.diag(prior)), 1.0)
    assert (ratio > 1) == (gains[0] < 1)
    # What differs more than is expected is friction.
    prior[3:5, 3:5] *= ratio
    expected = (3 * np.cov(sample.T) + BORROWED * prior) / (3 + BORROWED)
    np.testing.assert_allclose(found.covariance, expected)


def test_an_estimate_is_that_of_the_whole_covariance(units, population):
    for one in prepared(units, population):
        declared, extra = one.unit.stacked(TERMS), one.unit.stacked((SPRING, QUADRATIC))
        noise = population.variance * np.eye(declared.shape[0])
        inverse = np.linalg.inv(noise + declared @ population.covariance @ declared.T)
        rest = one.unit.current_a() - declared @ population.mean
        gram = extra.T @ inverse @ extra
        slow = np.linalg.pinv(gram, rcond=1e-9) @ extra.T @ inverse @ rest
        estimate, information = one.estimate(extra, population.variance)
        np.testing.assert_allclose(information, gram, rtol=1e-6, atol=1e-6 * np.abs(gram).max())
        np.testing.assert_allclose(estimate, slow, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(one.residual, rest)


def test_a_shift_is_the_difference_of_the_means_and_the_surest_comes_first(units, population):
    ready = prepared(units, population)
    first, second = shifts(ready, population, (), [QUADRATIC, SPRING])
    assert first.terms == (SPRING,)
    assert second.terms == (QUADRATIC,)
    assert first.p_value < 1e-4 < second.p_value
    # A spring is its angle and an offset.
    assert first.coefficients[0] == pytest.approx(0.2, abs=0.03)
    pairs = [one.estimate(one.unit.stacked((SPRING,)), population.variance)[0] for one in ready]
    difference = np.mean(pairs[4:], axis=0) - np.mean(pairs[:4], axis=0)
    np.testing.assert_allclose(first.coefficients, difference)
    assert first.width == first.coefficients.size == SPRING.columns(units[0].fine).shape[1]


def test_beside_what_was_chosen_only_the_last_term_is_judged(units, population):
    ready = prepared(units, population)
    (both,) = shifts(ready, population, (SPRING,), [QUADRATIC])
    assert both.terms == (SPRING, QUADRATIC)
    assert both.width == 1
    assert both.p_value > 0.01
    (other,) = shifts(ready, population, (QUADRATIC,), [SPRING])
    assert other.p_value < 1e-4


def slow_shift(ready, population, term, inflation):
    """Do by hand what a single candidate costs: means, spread of few, and a probability."""
    columns = [one.unit.columns(term) for one in ready]
    pairs = [
        one.estimate(part, population.variance) for one, part in zip(ready, columns, strict=True)
    ]
    sample = np.stack([estimate for estimate, _ in pairs[:4]])
    prior = inflation * np.linalg.pinv(np.mean([gram for _, gram in pairs[:4]], axis=0))
    expected = (3 * np.cov(sample.T) + BORROWED * prior) / (3 + BORROWED) * (1 / 4 + 1 / 3)
    sizes = np.mean([np.mean(part**2, axis=0) for part in columns], axis=0)
    expected += np.diag(2 * population.between * population.power / sizes)
    shift = np.mean([e for e, _ in pairs[4:]], axis=0) - sample.mean(axis=0)
    size = shift.size
    square, freedom = shift @ np.linalg.inv(expected) @ shift, 3 + BORROWED - size + 1
    p_value = fisher.sf(square * freedom / ((3 + BORROWED) * size), size, freedom)
    centred = sample - sample.mean(axis=0)
    information = np.mean([gram for _, gram in pairs[:4]], axis=0)
    ratio = np.einsum("ni,ij,nj->", centred, information, centred) / (3 * size)
    return expected, p_value, ratio


def wandering(unit, size):
    current = unit.coarse.current_a + size * unit.coarse.position_rad
    return replace(unit, coarse=replace(unit.coarse, current_a=current))


@pytest.mark.parametrize("between", [0.0, 4e-4])
@pytest.mark.parametrize("wander", [0.0, 0.2])
def test_how_units_differ_beyond_noise_widens_what_is_expected(between, wander):
    rng = np.random.default_rng(3)
    units = units_of(lifted)
    # What no declared effect holds differs from unit to unit.
    sizes = wander * rng.normal(size=len(units))
    units = [wandering(unit, size) for unit, size in zip(units, sizes, strict=True)]
    population = learn(units[:4], TERMS, between)
    ready = prepared(units, population)
    ratio = slow_shift(ready, population, SPRING, 1.0)[2]
    assert (ratio > 1) == (wander > 0)
    (found,) = shifts(ready, population, (), [SPRING])
    covariance, p_value, _ = slow_shift(ready, population, SPRING, max(ratio, 1.0))
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-5)
    assert found.p_value == pytest.approx(p_value, rel=1e-4)


def test_declared_friction_is_not_expected_to_differ_by_what_no_effect_holds():
    units = units_of(lifted)
    sizes = 0.2 * np.random.default_rng(3).normal(size=len(units))
    units = [wandering(unit, size) for unit, size in zip(units, sizes, strict=True)]
    population = learn(units[:4], TERMS)
    ready = prepared(units, population)
    both = [SPRING, Term(LIBRARY["viscous"], {}), QUADRATIC]
    inflation = np.median([slow_shift(ready, population, term, 1.0)[2] for term in both])
    assert inflation > 1
    found = {shift.terms[-1].key: shift.covariance for shift in shifts(ready, population, (), both)}
    for term, expected in zip(both, (inflation, 1.0, inflation), strict=True):
        covariance = slow_shift(ready, population, term, expected)[0]
        np.testing.assert_allclose(found[term.key], covariance, rtol=1e-5)


def test_what_too_few_samples_or_no_number_carries_is_no_candidate(units, population):
    ready = prepared(units, population)

    def carried(rows, value=1.0):
        def columns(term, fine=False):
            made = np.zeros((np.count_nonzero(units[0].coarse_rows), 1))
            made[:rows] = value
            return made

        return columns

    def found(rows, value=1.0):
        odd = SimpleNamespace(effect=SimpleNamespace(name="odd"))
        fake = [replace_unit(one, carried(rows, value)) for one in ready]
        return len(shifts(fake, population, (), [odd]))

    assert [found(rows) for rows in (0, 10, 11, 500)] == [0, 0, 1, 1]
    assert found(500, np.inf) == 0


def replace_unit(one, columns):
    unit = SimpleNamespace(
        after=one.unit.after, columns=columns, stacked=lambda terms, fine=False: columns(terms[-1])
    )
    return replace(one, unit=unit)


def test_candidates_are_all_guesses_of_what_every_unit_can_show(units):
    effects = [LIBRARY[name] for name in ("spring", "stribeck", "thermal_viscous")]
    found = slow_candidates(units, effects)
    track = units[-1].coarse
    guesses = LIBRARY["stribeck"].guesses(track, np.zeros(track.size))
    assert [term.parameters for term in found] == [{}, *guesses]
    assert {term.effect.name for term in found} == {"spring", "stribeck"}


def test_a_shift_is_taken_from_the_target_alone(units):
    shift = Shift((SPRING,), np.array([0.2, -0.1]), np.eye(2), 0.0, 2)
    for unit in (units[0], units[-1]):
        np.testing.assert_array_equal(without(unit, None), unit.current_a(fine=True))
    np.testing.assert_array_equal(without(units[0], shift), units[0].current_a(fine=True))
    own = units[-1].stacked((SPRING,), fine=True) @ [0.2, -0.1]
    np.testing.assert_allclose(
        without(units[-1], shift), units[-1].fine.current_a[units[-1].fine_rows] - own
    )
