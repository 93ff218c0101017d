from dataclasses import replace
from itertools import chain, combinations, pairwise

import numpy as np
import pytest
from made_cycles import CYCLE, series

from opamc_cli.signal.cycles.features import MatchRule
from opamc_cli.signal.cycles.identification import (
    _most_windows,
    fits_shifted,
    identify,
    sliding_similarity,
    with_cut_cycles,
)
from opamc_cli.signal.cycles.reference import find_reference, period

RULE = MatchRule()


def test_similarity_of_variance_vectors_by_hand():
    similarity = sliding_similarity(np.array([1.0, 2.0]), np.array([2.0, 4.0, 0.0]))
    assert similarity == pytest.approx([1.0, (4 * 1 + 0 * 2) / (4 * np.sqrt(5))])


def test_similarity_of_too_short_a_series_is_empty():
    assert sliding_similarity(np.ones(4), np.ones(3)).size == 0


@pytest.mark.parametrize("seed", range(20))
def test_four_cycles_of_four_motions(seed):
    segments = series(CYCLE * 4, seed=seed)
    assert period(segments) == 4
    start, stop = find_reference(segments, RULE)
    assert (start, stop) == (0, 4)
    found = identify(segments.part(start, stop), segments, RULE)
    assert found.cycle.tolist() == np.repeat(range(4), 4).tolist()
    assert found.motion.tolist() == list(range(4)) * 4
    assert found.similarity.min() > 0.99


@pytest.mark.parametrize("drop", [1, 5, 6, 11])
def test_a_missing_segment_costs_one_cycle_only(drop):
    rows = CYCLE * 5
    del rows[drop]
    segments = series(rows)
    assert period(segments) == 4
    found = identify(series(CYCLE, noise=0), segments, RULE)
    assert found.cycle.max() == 3
    assert (found.cycle == -1).sum() == 3
    assert (found.motion[found.cycle == -1] == -1).all()


# as CYCLE, with a creep at a stop that goes 2 % of the way of the others
CREEP = (0.4, 0.2, 40.0, -1, 0.02)
CREEPING = [*CYCLE[:2], CREEP, *CYCLE[2:]]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("where", [(), (0,), (1, 3), (0, 1, 2, 3)])
def test_a_creep_that_is_not_always_there_costs_itself_alone(where, seed):
    rows = [row for k in range(4) for row in (CREEPING if k in where else CYCLE)]
    known = identify(series(CREEPING, noise=0), series(rows, seed=seed), RULE)
    assert known.cycle.tolist() == [k for k in range(4) for _ in range(5 if k in where else 4)]
    there = [([0, 1, 2, 3, 4] if k in where else [0, 1, 3, 4]) for k in range(4)]
    assert known.motion.tolist() == list(chain(*there))
    unknown = identify(series(CYCLE, noise=0), series(rows, seed=seed), RULE)
    there = [([0, 1, -1, 2, 3] if k in where else [0, 1, 2, 3]) for k in range(4)]
    assert unknown.motion.tolist() == list(chain(*there))
    assert ((unknown.cycle == -1) == (unknown.motion == -1)).all()
    for found in (known, unknown):
        assert found.similarity[found.cycle >= 0].min() > 0.99


def test_a_motion_of_a_tenth_of_the_others_way_has_to_be_there():
    tenth = [(v, 0.5, 62.0, -1, p) if k == 2 else (v, *rest, p) for k, (v, *rest, p) in
             enumerate(CREEPING)]  # fmt: skip
    assert identify(series(tenth, noise=0), series(tenth * 3), RULE).cycle.max() == 2
    assert identify(series(tenth, noise=0), series(CYCLE * 3), RULE).cycle.max() == -1
    assert identify(series(CYCLE, noise=0), series(tenth * 3), RULE).cycle.max() == -1


def test_an_extra_segment_is_left_unidentified():
    rows = CYCLE * 3
    rows.insert(4, (9.0, 3.0, 100.0, 0, 0.3))
    found = identify(series(CYCLE, noise=0), series(rows), RULE)
    assert found.cycle.tolist() == [0] * 4 + [-1] + [1] * 4 + [2] * 4


