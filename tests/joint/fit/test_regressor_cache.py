"""Products that are kept, against products that are computed, whatever was forgotten between."""

import weakref

import numpy as np
import pytest
from test_parts import random_parts

from opamc_cli.joint.fit import regressor_cache
from opamc_cli.joint.fit.regressor_cache import RegressorCache


def check(sums, blocks, current, parts):
    columns = np.concatenate(blocks, axis=1)
    for k, (start, stop) in enumerate(parts.slices):
        rows = parts.rows[start:stop]
        np.testing.assert_allclose(sums.gram[k], columns[rows].T @ columns[rows], atol=1e-9)
        np.testing.assert_allclose(sums.moment[k], columns[rows].T @ current[rows], atol=1e-9)
        assert sums.power[k] == pytest.approx(current[rows] @ current[rows])


@pytest.mark.parametrize("most_bytes", [0.0, 1e4, 1e9])
def test_sums_are_right_after_anything_was_forgotten(monkeypatch, most_bytes):
    monkeypatch.setattr(regressor_cache, "MOST_BYTES", most_bytes)
    rng = np.random.default_rng(2)
    grids = {}
    for fine in (True, False):
        parts = random_parts(rng, 8)
        size = parts.rows.max() + 1
        columns = {k: rng.normal(size=(size, 1 + k % 3)) for k in range(12)}
        grids[fine] = parts, columns, rng.normal(size=size)
    cache = RegressorCache()
    computed = 0
    for _ in range(60):
        fine = bool(rng.random() < 0.5)
        parts, columns, current = grids[fine]
        chosen = rng.choice(12, size=4, replace=False)
        blocks = []
        for key in chosen:

            def compute(key=key, columns=columns):
                nonlocal computed
                computed += 1
                return columns[key].copy()

            blocks.append(cache.columns((int(key), fine), compute))
        # Blocks that nobody keeps: another one may get their place in memory.
        blocks.append(rng.normal(size=(current.size, 2)))
        check(cache.sums(blocks, current, parts, fine), blocks, current, parts)
    assert (computed == 24) == (most_bytes == 1e9)


def test_after_clearing_everything_is_computed_again():
    rng = np.random.default_rng(3)
    parts = random_parts(rng, 8)
    block, current = (
        rng.normal(size=(parts.rows.max() + 1, 2)),
        rng.normal(size=parts.rows.max() + 1),
    )
    cache = RegressorCache()
    check(cache.sums([block], current, parts, True), [block], current, parts)
    cache.clear()
    check(cache.sums([block], 2 * current, parts, True), [block], 2 * current, parts)
    other = random_parts(rng, 8)
    assert cache.sums([], current, other, False).held_out().size == len(other.slices)


def test_what_is_asked_for_is_not_forgotten_and_mistaken_for_what_comes_after(monkeypatch):
    """A block that is freed leaves its place in memory, by which products are known."""
    rng = np.random.default_rng(4)
    parts = random_parts(rng, 8)
    size = parts.rows.max() + 1
    # Room for six blocks of two columns and their rows, and for no hundred columns beside them.
    monkeypatch.setattr(regressor_cache, "MOST_BYTES", 300 * size)
    current = rng.normal(size=size)
    cache = RegressorCache()

    def drawn(columns=2):
        return rng.normal(size=(size, columns))

    blocks = [cache.columns(key, drawn) for key in range(6)]
    for beside in ([], [drawn(100)], []):
        cache.sums([*blocks, *beside], current, parts, True)
    kept = blocks.pop()
    places = [id(block) for block in blocks]
    del blocks, beside
    others = [drawn() for _ in range(100)]
    again = [other for other in others if id(other) in places]
    check(cache.sums([*again, kept], current, parts, True), [*again, kept], current, parts)


def test_what_follows_the_model_is_forgotten_and_the_rest_stays():
    rng = np.random.default_rng(5)
    parts = random_parts(rng, 8)
    size = parts.rows.max() + 1
    current, cache, computed = rng.normal(size=size), RegressorCache(), []

    def drawn():
        computed.append(1)
        return rng.normal(size=(size, 2))

    follows = drawn()
    gone = weakref.ref(follows)
    for beside in ([follows], []):
        cache.sums([cache.columns("stays", drawn), *beside], current, parts, True)
    del follows, beside
    assert gone() is None
    assert len(computed) == 2


def test_one_in_some_rows_is_that_of_the_parts_rows():
    parts = random_parts(np.random.default_rng(6), 8)
    block = np.random.default_rng(7).normal(size=(parts.rows.max() + 1, 3))
    some = RegressorCache().rows(block, parts, True, 4)
    assert some.tolist() == block[parts.rows[::4]].tolist()
