from itertools import combinations

import numpy as np
import pytest

from opamc_cli.signal.cycles import alignment
from opamc_cli.signal.cycles.alignment import MISSING, SMALL, aligned_windows, small
from opamc_cli.signal.cycles.features import SegmentFeatures


def features(ways):
    n = len(ways)
    return SegmentFeatures(
        np.ones(n), np.full(n, 0.5), 2 * np.array(ways), np.ones(n, int), np.zeros(n)
    )


def tried(agree, extra, optional, start):
    """Return the best windows from one segment on by trying all segments for all motions."""
    m, n = agree.shape
    fitting = []
    for count in range(n // 2 + 1, n + 1):
        for motions in combinations(range(n), count):
            if not all(optional[i] for i in range(n) if i not in motions):
                continue
            for segments in combinations(range(start, m), count):
                between = set(range(start, segments[-1])) - set(segments)
                fit = all(agree[j, i] for j, i in zip(segments, motions, strict=True))
                if segments[0] == start and fit and all(extra[j] for j in between):
                    row = np.full(n, MISSING)
                    row[list(motions)] = segments
                    fitting.append(((-count, segments[-1]), row.tolist()))
    if not fitting:
        return [[MISSING] * n]
    best = min(worth for worth, _ in fitting)
    return [row for worth, row in fitting if worth == best]


@pytest.mark.parametrize("seed", range(200))
def test_windows_are_those_of_trying_everything(seed):
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(1, 8)), int(rng.integers(1, 6))
    agree = rng.random((m, n)) < rng.choice([0.4, 0.7, 1.0])
    extra, optional = rng.random(m) < 0.4, rng.random(n) < 0.4
    windows = aligned_windows(agree, extra, optional)
    for start, row in enumerate(windows.tolist()):
        # two motions that one segment could be are equally good
        assert row in tried(agree, extra, optional, start)


def test_without_anything_small_windows_are_those_in_a_row():
    agree = np.ones((4, 3), dtype=bool)
    agree[3, 2] = False
    none = np.zeros(4, dtype=bool)
    windows = aligned_windows(agree, none, none[:3])
    assert windows.tolist() == [[0, 1, 2], *[[MISSING] * 3] * 3]


def test_small_is_a_share_of_the_middle_way():
    reference = features([1.0, 4.0, 2.0, 3.0, 0.1])
    assert small(features([2.01 * SMALL, 1.99 * SMALL]), reference).tolist() == [False, True]
    assert small(reference, reference).tolist() == [False] * 4 + [True]
    assert small(reference, features([])).tolist() == [False] * 5


def test_no_segments_have_no_windows():
    assert aligned_windows(np.ones((0, 3), bool), np.ones(0, bool), np.ones(3, bool)).size == 0


def test_a_window_that_ends_is_not_followed_to_the_end_of_the_cycle(monkeypatch):
    """A cycle of 157 motions that nothing holds took four minutes of a diagnosis."""
    agree = np.zeros((150, 120), dtype=bool)
    agree[7, 0] = agree[9, 3] = True
    calls = []
    followed = alignment._with_motion
    monkeypatch.setattr(
        alignment, "_with_motion", lambda *given: calls.append(1) or followed(*given)
    )
    windows = alignment.aligned_windows(agree, np.zeros(150, dtype=bool), np.zeros(120, dtype=bool))
    assert (windows == alignment.MISSING).all()
    assert len(calls) == 2