def test_a_recording_that_starts_inside_a_cycle():
    segments = series((CYCLE * 4)[2:])
    start, stop = find_reference(segments, RULE)
    # the pause before the first motion of a cycle is longer than the others
    assert (start, stop) == (2, 6)
    found = identify(segments.part(start, stop), segments, RULE)
    assert found.cycle.tolist() == [-1, -1, *np.repeat(range(3), 4).tolist()]


def test_another_program_is_never_forced():
    other = [(1.0, 2.5, 120.0, 1, 0.3), (8.0, 0.2, 200.0, -1, 0.3)] * 6
    found = identify(series(CYCLE, noise=0), series(other), RULE)
    assert (found.cycle == -1).all()


def test_by_their_motion_alone_cycles_are_told_whatever_the_current():
    reference = series(CYCLE, noise=0)
    faulty = [(9 * v if k % 4 == 1 else v, *rest) for k, (v, *rest) in enumerate(CYCLE * 3)]
    assert identify(reference, series(faulty), RULE).cycle.max() == -1
    found = identify(reference, series(faulty), RULE.by_motion())
    assert found.cycle.tolist() == np.repeat(range(3), 4).tolist()
    assert 0 < found.similarity.max() < RULE.min_similarity
    short = [(v, 0.8 * d if k == 3 else d, *rest) for k, (v, d, *rest) in enumerate(CYCLE)]
    assert identify(reference, series(short), RULE.by_motion()).cycle.max() == 0
    slower = [(v, 1.2 * d, *rest) for v, d, *rest in CYCLE]
    assert identify(reference, series(slower), RULE).cycle.max() == 0
    assert identify(reference, series(slower), RULE.by_motion()).cycle.max() == -1


def test_a_motion_that_creeps_to_its_place_is_told_where_the_others_last_as_ever():
    reference = series(CYCLE, noise=0)

    def told(*longer):
        rows = [(v, d * t, *rest) for (v, d, *rest), t in zip(CYCLE, longer, strict=True)]
        return identify(reference, series(rows, noise=0), RULE.lingering()).cycle.max() == 0

    assert identify(reference, series(CYCLE, noise=0), RULE.lingering()).cycle.max() == 0
    assert told(1, 1, 1.8, 1)
    assert not told(1.8, 1, 1.8, 1), "half of them are another program's"
    assert not told(1, 1, 2.5, 1)
    assert not told(1, 1, 0.6, 1), "what an emergency stop has cut is no motion"
    assert not told(1.2, 1.2, 1.2, 1), "nor is another speed another creep"


def test_wrong_direction_alone_prevents_a_match():
    reference = series(CYCLE, noise=0)
    turned = [(v, d, f, -s, p) for v, d, f, s, p in CYCLE]
    assert identify(reference, series(turned), RULE).cycle.max() == -1
    lax = MatchRule(use_direction=False)
    assert identify(reference, series(turned), lax).cycle.max() == 0


def test_fewer_segments_than_a_cycle():
    found = identify(series(CYCLE), series(CYCLE[:2]), RULE)
    assert found.cycle.tolist() == [-1, -1]
    assert find_reference(series(CYCLE[:1]), RULE) == (0, 1)


@pytest.mark.parametrize("seed", range(60))
def test_the_most_windows_then_the_most_alike_are_those_of_trying_all(seed):
    rng = np.random.default_rng(seed)
    n, fits = 1 + seed % 3, rng.random(9) < 0.6
    similarity = rng.integers(6, 9, 9) / 8
    windows = np.arange(9)[:, np.newaxis] + np.arange(n)
    if n == 3 and seed % 2:
        # some lack their first, middle or last motion, some have a segment more
        windows[rng.random(9) < 0.3, 2] += 1
        lacking = rng.random(9) < 0.4
        windows[lacking, rng.integers(0, 3, 9)[lacking]] = -1
    spans = [(min(w for w in row if w >= 0), max(row) + 1) for row in windows.tolist()]
    order = np.argsort([start for start, _ in spans], kind="stable")
    windows, spans = windows[order], [spans[k] for k in order]
    every = [
        chosen
        for count in range(10)
        for chosen in combinations(np.flatnonzero(fits).tolist(), count)
        if all(spans[b][0] >= spans[a][1] for a, b in pairwise(chosen))
    ]
    worth = [
        (len(chosen), (windows[list(chosen)] >= 0).sum(), similarity[list(chosen)].sum())
        for chosen in every
    ]
    # of equal ones those that begin first
    best = min(c for c, w in zip(every, worth, strict=True) if w == max(worth))
    assert _most_windows(windows, fits, similarity) == list(best)


