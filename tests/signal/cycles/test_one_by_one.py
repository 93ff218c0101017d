"""Segments told each by itself, in any order, by where they lead."""

import numpy as np

from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import identify_one_by_one

PLACES = {"a": (0.0, 1.0), "b": (1.0, 0.5), "c": (0.5, 0.0), "d": (0.0, 0.7)}
RULE = MatchRule()


def segments(names, places=PLACES, f_max_hz=40.0):
    n = len(names)
    variance = np.array([1.0 + "abcd".index(name) for name in names])
    return SegmentFeatures(
        variance,
        *(np.full(n, value) for value in (1.0, f_max_hz)),
        np.zeros(n, dtype=np.int64),
        np.full(n, 0.5),
        None if places is None else np.array([places[name] for name in names]).reshape(n, 2),
    )


def told(reference, names, rule=RULE, **changed):
    found = identify_one_by_one(segments(reference), segments(names, **changed), rule)
    return found.motion.tolist(), found.cycle.tolist(), found.similarity.round(3).tolist()


def test_each_segment_is_told_wherever_it_stands():
    motion, cycle, similarity = told("abcd", "abddbca")
    assert motion == [0, 1, 3, 3, 1, 2, 0]
    # a cycle holds what follows in the reference's order
    assert cycle == [0, 0, 0, 1, 2, 2, 3]
    assert similarity == [1.0] * 7


def test_what_is_nowhere_or_could_be_two_is_none():
    assert told("abc", "abdac")[0] == [0, 1, -1, 0, 2]
    assert told("abc", "abdac")[1] == [0, 0, -1, 1, 1]
    assert told("abac", "abac")[0] == [-1, 1, -1, 3]


def test_less_than_half_of_the_motions_or_no_places_tell_nothing():
    assert told("abcd", "aaa")[0] == [-1] * 3
    assert told("abcd", "aba")[0] == [0, 1, 0]
    assert told("abcd", "abcd", places=None)[0] == [-1] * 4
    assert told("abcd", "abcd", f_max_hz=60.0)[0] == [-1] * 4
    assert told("abcd", "abcd", RULE.by_lead(), f_max_hz=60.0)[0] == [0, 1, 2, 3]
    assert told("abcd", "")[0] == []
