from dataclasses import replace

import numpy as np

from opamc_cli.signal.cycles.features import SAME_PROGRAM, MatchRule, SegmentFeatures

FIVE = SegmentFeatures(*np.arange(15.0).reshape(3, 5), np.array([1, -1, 1, 0, 1]), np.arange(5.0))


def test_a_part_is_half_open_and_takes_every_column():
    part, taken = FIVE.part(1, 3), FIVE.take(np.array([1, 2]))
    assert len(part) == len(taken) == 2
    for own in (part, taken):
        assert (own.variance.tolist(), own.duration_s.tolist()) == ([1, 2], [6, 7])
        assert (own.f_max_hz.tolist(), own.direction.tolist()) == ([11, 12], [-1, 1])
        assert own.pause_s.tolist() == [1, 2]


def test_by_motion_the_current_says_nothing_and_half_of_the_motions_more():
    rule = MatchRule(0.8, 0.2, 0.1, use_direction=False)
    assert rule.by_motion() == MatchRule(0.0, 0.2, 0.1, False, SAME_PROGRAM)


def test_places_are_the_same_within_a_fiftieth_of_the_range():
    cycle = replace(FIVE.part(0, 2), places_rad=np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert cycle.range_rad == 1.0
    own = np.array([[0.0, 1.019], [0.021, 1.0], [1.0, np.nan]])
    told = replace(FIVE.part(0, 3), places_rad=own).lead_as(cycle)
    # of what is not known nothing speaks against it
    assert told.tolist() == [[True, False], [False, False], [True, True]]
    assert FIVE.lead_as(cycle).all()
    assert FIVE.range_rad == 0.0
