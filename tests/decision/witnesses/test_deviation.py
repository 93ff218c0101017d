"""How far sessions lie from others, whatever they are made of."""

import numpy as np
import pytest

from opamc_cli.decision.witnesses.deviation import (
    change_between,
    clearest_of,
    clearest_part,
    deviation_from_rest,
    mean_of_known,
    moderated,
    variance_within_sessions,
)
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


NAN = np.nan


def test_means_and_variances_of_what_is_known_by_hand():
    rows = np.array([[1.0, NAN, 5.0], [3.0, NAN, NAN]])
    mean, n = mean_of_known(rows)
    np.testing.assert_array_equal(mean, [2, NAN, 5])
    assert n.tolist() == [2, 0, 1]
    # squares 2 and 8 of two degrees of freedom; a session of one cycle has none
    cycles = np.array([[1.0, 1.0], [3.0, NAN], [0.0, NAN], [4.0, NAN], [9.0, 2.0]])
    found = variance_within_sessions(cycles, np.array([0, 0, 1, 1, 2]))
    np.testing.assert_array_equal(found, [5, NAN])
    # four degrees of freedom of the mean of 1 and 3, one of its own
    np.testing.assert_allclose(moderated(np.array([1.0, NAN, 3.0]), 1.0), [1.8, 2.0, 2.2])
    assert np.isnan(moderated(np.array([NAN]), 1.0)).all()


def test_deviation_by_hand():
    sessions = np.array([[0.0, 0.0], [2.0, 4.0], [5.0, 1.0], [NAN, NAN]])
    cycles = np.array([2.0, 2.0, 1.0, 0.0])
    within = np.array([1.0, 3.0])
    found = deviation_from_rest(sessions, cycles, within, np.array([2, 3]), np.array([0, 1]), 1e-6)
    # mean 1 and 2; squares 2 and 8 of one degree each, moderated: (4 · 5 + squares) / 5;
    # within likewise: (4 · 2 + within) / 5; of one cycle where the others are of two
    between, single = np.array([4.4, 5.6]), np.array([1.8, 2.2])
    expected = between + single * (1 - 0.5) + between / 2
    assert found[0] == pytest.approx(np.mean(np.array([16.0, 1.0]) / expected))
    assert np.isnan(found[1])
    # one session of the rest: its cycles say what is least
    alone = deviation_from_rest(sessions, cycles, within, np.array([2]), np.array([0]), 1e-6)
    assert alone[0] == pytest.approx(np.mean(np.array([25.0, 1.0]) / (single + single * 0.5)))
    # sessions that agree within the least variance agree
    same = deviation_from_rest(0 * sessions, cycles, 0 * within, np.array([0]), np.array([1]), 1.0)
    assert same.tolist() == [0.0]


def test_the_clearest_part_by_hand():
    sessions = np.array([[0.0, 1.0, NAN], [2.0, 1.0, NAN], [7.0, 0.0, 4.0], [7.0, 2.0, 6.0]])
    change, variance = change_between(sessions, 2)
    np.testing.assert_array_equal(change, [6, 0, NAN])
    np.testing.assert_array_equal(variance, [2 * (1 / 2 + 1 / 2), 0, NAN])
    assert clearest_part(change, variance, 0.5) == (pytest.approx(36 / (2 + 1 + 0.5)), 0)
    assert clearest_part(change[2:], variance[2:], 0.5) == (0.0, 0)
    # the motion whose part stands out most, of however many; its change and how many parts it has
    turned = sessions[:, [1, 0]]
    assert clearest_of([0 * turned, turned, 0.1 * turned], 2, 0.5) == (1, 1, 6.0, 2)
    assert clearest_of([turned[1:]], 1, 0.5) is None
