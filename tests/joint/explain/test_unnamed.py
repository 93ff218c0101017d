"""Functions without a name: where they begin, what they explain, and that they explain no noise."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import joint_of, plain_fit
from hypothesis import given, settings
from hypothesis import strategies as st
from simulator import simulate

from opamc_cli.joint.explain.saturated import ceiling, saturated, unnamed_library
from opamc_cli.joint.explain.unnamed import SMOOTH, stretched, travel_since_reversal
from opamc_cli.joint.fit.model import Term, fit_terms
from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.name.chain import chain_of
from opamc_cli.joint.name.search import Pool


def explained(recording):
    start = chain_of(plain_fit(recording), 0)
    return start, saturated(start, Pool.of(start.fit.dataset, unnamed_library()))


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=80), st.integers(0, 2**32 - 1))
def test_a_covariate_is_stretched_within_0_and_1_in_its_own_order(values, seed):
    values = np.array(values)
    members = np.random.default_rng(seed).random(values.size) < 0.7
    place = stretched(values, members)
    assert np.all((place >= 0) & (place <= 1))
    order = np.argsort(values, kind="stable")
    assert np.all(np.diff(place[order]) >= 0)
    if members.any() and np.ptp(values[members]) > 0:
        # Of equal values all have the rank of the last.
        assert place[members].max() == 1


def test_every_stretch_of_a_covariate_is_seen_and_none_is_flattened():
    # Nine tenths of the samples are in a tenth of the range.
    values = np.concatenate([np.linspace(0, 1, 900), np.linspace(1.01, 10, 100)])
    place = stretched(values, np.ones(1000, dtype=bool))
    assert place[899] == pytest.approx((0.9 + 0.1) / 2, abs=0.02)
    assert np.all(np.diff(place) > 0)


def test_travel_since_reversal_of_a_zigzag():
    track = SimpleNamespace(
        position_rad=np.array([0.0, 1, 2, 3, 2, 1, 1, 0, 1, 3]),
        direction=np.array([1, 1, 1, 1, -1, -1, 0, -1, 1, 1]),
        size=10,
    )
    # A rest is no reversal; a reversal counts from the sample at which the direction is another.
    np.testing.assert_array_equal(travel_since_reversal(track), [0, 1, 2, 3, 0, 1, 1, 2, 0, 2])


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


def test_a_model_beside_its_own_rates_of_change_settles_at_once():
    # Late by 15 times the noise, which it did not do when the last fit was shifted.
    made = simulate(6, ("time_delay",), 15.0, rate=500.0, cycles=6)
    before = plain_fit(
        Recording("run", made.rate_hz, current_a=made.current, position_rad=made.position)
    )
    terms = (*before.terms, Term(unnamed_library()["unnamed_shift"], {}))
    after = fit_terms(before.dataset, terms)
    assert after.rmse(sealed=False) < 0.75 * before.rmse(sealed=False)
    again = fit_terms(after.dataset, terms)
    assert again.rmse(sealed=False) == pytest.approx(after.rmse(sealed=False), rel=1e-9)
