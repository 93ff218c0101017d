"""Imitations: what betrays them, and the smooth test against its slow twin."""

import numpy as np
import pytest
from closing import close_on

from opamc_cli.joint.form import COST, cosines, misfits
from opamc_cli.joint.view import prepare


def slow_excess(view, basis):
    """Largest fall of the sum of squares by the first cosines, each less its cost."""
    model = view.span
    rest = view.values - model @ np.linalg.lstsq(model, view.values, rcond=None)[0]
    variance = np.sum(rest**2) / (rest.size - model.shape[1])
    best = -COST
    for count in range(1, basis.shape[1] + 1):
        design = np.concatenate([model, basis[:, :count]], axis=1)
        fitted = design @ np.linalg.lstsq(design, view.values, rcond=1e-7)[0]
        new = np.linalg.matrix_rank(design, tol=1e-4) - model.shape[1]
        fall = (np.sum(rest**2) - np.sum((view.values - fitted) ** 2)) / variance
        best = max(best, fall - COST * new)
    return best


def test_smooth_test_equals_least_squares_with_more_and_more_cosines():
    _, loop = close_on(3, ("position_drag",), rate=100.0)
    view = prepare(loop.before, fine=False)
    found = {misfit.domain: misfit for misfit in misfits(loop.before, view, (), seed=0)}
    for domain in ("acceleration", "temperature", "load"):
        expected = slow_excess(view, found[domain].basis)
        assert found[domain].excess == pytest.approx(expected, rel=0.02, abs=0.3)
    assert found["joint-angle"].excess > 20
    assert found["joint-angle"].p_value < 0.01


@pytest.mark.parametrize(
    "values", [np.linspace(-1, 3, 50), np.r_[np.zeros(30), np.arange(20.0)], np.ones(7)]
)
def test_cosines_are_bounded_and_begin_with_a_constant(values):
    waves = cosines(values, 4)
    assert waves.shape == (5, values.size)
    assert np.all(np.abs(waves) <= 1)
    np.testing.assert_array_equal(waves[0], 1)


@pytest.mark.parametrize(
    ("effect", "seed", "refused"),
    [
        ("stribeck", 4, "quadratic_friction"),
        ("offset", 11, "asymmetric_friction"),
        ("thermal_viscous", 35, "warmup"),
        ("time_delay", 73, "elasticity"),
        ("hysteresis", 63, "position_drag"),
    ],
)
def test_the_neighbour_of_an_effect_outside_the_library_is_refused(effect, seed, refused):
    _, loop = close_on(seed, (effect,), ratio=0.6, without=(effect,))
    assert loop.steps == ()
    assert refused in {entry.effect for entry in loop.rejected}


@pytest.mark.parametrize("effect", ["stribeck", "offset", "thermal_viscous", "warmup"])
def test_the_effect_itself_is_kept(effect):
    _, loop = close_on(1, (effect,), ratio=1.5, rate=250.0)
    assert effect in {name for step in loop.steps for name in (step.term.effect.name, *step.ties)}
