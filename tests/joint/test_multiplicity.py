"""Guesses at a parameter count for as many as are independent."""

from dataclasses import replace

import numpy as np
import pytest
from closing import close_on
from scipy.stats import chi2

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.model import Term
from opamc_cli.joint.multiplicity import TAIL, drawn_p_value, independent_guesses
from opamc_cli.joint.search import search
from opamc_cli.joint.span import orthonormal_beside
from opamc_cli.joint.view import prepare


@pytest.fixture(scope="module")
def nothing():
    fitted = close_on(4, (), rate=100.0)[1].before
    return fitted.session, prepare(fitted, fine=False)


@pytest.mark.parametrize("name", ["position_drag", "payload_change"])
def test_as_many_as_brute_force_counts(nothing, name):
    session, view = nothing
    effect = built_in_library()[name]
    found, _ = search(session, view, effect)
    guesses = effect.guesses(view.grid.track, view.residual)
    noise = np.random.default_rng(5).normal(size=(view.rows.size, 3000))
    largest = np.zeros(noise.shape[1])
    for guess in guesses:
        columns = view.whitened_rows(
            session.columns(Term(effect, guess, found.term.keep), view.fine)
        )
        own = orthonormal_beside(columns, view.span)
        largest = np.maximum(largest, np.sum((own.T @ noise) ** 2, axis=0))
    slow = TAIL / chi2.sf(np.quantile(largest, 1 - TAIL), own.shape[1])
    assert 1 < slow < len(guesses)
    counted = independent_guesses(session, view, found, guesses)
    assert counted == pytest.approx(slow, rel=0.5)


def test_one_guess_twice_is_one_guess(nothing):
    session, view = nothing
    found, _ = search(session, view, built_in_library()["position_drag"])
    counted = independent_guesses(session, view, found, [found.term.parameters] * 20)
    assert counted == pytest.approx(1.0, rel=0.3)


def test_a_p_value_falls_with_the_likelihood(nothing):
    session, view = nothing
    found, _ = search(session, view, built_in_library()["payload_change"])
    p_values = [
        drawn_p_value(session, view, replace(found, likelihood=likelihood))
        for likelihood in (12.0, 18.0, 24.0)
    ]
    assert p_values == sorted(p_values, reverse=True)
    assert p_values[2] < 1e-2 * p_values[0]
