"""The size of the current as a witness."""

import numpy as np
import pytest

from opamc_cli.decision.witnesses.amplitudes import (
    AmplitudeCell,
    AmplitudeEvidence,
    clearest_amplitude,
)
from opamc_cli.decision.witnesses.evidence import session_distances


def evidence(target: list[float], n_motions: int = 2) -> AmplitudeEvidence:
    """Six sessions that agree to a hundredth, and one more; the last motion alone is moved."""
    rng = np.random.default_rng(5)
    cells = []
    for motion in range(n_motions):
        sessions = rng.normal(0, 0.01, (7, 3))
        sessions[6] += target if motion == n_motions - 1 else 0.0
        cells.append(AmplitudeCell(motion, sessions, np.full(7, 4.0), np.full(3, 1e-6)))
    return AmplitudeEvidence(cells, 6)


def test_what_stands_out_is_named_with_its_ratio():
    found = clearest_amplitude(evidence([0.0, np.log(1.5), 0.05]).cells, 6)
    assert (found.motion, found.size) == (1, "roughness")
    assert found.ratio == pytest.approx(1.5, rel=0.05)
    lone = [AmplitudeCell(0, np.zeros((2, 3)), np.ones(2), np.zeros(3))]
    assert clearest_amplitude(lone, 1) is None


def test_the_effect_is_the_root_mean_square_change_beyond_the_baseline_s_own():
    assert evidence([0.3, 0.3, 0.3], n_motions=1).effect() == pytest.approx(0.3, rel=0.05)
    assert evidence([0.0, 0.0, 0.0], n_motions=1).effect() < 0.01


def test_a_larger_current_is_further_along():
    usual = session_distances(evidence([0.0, 0.0, 0.0]), 6, 1)["score"]
    larger = session_distances(evidence([0.2, 0.2, 0.2]), 6, 1)["score"]
    assert usual.log_ratio("score") < 2
    assert larger.log_ratio("score") > 4
