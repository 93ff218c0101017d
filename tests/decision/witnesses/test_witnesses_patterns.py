"""Divergence between sessions and between pools of them."""

from dataclasses import replace

import numpy as np

from opamc_cli.decision.significance.permutation import relabellings
from opamc_cli.decision.witnesses.patterns import PatternEvidence, pooled_divergence
from tests.decision.fleet import Fleet, cells


def test_pools_of_relabelled_sessions_are_compared_one_by_one():
    own = cells(Fleet(n_baseline=3, n_target=2), 0)[1]
    labels = relabellings(3, 2)
    together = pooled_divergence(own, labels)
    alone = [pooled_divergence(own, row[np.newaxis])[0] for row in labels]
    np.testing.assert_allclose(together, alone)


def test_the_largest_change_is_that_of_what_the_target_holds():
    (own,) = cells(Fleet(n_motions=1, n_axes=1, faulty=1, severity=0.5), 0)[1]
    lacking = replace(own, target=np.zeros_like(own.target))
    assert PatternEvidence([own, lacking]).effect() == PatternEvidence([own]).effect() > 0.1
    assert np.isnan(PatternEvidence([lacking]).effect())
