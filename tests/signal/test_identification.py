import numpy as np
import pytest

from opamc_cli.signal.identification import (
    MatchRule,
    SegmentFeatures,
    find_reference,
    identify,
    period,
    sliding_similarity,
)

RULE = MatchRule()

# one cycle of four motions: variance, duration, f_max, direction, pause before
CYCLE = [(4.0, 1.0, 314.0, 1, 0.5), (3.5, 0.6, 300.0, 1, 0.3), (4.2, 1.0, 314.0, -1, 0.3),
         (3.3, 0.6, 300.0, -1, 0.3)]  # fmt: skip


def series(rows, noise=0.02, seed=0):
    rng = np.random.default_rng(seed)
    values = np.array(rows, dtype=float)
    values[:, :3] *= 1 + noise * rng.normal(size=(len(rows), 3))
    return SegmentFeatures(*values[:, :3].T, values[:, 3].astype(int), values[:, 4])


def test_similarity_of_variance_vectors_by_hand():
    similarity = sliding_similarity(np.array([1.0, 2.0]), np.array([2.0, 4.0, 0.0]))
    assert similarity == pytest.approx([1.0, (4 * 1 + 0 * 2) / (4 * np.sqrt(5))])


@pytest.mark.parametrize("seed", range(5))
def test_a_period_shows_from_its_second_time_on(seed):
    twice = CYCLE * 2
    assert period(series(twice, seed=seed)) == 4
    # of the second time one segment is lacking
    assert period(series(twice[:-1], seed=seed)) < 4


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


@pytest.mark.parametrize("seed", range(10))
def test_alike_motions_are_one_motion(seed):
    assert period(series([CYCLE[0]] * 9, seed=seed)) == 1


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