@pytest.mark.parametrize(
    ("column", "tolerance"), [(1, RULE.duration_tolerance), (2, RULE.f_max_tolerance)]
)
def test_each_segment_agrees_within_the_tolerance(column, tolerance):
    for off, fits in ((0.999, True), (1.001, False)):
        for sign in (-1, 1):
            rows = [list(row) for row in CYCLE]
            rows[2][column] *= 1 + sign * off * tolerance
            found = identify(series(CYCLE, noise=0), series(rows, noise=0), RULE)
            assert bool(found.cycle.max() == 0) is fits


def test_an_unknown_direction_is_no_other():
    unknown = [(v, d, f, 0, p) for v, d, f, _, p in CYCLE]
    for one, other in ((CYCLE, unknown), (unknown, CYCLE)):
        assert identify(series(one), series(other), RULE).cycle.max() == 0


def test_the_best_similarity_of_what_is_unidentified_is_kept():
    reference = series(CYCLE[:2], noise=0)
    rows = [(1.0, 9.0, 9.0, 1, 0.3), (1.0, 9.0, 9.0, 1, 0.3), (0.0, 9.0, 9.0, 1, 0.3)]
    found = identify(reference, series(rows, noise=0), RULE)
    length = np.hypot(4.0, 3.5)
    expected = [7.5 / length / np.sqrt(2), 7.5 / length / np.sqrt(2), 4 / length]
    assert found.similarity == pytest.approx(expected)
    assert found.motion.tolist() == found.cycle.tolist() == [-1, -1, -1]


@pytest.mark.parametrize(("before", "after"), [(0, 0), (1, 3), (3, 1), (2, 0)])
def test_cycles_that_the_ends_cut_go_on_from_whole_ones(before, after):
    cycle = series(CYCLE, noise=0)
    segments = series((CYCLE * 4)[4 - before : 12 + after], noise=0)
    found = with_cut_cycles(cycle, segments, identify(cycle, segments, RULE), RULE)
    order = [0] * before + [1] * 4 + [2] * 4 + [3] * after
    assert found.cycle.tolist() == [own - (before == 0) for own in order]
    assert found.motion.tolist() == (list(range(4)) * 4)[4 - before : 12 + after]
    assert found.similarity == pytest.approx(1.0)


def test_what_is_not_the_motion_that_is_due_ends_a_cut_cycle():
    cycle = series(CYCLE, noise=0)
    segments = series([CYCLE[2], CYCLE[2], CYCLE[3], *CYCLE, CYCLE[0], CYCLE[2]], noise=0)
    found = with_cut_cycles(cycle, segments, identify(cycle, segments, RULE), RULE)
    assert found.motion.tolist() == [-1, 2, 3, 0, 1, 2, 3, 0, -1]
    assert found.cycle.tolist() == [-1, 0, 0, 1, 1, 1, 1, 2, -1]
    nothing = series([CYCLE[2], CYCLE[2]], noise=0)
    none = identify(cycle, nothing, RULE)
    assert with_cut_cycles(cycle, nothing, none, RULE) is none


def test_a_cycle_whose_halves_are_alike_fits_itself_shifted():
    """Whatever they turn by, as a pallet's strokes do."""
    cycle = series(CYCLE, noise=0)
    assert not fits_shifted(cycle, RULE)
    assert not fits_shifted(series(CYCLE[:1], noise=0), RULE)
    pallet = replace(series(CYCLE * 2, noise=0), turns=np.arange(8.0))
    assert fits_shifted(pallet, RULE)
