"""Holm's procedure against its definition."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.decision.significance.multiplicity import holm


@settings(deadline=None)
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
