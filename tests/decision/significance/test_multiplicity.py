"""Corrections for several questions against their definitions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opamc_cli.decision.significance.multiplicity import harmonic_mean, holm


@given(st.lists(st.floats(0, 1), min_size=1, max_size=7), st.floats(0.001, 0.2))
def test_holm_rejects_what_its_step_down_definition_rejects(p, level):
    adjusted = holm(p)
    order = np.argsort(p, kind="stable")
    rejected = set()
    for place, index in enumerate(order):
        if p[index] * (len(p) - place) > level:
            break
        rejected.add(int(index))
    assert {i for i, a in enumerate(adjusted) if a <= level} == rejected


def test_holm_passes_over_joints_without_a_verdict():
    np.testing.assert_allclose(holm([0.01, np.nan, 0.04]), [0.02, np.nan, 0.04])


def test_two_witnesses_together_keep_the_level_and_lie_between_the_least_and_its_double():
    p = np.random.default_rng(7).random((60_000, 2))
    together = np.array([harmonic_mean(pair) for pair in p])
    least = p.min(axis=1)
    assert (together >= least).all()
    assert (together <= 2 * least).all()
    assert np.mean(together <= 0.01) == pytest.approx(0.0103, abs=0.0012)
    assert harmonic_mean([0.0, 0.5]) < 1e-300


def test_a_lone_small_p_value_pays_for_its_share_of_the_weights():
    assert harmonic_mean([1e-6, 1.0, 1.0], [2, 1, 1]) == pytest.approx(2e-6, rel=1e-5)
    assert harmonic_mean([1.0, 1e-6, 1.0], [2, 1, 1]) == pytest.approx(4e-6, rel=1e-5)
    assert harmonic_mean([0.0] * 5, [1, 3, 1, 1, 1]) < 1e-300
