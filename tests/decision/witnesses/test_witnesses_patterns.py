"""What ordinal patterns tell of sessions."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.decision.divergence.jensen_shannon import jensen_shannon
from opamc_cli.decision.witnesses.patterns import PatternEvidence
from tests.decision.fleet import Fleet, cells


def test_small_divergences_are_squared_differences_of_the_blocks():
    """Jensen-Shannon in bits is half of the squared distance over the natural logarithm of 2."""
    own = cells(Fleet(n_baseline=2, between_sessions=0.05, n_motions=1), 0)[1]
    (block,) = PatternEvidence(own).blocks()
    squared = ((block.sessions[0] - block.sessions[1]) ** 2).sum()
    divergence = jensen_shannon(own[0].baseline[0], own[0].baseline[1])
    assert squared / (2 * np.log(2)) == pytest.approx(float(divergence), rel=0.02)
    np.testing.assert_array_equal(block.weight[:2], own[0].baseline.sum(axis=1))
    assert (block.within == own[0].inflation / 4).all()


def test_sessions_without_a_motion_are_unknown_in_its_block():
    (own,) = cells(Fleet(n_motions=1, n_axes=1), 0)[1]
    own.baseline[2] = 0
    (block,) = PatternEvidence([own]).blocks()
    assert np.isnan(block.sessions[2]).all()
    assert np.isfinite(np.delete(block.sessions, 2, axis=0)).all()


def test_the_largest_change_is_that_of_what_the_target_holds():
    (own,) = cells(Fleet(n_motions=1, n_axes=1, faulty=1, severity=0.5), 0)[1]
    lacking = replace(own, target=np.zeros_like(own.target))
    assert PatternEvidence([own, lacking]).effect() == PatternEvidence([own]).effect() > 0.1
    assert np.isnan(PatternEvidence([lacking]).effect())
