"""Divergence between sessions and between pools of them."""

import numpy as np

from opamc_cli.decision.significance.permutation import relabellings
from opamc_cli.decision.witnesses.patterns import pooled_divergence
from tests.decision.fleet import Fleet, cells


def test_pools_of_relabelled_sessions_are_compared_one_by_one():
    own = cells(Fleet(n_baseline=3, n_target=2), 0)[1]
    labels = relabellings(3, 2)
    together = pooled_divergence(own, labels)
    alone = [pooled_divergence(own, row[np.newaxis])[0] for row in labels]
    np.testing.assert_allclose(together, alone)
