"""Evidence by the spectrum: changes of size, and none where nothing differs."""

import numpy as np
import pytest

from opamc_cli.decision.witnesses.deviation import deviation_from_rest
from opamc_cli.decision.witnesses.spectra import LEAST_VARIANCE, size_effect
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
