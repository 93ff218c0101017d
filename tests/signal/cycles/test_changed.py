import numpy as np
import pytest

from opamc_cli.signal.cycles.changed import OneOff, one_off
from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import identify

RULE = MatchRule()
CYCLE = [(4.0, 1.0, 314.0, 1), (3.5, 0.6, 300.0, 1), (4.2, 1.1, 314.0, -1), (3.3, 0.7, 300.0, -1),
         (2.5, 0.4, 200.0, 1)]  # fmt: skip


def series(rows):
    values = np.array(rows, dtype=float)
    return SegmentFeatures(*values[:, :3].T, values[:, 3].astype(int), np.full(len(rows), 0.3))


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("motion", range(5))
def test_a_motion_that_is_lost_is_found(motion, first):
    less = [row for k, row in enumerate(CYCLE) if k != motion]
    segments = series((less * 4)[first:])
    assert identify(series(CYCLE), segments, RULE).cycle.max() == -1
    found = one_off(series(CYCLE), segments, RULE)
    assert found == OneOff(False, motion, CYCLE[motion][1])


@pytest.mark.parametrize("first", range(4))
@pytest.mark.parametrize("motion", [1, 2, 3])
def test_a_motion_that_is_gained_is_found(motion, first):
    """One between two cycles hides none of them."""
    less = [row for k, row in enumerate(CYCLE) if k != motion]
    segments = series((CYCLE * 4)[first:])
    assert identify(series(less), segments, RULE).cycle.max() == -1
    found = one_off(series(less), segments, RULE)
    assert found == OneOff(True, (motion - first) % 5, CYCLE[motion][1])


def test_another_program_is_no_cycle_but_for_one_motion():
    other = [(v, 2 * d, f, -s) for v, d, f, s in CYCLE]
    assert one_off(series(CYCLE), series(other * 4), RULE) is None
    assert one_off(series(CYCLE), series((CYCLE[:1] + CYCLE[3:]) * 4), RULE) is None
    assert one_off(series(CYCLE), series(CYCLE[:1]), RULE) is None


def test_of_three_motions_two_say_nothing():
    assert one_off(series(CYCLE[:3]), series(CYCLE[:2] * 4), RULE) is None
    assert one_off(series(CYCLE[:2]), series(CYCLE[:1] * 4), RULE) is None
    assert one_off(series(CYCLE[:4]), series(CYCLE[:3] * 4), RULE) == OneOff(False, 3, 0.7)
