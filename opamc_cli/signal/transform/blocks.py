"""Cut a stream of samples into blocks that overlap, on a grid of absolute positions.

Because the grid does not depend on how the samples arrive, neither does any result that is
computed block by block.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Block:
    """One block: `samples[overlap : overlap + n_valid]` begin at absolute position `start`."""

    start: int
    samples: NDArray[np.floating]
    n_valid: int


class OverlappingBlocks:
    """Overlap-save blocks of a stream of unknown length.

    Block i carries the samples from i·core - overlap to (i+1)·core + overlap. Edge rule: before
    the first and after the last sample the stream is continued by its even reflection.

    Parameters
    ----------
    core : int
        Samples by which successive blocks advance, at least 1.
    overlap : int
        Samples of context on each side, at least 0.
    """

    def __init__(self, core: int, overlap: int) -> None:
        self.core = core
        self.overlap = overlap
        self._next_start = 0
        self._held: NDArray[np.floating] | None = None  # from next_start - overlap, or from 0

    @property
    def length(self) -> int:
        """Samples in a block."""
        return self.core + 2 * self.overlap

    def push(self, x: NDArray[np.floating]) -> Iterator[Block]:
        """Take the samples that follow, give the blocks that they complete."""
        held = x if self._held is None else np.concatenate([self._held, x])
        position = 0
        while True:
            missing = self._reflected_before()
            need = self.length - missing
            if held.size - position < need:
                break
            samples = held[position : position + need]
            if missing:
                samples = _reflect(samples, missing, 0)
            yield Block(self._next_start, samples, self.core)
            before = max(0, self._next_start - self.overlap)
            self._next_start += self.core
            position += max(0, self._next_start - self.overlap) - before
        self._held = held[position:].copy()

    def finish(self) -> Iterator[Block]:
        """Give the blocks that the end of the stream completes."""
        held = self._held
        self._held = None
        if held is None or not held.size:
            return
        first = max(0, self._next_start - self.overlap)
        end = first + held.size
        while self._next_start < end:
            missing = self._reflected_before()
            position = max(0, self._next_start - self.overlap) - first
            samples = held[position : position + self.length - missing]
            padded = _reflect(samples, missing, self.length - missing - samples.size)
            yield Block(self._next_start, padded, min(self.core, end - self._next_start))
            self._next_start += self.core

    def _reflected_before(self) -> int:
        return max(0, self.overlap - self._next_start)


def _reflect(x: NDArray[np.floating], before: int, after: int) -> NDArray[np.floating]:
    if x.size == 1:  # a single sample has nothing to reflect but itself
        return np.pad(x, (before, after), mode="edge")
    return np.pad(x, (before, after), mode="reflect")
