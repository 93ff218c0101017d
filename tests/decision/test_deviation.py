"""How far sessions lie from others, whatever they are made of."""

import numpy as np
import pytest

from opamc_cli.decision.witnesses.deviation import deviation_from_rest
from opamc_cli.decision.witnesses.spectra import LEAST_VARIANCE
from tests.decision.fleet import Fleet, spectra
from tests.marks import long


def squared_deviation(cell, units, rest):
    return deviation_from_rest(cell.sessions, cell.cycles, cell.within, units, rest, LEAST_VARIANCE)


@pytest.mark.parametrize("n_target_cycles", [1, long(2), long(8)])
def test_sessions_of_any_number_of_cycles_are_judged_alike(n_target_cycles):
    plan = Fleet(n_axes=1, n_motions=1)
    ratios = []
    for seed in range(60):
        cell = spectra(plan, seed, n_target_cycles)[1][0]
        ratios.append(squared_deviation(cell, np.array([0, 6]), np.array([1, 2, 3, 4, 5])))
    own, target = np.mean(ratios, axis=0)
    assert target == pytest.approx(own, rel=0.12)
