"""Small samples compared: Student's t with a variance that is drawn to what is known."""

import numpy as np
import pytest
from scipy.stats import f as fisher
from scipy.stats import t as student

from opamc_cli.decision.significance.moderated import moderated_covariance, moderated_t, shift_p

BORROWED = 4.0


def test_a_variance_of_few_is_drawn_towards_that_of_all():
    rng = np.random.default_rng(1)
    before, after = rng.normal(size=(4, 2000)), rng.normal(size=(3, 2000))
    _, p_values = moderated_t(before, after)
    assert np.mean(p_values < 0.05) == pytest.approx(0.05, abs=0.02)
    before[:, 0] = 0.0  # four that agree by chance are no proof of a difference
    after[:, 0] = 0.5
    assert moderated_t(before, after)[1][0] > 0.01


@pytest.mark.parametrize("between", [0.0, 0.3])
def test_a_t_by_hand(between):
    # Variances 1, 4 and 9 of three units each are drawn towards 4 with twice their weight.
    before = np.array([[-1.0, -2.0, -3.0], [0.0, 0.0, 0.0], [1.0, 2.0, 3.0]])
    after = np.array([[1.0, 1.0, -1.0], [3.0, 1.0, -1.0]])
    t_values, p_values = moderated_t(before + 7, after + 7, between)
    for k, (variance, mean) in enumerate(((1.0, 2.0), (4.0, 1.0), (9.0, -1.0))):
        drawn = (2 * variance + 4 * 4.0) / 6
        t_value = mean / np.sqrt(drawn * (1 / 3 + 1 / 2) + 2 * between)
        assert t_values[k] == pytest.approx(t_value)
        assert p_values[k] == pytest.approx(student.sf(t_value, 6))


def test_features_that_all_agree_have_a_huge_t_and_no_nan():
    t_values, p_values = moderated_t(np.zeros((3, 2)), np.array([[0.0, 1.0]]))
    assert t_values[0] == 0
    assert p_values[0] == 0.5
    assert p_values[1] < 1e-30


def test_a_covariance_is_drawn_towards_the_prior_by_four_degrees_of_freedom():
    sample = np.random.default_rng(0).normal(size=(7, 3)) @ np.diag([1.0, 2.0, 3.0]) + 5
    prior = np.diag([3.0, 1.0, 2.0])
    expected = (6 * np.cov(sample.T) + BORROWED * prior) / (6 + BORROWED)
    np.testing.assert_allclose(moderated_covariance(sample, prior), expected)
    # Of one unit there is nothing but the prior.
    np.testing.assert_allclose(moderated_covariance(sample[:1], prior), prior)


@pytest.mark.parametrize("units", [2, 5, 30])
def test_in_one_direction_a_shift_is_as_probable_as_a_two_sided_t(units):
    p_value = shift_p(np.array([1.5]), np.array([[0.49]]), units)
    assert p_value == pytest.approx(2 * student.sf(1.5 / 0.7, units - 1 + BORROWED))


@pytest.mark.parametrize("size", [2, 3])
def test_in_several_directions_it_is_hotelling_s(size):
    rng = np.random.default_rng(size)
    mixed = rng.normal(size=(size, size))
    covariance, shift = mixed @ mixed.T + np.eye(size), rng.normal(size=size)
    square, n = float(shift @ np.linalg.inv(covariance) @ shift), 6 - 1 + BORROWED
    p_value = fisher.sf(square * (n - size + 1) / (n * size), size, n - size + 1)
    assert shift_p(shift, covariance, 6) == pytest.approx(p_value)
    # More directions than units leave one degree of freedom at least.
    wide = shift_p(np.ones(12), np.eye(12), 2)
    assert wide == pytest.approx(fisher.sf(1 / 5, 12, 1))


def test_a_direction_without_spread_or_shift_counts_for_nothing():
    flat = shift_p(np.array([1.0, 0.0]), np.diag([1.0, 0.0]), 4)
    assert 0 < flat < 1
    assert shift_p(np.zeros(2), np.eye(2), 4) == 1.0
