"""What can be explained without a name, and that of noise nothing can."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.explain.saturated import (
    Ceiling,
    ceiling,
    saturated,
    sealed_parts,
    unnamed_library,
)
from opamc_cli.joint.explain.unnamed import SMOOTH
from opamc_cli.joint.fit.model import Term, fit_terms
from opamc_cli.joint.name.chain import chain_of
from opamc_cli.joint.name.search import Pool


def explained(recording):
    start = chain_of(plain_fit(recording), 0)
    return start, saturated(start, Pool.of(start.fit.dataset, unnamed_library()))


@pytest.mark.parametrize(
    ("effect", "domain"),
    [
        (lambda q, v, a, t: np.sign(v) * np.sin(9 * np.abs(v)), "velocity"),
        (lambda q, v, a, t: np.sin(7 * q) ** 2, "joint-angle"),
    ],
)
def test_a_smooth_function_that_no_effect_has_is_explained_in_its_domain(effect, domain):
    start, found = explained(joint_of("cyclic", effect, strength=5.0, rate=100.0))
    assert found.terms[0].effect.domain == domain
    limit = ceiling(start.fit, found.fit)
    # Of 26 parts 25 are the effect's.
    assert limit.certain
    assert limit.share == pytest.approx(25 / 26, abs=0.03)


@pytest.mark.parametrize("motion", ["one stroke", "cyclic", "steps of torque"])
def test_of_pure_noise_nothing_can_be_explained(motion):
    start, found = explained(joint_of(motion, None, rate=100.0))
    limit = ceiling(start.fit, found.fit)
    assert not limit.certain
    assert limit.share <= 2 * limit.standard_error


def test_the_ceiling_of_one_function_is_the_fall_of_the_sealed_error():
    before = plain_fit(joint_of("cyclic", lambda q, v, a, t: v * np.abs(v), rate=100.0))
    speed = next(effect for effect in SMOOTH if effect.name == "unnamed_speed")
    after = fit_terms(before.dataset, (*before.terms, Term(speed, {"degree": 4.0})))
    share = 1 - (after.rmse(sealed=True) / before.rmse(sealed=True)) ** 2
    assert ceiling(before, after).share == pytest.approx(share, rel=1e-9)
    # What predicts the sealed data worse is no ceiling.
    assert ceiling(after, before).share == 0.0
    assert ceiling(before, before).standard_error == 0.0


@pytest.mark.parametrize(
    ("share", "error", "certain"),
    [(0.1, 0.04, True), (0.1, 0.05, False), (0.02, 0.0, False), (0.021, 0.0, True)],
)
def test_a_ceiling_is_certain_above_two_standard_errors_and_two_per_cent(share, error, certain):
    assert Ceiling(share, error).certain is certain


def sealed(residual):
    """Return a fit whose sealed samples, every second one, leave a residual."""
    values = np.repeat(np.asarray(residual, dtype=float), 2)
    values[1::2] = 99.0
    judged = SimpleNamespace(residual_a=values, sealed=np.arange(values.size) % 2 == 0)
    return SimpleNamespace(opened=SimpleNamespace(judged=judged))


def test_sealed_samples_are_cut_into_twelve_parts_in_their_order():
    np.testing.assert_array_equal(sealed_parts(sealed(np.arange(12))), np.arange(12.0) ** 2)
    np.testing.assert_array_equal(sealed_parts(sealed([1] * 12 + [2] * 12)), [2] * 6 + [8] * 6)
    # Fewer samples are as many parts; none are one, of nothing.
    np.testing.assert_array_equal(sealed_parts(sealed([3, 1])), [9, 1])
    np.testing.assert_array_equal(sealed_parts(sealed([])), [0])


def test_a_ceiling_s_standard_error_is_that_of_the_parts_drops():
    # Drops of 3, 0 and 3 of 12 in all: a variance of 3, the sum's of 9.
    found = ceiling(sealed([2, 2, 2]), sealed([1, 2, 1]))
    assert found.share == pytest.approx(6 / 12)
    assert found.standard_error == pytest.approx(3 / 12)
    assert ceiling(sealed([2]), sealed([1])) == Ceiling(0.75, 0.0)
    assert ceiling(sealed([0, 0]), sealed([0, 0])) == Ceiling(0.0, 0.0)


def test_what_takes_less_than_two_per_cent_is_not_asked_for(monkeypatch):
    asked = []
    monkeypatch.setattr(
        "opamc_cli.joint.explain.saturated.beam",
        lambda start, pool, width, *limits: asked.append((start, pool, width)) or start,
    )
    pool = Pool([], unnamed_library(), 0.5, ("drift",))
    assert saturated("start", pool) == "start"
    assert asked == [("start", Pool([], pool.library, 0.02, ("drift",)), 1)]


def test_the_library_without_names_covers_every_domain():
    library = unnamed_library()
    assert all(effect.unnamed and effect.name == name for name, effect in library.items())
    assert {effect.domain for effect in library.values()} == {
        "velocity", "joint-angle", "load", "acceleration", "time", "temperature", "motor-angle",
        "frequency",
    }  # fmt: skip
