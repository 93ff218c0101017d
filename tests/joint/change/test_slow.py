"""Slow effects by generalised least squares, against the same with the whole covariance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import f as fisher
from sessions import (
    COEFFICIENTS,
    LIBRARY,
    TERMS,
    columns_of,
    current_of,
    units_of,
    with_coarse_current,
)

from opamc_cli.joint.change.slow import (
    Shift,
    estimates,
    learn,
    left_by,
    shift_current,
    shifts,
    with_model,
)
from opamc_cli.joint.change.units import own_fit
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.track import block_mean

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
    return learn(units, TERMS)


def estimates_of(units, population, *terms):
    return estimates(units.sums((*population.terms, *terms)), population)


def test_a_population_has_the_mean_and_the_noise_of_its_units(units, population):
    coefficients, left = own_fit(units, TERMS)
    np.testing.assert_allclose(population.mean, coefficients[:4].mean(axis=0))
    np.testing.assert_allclose(population.mean, COEFFICIENTS, atol=0.02)
    assert population.variance == np.median(left[:4])
    power = np.mean([np.mean(current_of(units, unit) ** 2) for unit in range(4)])
    assert population.power == pytest.approx(power)
    assert (population.terms, population.between) == (TERMS, 0.0)
    assert learn(units, TERMS, 0.01).between == 0.01


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.0, 1.0), (0.7, 1.0, 1.1, 1.4)])
def test_healthy_sessions_are_expected_to_differ_by_friction_and_gain(gains):
    units = with_coarse_current(
        units_of(before=4, after=0),
        lambda track, unit: np.array([*gains, 1.0])[unit] * track.current_a,
    )
    found = learn(units, TERMS)
    sample = own_fit(units, TERMS)[0]
    centre = np.median(sample, axis=0)
    sizes = np.mean([np.mean(columns_of(units, TERMS, k) ** 2, axis=0) for k in range(4)], axis=0)
    own = FRICTION * centre * [0, 0, 0, 1, 1, 1]
    prior = np.diag(own**2 + COMMON**2 * found.power / sizes) + GAIN**2 * np.outer(centre, centre)
    ratio = max(np.median(sample.var(axis=0, ddof=1) / np.diag(prior)), 1.0)
    assert (ratio > 1) == (gains[0] < 1)
    # What differs more than is expected is friction.
    prior[3:5, 3:5] *= ratio
    expected = (3 * np.cov(sample.T) + BORROWED * prior) / (3 + BORROWED)
    np.testing.assert_allclose(found.covariance, expected)


def test_a_model_puts_its_load_and_its_current_on_both_grids(units, population):
    modelled = with_model(units, population)
    columns = np.concatenate([term.columns(units.track) for term in TERMS], axis=1)
    np.testing.assert_allclose(modelled.track.model_a, columns @ population.mean)
    np.testing.assert_allclose(modelled.track.load_a, columns[:, :3] @ population.mean[:3])
    means = block_mean(modelled.track.model_a, units.track.bounds, units.dataset.factor)
    np.testing.assert_allclose(modelled.dataset.coarse.track.model_a, means)


def test_an_estimate_is_that_of_the_whole_covariance(units, population):
    found = zip(*estimates_of(units, population, SPRING, QUADRATIC), strict=True)
    for unit, (estimate, information) in enumerate(found):
        declared = columns_of(units, TERMS, unit)
        extra = columns_of(units, (SPRING, QUADRATIC), unit)
        noise = population.variance * np.eye(declared.shape[0])
        inverse = np.linalg.inv(noise + declared @ population.covariance @ declared.T)
        rest = current_of(units, unit) - declared @ population.mean
        gram = extra.T @ inverse @ extra
        slow = np.linalg.pinv(gram, rcond=1e-9) @ extra.T @ inverse @ rest
        np.testing.assert_allclose(information, gram, rtol=1e-6, atol=1e-6 * np.abs(gram).max())
        np.testing.assert_allclose(estimate, slow, rtol=1e-4, atol=1e-6)


def test_what_is_left_is_left_by_the_mean_and_the_shift(units, population):
    shift = Shift((SPRING,), np.array([0.2, -0.1]), 0.0, 2)
    plain, less = left_by(units, population), left_by(units, population, shift)
    for unit in range(7):
        rest = current_of(units, unit) - columns_of(units, TERMS, unit) @ population.mean
        assert plain[unit] == pytest.approx(np.mean(rest**2))
        rest = rest - columns_of(units, (SPRING,), unit) @ shift.coefficients
        assert less[unit] == pytest.approx(np.mean(rest**2))


def test_a_shift_is_the_difference_of_the_means_and_the_surest_comes_first(units, population):
    first, second = shifts(units, population, (), [QUADRATIC, SPRING])
    assert first.terms == (SPRING,)
    assert second.terms == (QUADRATIC,)
    assert first.p_value < 1e-4 < second.p_value
    # A spring is its angle and an offset.
    assert first.coefficients[0] == pytest.approx(0.2, abs=0.03)
    sample = estimates_of(units, population, SPRING)[0]
    difference = sample[4:].mean(axis=0) - sample[:4].mean(axis=0)
    np.testing.assert_allclose(first.coefficients, difference)
    assert first.width == first.coefficients.size == SPRING.columns(units.track).shape[1]


def test_beside_what_was_chosen_only_the_last_term_is_judged(units, population):
    (both,) = shifts(units, population, (SPRING,), [QUADRATIC])
    assert both.terms == (SPRING, QUADRATIC)
    assert both.width == 1
    assert both.p_value > 0.01
    assert both.last.terms == (QUADRATIC,)
    assert both.last.coefficients.tolist() == both.coefficients[2:].tolist()
    (other,) = shifts(units, population, (QUADRATIC,), [SPRING])
    assert other.p_value < 1e-4


def test_a_unit_that_never_comes_near_a_bump_has_no_coefficient_of_it(units, population):
    sums = units.sums((*population.terms, SPRING))
    near, information = estimates(sums, population)
    faint = np.ones(sums.gram.shape[-1])
    faint[-1] = 1e-160  # its square is no normal number any more, and has no finite inverse
    gram, moment = sums.gram.copy(), sums.moment.copy()
    gram[2] *= np.outer(faint, faint)
    moment[2] *= faint
    far, known = estimates(replace(sums, gram=gram, moment=moment), population)
    assert (far[2, -1], known[2, -1, -1]) == (0.0, 0.0)
    others = np.arange(len(far)) != 2
    np.testing.assert_array_equal(far[others], near[others])
    np.testing.assert_array_equal(known[others], information[others])


def slow_shift(units, population, term, inflation):
    """Do by hand what a single candidate costs: means, spread of few, and a probability."""
    sample, information = estimates_of(units, population, term)
    mean = information[:4].mean(axis=0)
    expected = (3 * np.cov(sample[:4].T) + BORROWED * inflation * np.linalg.pinv(mean)) / 7
    expected *= 1 / 4 + 1 / 3
    sizes = [np.mean(columns_of(units, (term,), unit) ** 2, axis=0) for unit in range(7)]
    expected += np.diag(2 * population.between * population.power / np.mean(sizes, axis=0))
    shift = sample[4:].mean(axis=0) - sample[:4].mean(axis=0)
    size = shift.size
    square, freedom = shift @ np.linalg.inv(expected) @ shift, 3 + BORROWED - size + 1
    p_value = fisher.sf(square * freedom / ((3 + BORROWED) * size), size, freedom)
    centred = sample[:4] - sample[:4].mean(axis=0)
    ratio = np.einsum("ni,ij,nj->", centred, mean, centred) / (3 * size)
    return p_value, ratio


def wandering(units, wander):
    """Let what no declared effect holds differ from unit to unit."""
    sizes = wander * np.append(np.random.default_rng(3).normal(size=units.after.size), 0.0)
    return with_coarse_current(
        units, lambda track, unit: track.current_a + sizes[unit] * track.position_rad
    )


@pytest.mark.parametrize("between", [0.0, 4e-4])
@pytest.mark.parametrize("wander", [0.0, 0.2])
def test_how_units_differ_beyond_noise_widens_what_is_expected(between, wander):
    units = wandering(units_of(lifted), wander)
    population = learn(units, TERMS, between)
    ratio = slow_shift(units, population, SPRING, 1.0)[1]
    assert (ratio > 1) == (wander > 0)
    (found,) = shifts(units, population, (), [SPRING])
    p_value, _ = slow_shift(units, population, SPRING, max(ratio, 1.0))
    assert found.p_value == pytest.approx(p_value, rel=1e-4)


def test_declared_friction_is_not_expected_to_differ_by_what_no_effect_holds():
    units = wandering(units_of(lifted), 0.2)
    population = learn(units, TERMS)
    both = [SPRING, Term(LIBRARY["viscous"], {}), QUADRATIC]
    inflation = np.median([slow_shift(units, population, term, 1.0)[1] for term in both])
    assert inflation > 1
    found = {shift.terms[-1].key: shift.p_value for shift in shifts(units, population, (), both)}
    for term, expected in zip(both, (inflation, 1.0, inflation), strict=True):
        p_value = slow_shift(units, population, term, expected)[0]
        assert found[term.key] == pytest.approx(p_value, rel=1e-4)


@pytest.mark.parametrize("fine", [True, False])
def test_a_shift_acts_in_the_target_alone(units, fine):
    shift = Shift((SPRING,), np.array([0.2, -0.1]), 0.0, 2)
    assert shift_current(units, None, fine) is None
    current = shift_current(units, shift, fine)
    track = units.dataset.grid_of(fine).track
    assert not current[track.group < 4].any()
    own = SPRING.columns(track) @ shift.coefficients
    np.testing.assert_allclose(current[track.group >= 4], own[track.group >= 4])
