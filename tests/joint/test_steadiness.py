"""Sines that come in bursts are no periodic effect."""

import numpy as np
import pytest
from closing import close_on

from opamc_cli.joint.form import imitations
from opamc_cli.joint.steadiness import BLOCKS_PER_GROUP, burst
from opamc_cli.joint.view import blocks_of, prepare


@pytest.fixture(scope="module")
def rippled():
    return close_on(11, ("ripple",), ratio=0.6)[1]


def test_bursts_are_what_least_squares_finds_block_by_block(rippled):
    view = prepare(rippled.before, fine=True)
    term = rippled.steps[0].term
    columns = view.whitened_rows(rippled.before.session.columns(term, True)[:, :2])
    fall, free = 0.0, 0
    for block in blocks_of(view, BLOCKS_PER_GROUP):
        values = view.values[block]
        left = values - columns[block] @ np.linalg.lstsq(columns[block], values, rcond=None)[0]
        fall += float(values @ values - left @ left) / view.variance
        free += 2
    excess, deviation = burst(view, columns, view.values)
    assert excess == pytest.approx(fall - free, rel=1e-6)
    assert deviation == pytest.approx(np.sqrt(2 * free))


def test_a_steady_ripple_is_kept(rippled):
    terms = tuple(step.term for step in rippled.steps)
    assert [term.effect.name for term in terms] == ["ripple"]
    assert imitations(rippled.after, terms, seed=0) == {}


@pytest.mark.parametrize("seed", [24, 31, 22333])
def test_ringing_after_jerks_is_no_ripple(seed):
    _, loop = close_on(seed, ("elasticity",), ratio=0.6, without=("elasticity",))
    assert loop.steps == ()
    assert loop.verdict == "not-in-library"
