"""How far sessions lie from others, whatever they are made of."""

import numpy as np
import pytest

from opamc_cli.decision.witnesses.deviation import (
    change_between,
    clearest_of,
    clearest_part,
    mean_of_known,
    moderated,
    variance_within_sessions,
)

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
    np.testing.assert_allclose(moderated(np.array([1.0, NAN, 3.0])), [1.8, 2.0, 2.2])
    assert np.isnan(moderated(np.array([NAN]))).all()


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
