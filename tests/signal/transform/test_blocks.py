"""Overlapping blocks against cutting the whole, reflected series."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.signal.transform.blocks import OverlappingBlocks


def blocks_of_whole(x, core, overlap):
    if not x.size:
        return []
    n_blocks = -(-x.size // core)
    after = n_blocks * core + overlap - x.size
    padded = np.pad(x, (overlap, after), mode="reflect" if x.size > 1 else "edge")
    return [padded[i * core : (i + 1) * core + 2 * overlap] for i in range(n_blocks)]


@settings(max_examples=200)
@given(
    st.lists(st.integers(0, 40), max_size=8),
    st.integers(1, 17),
    st.integers(0, 12),
)
def test_any_pieces_give_the_blocks_of_the_whole(pieces, core, overlap):
    n = sum(pieces)
    x = np.arange(n, dtype=np.float32)
    stream = OverlappingBlocks(core, overlap)
    found = []
    start = 0
    for piece in pieces:
        found += list(stream.push(x[start : start + piece]))
        start += piece
    found += list(stream.finish())

    expected = blocks_of_whole(x, core, overlap)
    assert [b.start for b in found] == [i * core for i in range(len(expected))]
    assert sum(b.n_valid for b in found) == n
    for block, whole in zip(found, expected, strict=True):
        assert block.samples.size == core + 2 * overlap
        useful = overlap + block.n_valid + overlap  # beyond, no valid sample looks
        if n > overlap:
            assert np.array_equal(block.samples[:useful], whole[:useful])


@pytest.mark.parametrize("n", [1, 2, 3])
def test_shorter_than_the_overlap_is_reflected_again_and_again(n):
    stream = OverlappingBlocks(8, 20)
    assert list(stream.push(np.arange(n, dtype=np.float64))) == []
    (block,) = stream.finish()
    assert block.samples.size == 48
    assert block.n_valid == n
    assert np.array_equal(block.samples[20 : 20 + n], np.arange(n))
    assert np.isfinite(block.samples).all()
