from itertools import combinations

import numpy as np
import pytest
from made_cycles import CYCLE, series

from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import identify
from opamc_cli.signal.cycles.reference import find_reference, period

RULE = MatchRule()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("n", range(6, 9))
def test_a_period_shows_as_soon_as_two_segments_come_again(n, seed):
    assert period(series((CYCLE * 2)[:n], seed=seed)) == 4


@pytest.mark.parametrize("seed", range(5))
def test_what_nothing_repeats_is_one_period(seed):
    assert period(series(CYCLE, seed=seed)) == 4


@pytest.mark.parametrize("seed", range(10))
def test_alike_motions_are_one_motion(seed):
    assert period(series([CYCLE[0]] * 9, seed=seed)) == 1


def test_a_reference_cycle_is_found_again_where_it_was_taken():
    """More cycles fit beside a shift than at it where both halves of the program are alike."""
    segments = SegmentFeatures(
        np.tile([0.57, 0.87, 0.47, 0.5], 4),
        np.tile([1.58, 1.25, 1.26, 1.53], 4),
        np.full(16, 20.0),
        np.tile([-1, 1], 8),
        np.tile([0.3, 0.8, 0.9, 0.4], 4),
    )
    segments.pause_s[2::4] = 2.0  # the longest pause lies within the cycle
    start, stop = find_reference(segments, RULE)
    found = identify(segments.part(start, stop), segments, RULE)
    assert (start, found.cycle.max()) == (0, 3)
    assert found.similarity == pytest.approx(np.ones(16))


def test_a_pause_is_clearly_longer_from_half_as_much_again():
    for pause, start in ((0.44, 0), (0.46, 3)):
        rows = [(*row[:4], 0.3) for row in CYCLE]
        rows[3] = (*rows[3][:4], pause)
        assert find_reference(series((rows * 5)[:-1]), RULE) == (start, start + 4)
    # unknown pauses say nothing
    rows[3] = (*rows[3][:4], np.nan)
    assert find_reference(series((rows * 5)[:-1]), RULE) == (0, 4)
    assert find_reference(series(CYCLE * 4), RULE, segments_per_cycle=2)[1] == 2
    assert find_reference(series(CYCLE), RULE, segments_per_cycle=9) == (0, 4)


def test_differences_below_a_twentieth_are_no_period():
    rows = [(4.0 * (1 + 0.005 * (-1) ** k), 1.0, 314.0, 1, 0.3) for k in range(8)]
    assert period(series(rows, noise=0)) == 1
    rows = [(4.0 * (1 + 0.05 * (-1) ** k), 1.0, 314.0, 1, 0.3) for k in range(8)]
    assert period(series(rows, noise=0)) == 2
    assert period(series(rows[:1])) == 1
    assert period(series(rows[:3], noise=0)) == 3


@pytest.mark.parametrize(("height", "n"), [(4, 8), (5, 1)])
def test_differences_of_half_a_squared_spread_are_no_period(height, n):
    """Logs that rise and fall by steps: one step squared is 0.67 or 0.44 of their variance."""
    logs = [*range(height), *range(height, 0, -1)] * 3
    rows = [(np.exp(x), 1.0, 314.0, 1, 0.3) for x in logs]
    assert period(series(rows, noise=0)) == n


# a creep at a stop, of 2 % of the way of the others
CREEP = (0.4, 0.2, 40.0, -1, 0.02)


def with_creeps(places, n_cycles=6):
    """Return cycles of which some have a creep before their third motion."""
    rows = [
        row
        for k in range(n_cycles)
        for row in ([*CYCLE[:2], CREEP, *CYCLE[2:]] if k in places else CYCLE)
    ]
    return series(rows, seed=sum(places))


@pytest.mark.parametrize("n", range(7))
def test_creeps_in_any_cycles_hide_no_motion(n):
    """Of all choices of cycles but every other one, which is a longer cycle (below)."""
    for places in set(combinations(range(6), n)) - {(0, 2, 4), (1, 3, 5)}:
        segments = with_creeps(places)
        start, stop = find_reference(segments, RULE)
        found = identify(segments.part(start, stop), segments, RULE)
        large = segments.f_max_hz > 100
        assert found.cycle[large].tolist() == np.repeat(range(6), 4).tolist(), places
        assert (found.motion[start:stop] == np.arange(stop - start)).all()


def test_a_small_motion_that_is_in_every_cycle_is_in_the_reference():
    start, stop = find_reference(with_creeps(range(6)), RULE)
    assert (start, stop) == (0, 5)


def test_small_motions_may_tell_longer_cycles_apart():
    """Two halves of a program that are alike but for it stay two: every large motion is told."""
    for places in ((0, 2, 4), (1, 3, 5)):
        start, stop = find_reference(with_creeps(places), RULE)
        assert stop - start == 9
