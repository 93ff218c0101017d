"""Features against scipy and numpy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import ks_2samp

from opamc_cli.decision.divergence.features import compare, ks_statistic

samples = st.lists(st.sampled_from([0.0, 0.1, 0.1, 0.25, 0.5, 0.9]), min_size=1, max_size=12)


@settings(max_examples=200)
@given(samples, samples)
def test_ks_statistic_is_scipys_with_ties(baseline, target):
    with np.errstate(divide="ignore"):  # Its p value, of one session; not asked here.
        expected = ks_2samp(baseline, target, method="asymp").statistic
    assert ks_statistic(baseline, target) == pytest.approx(expected, abs=1e-12)


def test_the_three_features():
    rng = np.random.default_rng(0)
    b, t = rng.normal(0.02, 0.01, 16), rng.normal(0.2, 0.05, 12)
    features = compare(b, t)
    assert features.delta_mu == pytest.approx(t.mean() - b.mean())
    assert features.delta_var == pytest.approx(np.var(t, ddof=1) - np.var(b, ddof=1))
    assert features.ks == 1.0


def test_segments_without_a_divergence_are_passed_over():
    assert compare([0.1, math.nan], [0.3]).delta_mu == pytest.approx(0.2)
    assert math.isnan(compare([math.nan], [0.3]).delta_mu)
    assert math.isnan(compare([0.1], [0.3, 0.4]).delta_var)
    assert math.isnan(ks_statistic([], [0.3]))
