"""Evidence by the spectrum: changes of size, and none where nothing differs."""

from dataclasses import replace

import numpy as np
import pytest

from opamc_cli.decision.significance.permutation import relabellings
from opamc_cli.decision.witnesses.deviation import PRIOR_DOF, change_between, deviation_from_rest
from opamc_cli.decision.witnesses.spectra import (
    LEAST_VARIANCE,
    clearest_change,
    pooled_deviation,
    size_effect,
)
from tests.decision.fleet import Fleet, cells, judge, spectra


def squared_deviation(cell, units, rest):
    return deviation_from_rest(cell.sessions, cell.cycles, cell.within, units, rest, LEAST_VARIANCE)


@pytest.mark.long
def test_a_change_of_size_alone_is_found_by_the_spectrum():
    plan = Fleet(louder=0.6)
    found = [judge(cells(plan, s), spectra_by_axis=spectra(plan, s)) for s in range(10)]
    assert sum(j[plan.faulty].state != "healthy" for j in found) >= 7
    assert np.mean([judge(cells(plan, s))[plan.faulty].state == "healthy" for s in range(10)]) > 0.8
    assert np.median([j[plan.faulty].effects["spectrum"] for j in found]) == pytest.approx(
        0.6, rel=0.2
    )


def test_identical_spectra_are_no_evidence():
    plan = Fleet(n_axes=1, n_motions=1)
    cell = spectra(plan, 0)[1][0]
    cell.sessions[:] = cell.sessions[0]
    assert size_effect([cell], plan.n_baseline) == 0.0
    (ratio,) = squared_deviation(cell, np.array([6]), np.arange(6))
    assert ratio == pytest.approx(0.0, abs=1e-9)


def slow_pooled(cells, row):
    """The definition for one labelling: differences of means by each bin's moderated variance."""
    ratios = []
    for cell in cells:
        known = np.isfinite(cell.sessions).all(axis=1)
        a, b = cell.sessions[known & row], cell.sessions[known & ~row]
        if len(a) and len(b):
            own = cell.sessions[known].var(axis=0)
            n = int(known.sum())
            variance = (PRIOR_DOF * own.mean() + n * own) / (PRIOR_DOF + n)
            difference = (a.mean(axis=0) - b.mean(axis=0)) ** 2
            ratios.append((difference / np.maximum(variance, LEAST_VARIANCE)).mean())
    return np.mean(ratios) if ratios else np.nan


def test_pools_of_sessions_differ_by_their_definition():
    plan = Fleet(n_axes=1, n_baseline=4, n_target=2)
    own = spectra(plan, 1)[1]
    own[0].sessions[2] = np.nan
    labels = relabellings(4, 2)
    expected = [slow_pooled(own, row) for row in labels]
    np.testing.assert_allclose(pooled_deviation(own, labels), expected, rtol=1e-9)
    lone = np.zeros((1, 6), dtype=bool)
    lone[0, 2] = True
    own[1].sessions[2] = own[2].sessions[2] = np.nan
    assert np.isnan(pooled_deviation(own, lone)).all()


def test_the_clearest_change_is_told_by_place_frequency_and_size():
    plan = Fleet(n_axes=1, n_baseline=5, between_sessions=0.02)
    own = spectra(plan, 2)[1]
    frame, bin_number = 3, 5
    cell = own[1]
    cell.sessions[5:, frame * cell.bins + bin_number] += 4.0
    change, _ = change_between(cell.sessions, 5)
    found = clearest_change(own, 5)
    assert found.motion == cell.motion
    # eight frames, each two ninths of the motion, from its beginning to its end
    assert (found.start, found.stop) == pytest.approx((3 / 7 * 7 / 9, 3 / 7 * 7 / 9 + 2 / 9))
    assert found.frequency_hz == (bin_number + 1) * cell.bin_hz
    assert found.size_ratio == pytest.approx(np.exp(change[frame * 8 + bin_number] / 2))
    assert clearest_change([replace(c, sessions=c.sessions[:2]) for c in own], 1) is None
