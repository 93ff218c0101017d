"""Standard errors that allow for correlation inside a unit, and terms that cannot be told apart."""

from dataclasses import replace

import numpy as np
import pytest
from closing import joint_of, plain_fit
from scipy.stats import t as student

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.intervals import certainty, drag_t
from opamc_cli.joint.fit.model import Term, dataset_of, fit_terms
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import Joint

LIBRARY = built_in_library()
BASE = ("inertia", "gravity", "coulomb", "viscous")


def slow_errors(fitted):
    """Compute the cluster sandwich from the regressors themselves."""
    grid = fitted.dataset.fine
    design = np.concatenate([one.columns(grid.track) for one in fitted.terms], axis=1)
    parts = fitted.dataset.parts[0]
    unit = np.repeat(parts.unit, [stop - start for start, stop in parts.slices])
    design, rest = design[parts.rows], fitted.residual_a[parts.rows]
    bread = np.linalg.inv(design.T @ design)
    scores = [design[unit == u].T @ rest[unit == u] for u in range(parts.units)]
    meat = sum(np.outer(one, one) for one in scores) * parts.units / (parts.units - 1)
    return np.sqrt(np.diag(bread @ meat @ bread))


def test_errors_are_those_of_the_cluster_sandwich():
    fitted = plain_fit(joint_of("cyclic", lambda q, v, a, t: np.sin(3 * q), strength=2.0))
    known = certainty(fitted)
    found = np.concatenate(known.standard_errors)
    np.testing.assert_allclose(found, slow_errors(fitted), rtol=1e-6)
    assert [one.size for one in known.standard_errors] == [1, 2, 1, 1]
    units = fitted.sums.parts.units
    assert known.factor == pytest.approx(student.ppf(0.975, units - 1))
    assert known.inseparable == ()


def test_noise_that_lasts_is_less_certain_than_noise_that_does_not():
    def drifting(q, v, a, t):
        return np.cumsum(np.random.default_rng(3).normal(size=t.size))

    def rough(q, v, a, t):
        return np.random.default_rng(3).normal(size=t.size)

    slow, fast = (
        certainty(plain_fit(joint_of("cyclic", noise, strength=10.0)))
        for noise in (drifting, rough)
    )
    assert slow.standard_errors[1][0] > 3 * fast.standard_errors[1][0]


def test_terms_that_replace_one_another_are_named():
    recording = joint_of("cyclic", None, rate=100.0)
    track, grouping = grouped_track([recording], Joint())
    dataset = dataset_of(track, grouping)
    terms = [Term(LIBRARY[name], {}) for name in BASE]
    lone = certainty(fit_terms(dataset, tuple(terms)))
    twice = certainty(fit_terms(dataset, (*terms, Term(LIBRARY["sublinear_friction"],
                                                       {"exponent": 0.999}))))  # fmt: skip
    assert twice.condition_number > 30 * lone.condition_number
    assert twice.inseparable == (("sublinear_friction", "viscous"),)


def test_what_is_one_on_the_way_that_a_joint_took_is_not_known():
    recording = joint_of("cyclic", None, rate=100.0)
    track, grouping = grouped_track([recording], Joint())
    terms = [Term(LIBRARY[name], {}) for name in ("inertia", "coulomb", "viscous", "offset")]
    both = certainty(fit_terms(dataset_of(track, grouping), tuple(terms)))
    one_way = replace(track, moving=track.moving & (track.direction > 0))
    alone = certainty(fit_terms(dataset_of(one_way, grouping), tuple(terms)))
    assert both.one == ()
    assert alone.one == (("coulomb", "offset"),)
    assert np.isfinite(np.concatenate(both.standard_errors)).all()
    known = np.isfinite(np.concatenate(alone.standard_errors))
    assert known.tolist() == [True, False, True, False]


def test_nothing_fitted_is_nothing_to_be_certain_of():
    fitted = plain_fit(joint_of("cyclic", None, rate=100.0), ())
    known = certainty(fitted)
    assert (known.standard_errors, known.inseparable, known.condition_number) == ((), (), 1.0)


@pytest.mark.parametrize("built_up", [1.0, 0.3])
def test_friction_that_builds_up_after_a_reversal_resists_too(built_up):
    recording = joint_of("cyclic", None, rate=100.0)
    track, grouping = grouped_track([recording], Joint())
    terms = (Term(LIBRARY["coulomb"], {}), Term(LIBRARY["hysteresis"], {"length_rad": 0.02}))
    columns = np.concatenate([term.columns(track) for term in terms], axis=1)
    noise = np.random.default_rng(1).normal(0.0, 0.02, track.size)
    current = columns @ np.array([-0.6, built_up]) + noise
    fitted = fit_terms(dataset_of(replace(track, current_a=current), grouping), terms)
    assert np.sign(drag_t(fitted)) == np.sign(built_up - 0.6)
