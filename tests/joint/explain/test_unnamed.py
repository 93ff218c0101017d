"""Functions without a name: how a covariate is stretched, and where travel begins anew."""

from types import SimpleNamespace

import numpy as np
import pytest
from closing import plain_fit
from hypothesis import given, settings
from hypothesis import strategies as st
from simulator import simulate

from opamc_cli.joint.explain.saturated import unnamed_library
from opamc_cli.joint.explain.unnamed import stretched, travel_since_reversal
from opamc_cli.joint.fit.model import Term, fit_terms
from opamc_cli.joint.motion.kinematics import Recording


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
