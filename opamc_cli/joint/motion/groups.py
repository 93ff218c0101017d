"""Which samples stand or fall together: cycles, recordings or blocks, and which are sealed."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.joint.motion.track import Bools, Ints

BLOCKS = 12
FEWEST_CYCLES = 6
"""Two of six are sealed: nothing tells when a payload changed in a sealed one, and if it is all
that is sealed, half of that is predicted by the wrong one."""
SEALED_BLOCKS = (2, 5, 9)
"""Of every twelve. Neither the first nor the last, and not evenly spaced: of a programme of four
motions that was run three times, every fourth block is the same motion, which nothing open would
have shown, and the last may be all that there is of a payload, a temperature or a speed: where it
would be sealed, the one before it is."""
FEWEST_RUNS = 4
"""Sealed as wholes: of two, a way there and a way back, one alone would show no friction."""
FEWEST_MOVING = 20 * BLOCKS
"""Samples: in a block some four per coefficient of the declared effects."""


@dataclass(frozen=True)
class Grouping:
    """Groups of samples that are left out as one, and the sealed ones among them."""

    group: Ints
    """Group of each sample, -1 outside all groups; int array of shape (n,)."""
    names: tuple[str, ...]
    """Name of each group, for people."""
    sealed: tuple[int, ...]
    """Groups that nothing looks at before the end."""
    kind: str
    """"cycles", "recordings" or "blocks"."""

    @property
    def open(self) -> tuple[int, ...]:
        """Groups that may be looked at before the end."""
        return tuple(g for g in range(len(self.names)) if g not in self.sealed)


def group_samples(
    moving: Bools,
    bounds: tuple[tuple[int, int], ...],
    period: int | None,
    rate_hz: float,
    run_names: tuple[str, ...],
) -> Grouping | None:
    """Split recordings into groups and seal some of them, before anything else is looked at.

    Of moving samples, bool (n,); `period` is that of a cycle, if the motion repeats. None where too
    little moves to seal anything off. Groups are cycles, if there are six; else runs, if there are
    four; else blocks of equal moving time. Of every twelve the third, sixth and tenth are sealed.
    """
    runs = [(start, stop, name) for (start, stop), name in zip(bounds, run_names, strict=True)]
    cycles = [] if period is None else [one for run in runs for one in _cycles(*run, period)]
    kinds = ("cycles", cycles, FEWEST_CYCLES), ("recordings", runs, FEWEST_RUNS)
    for kind, pieces, fewest in kinds:
        moves = [piece for piece in pieces if moving[piece[0] : piece[1]].sum() >= 0.1 * rate_hz]
        if len(moves) >= fewest:
            group = np.full(moving.size, -1, dtype=np.int64)
            for number, (start, stop, _) in enumerate(moves):
                group[start:stop] = number
            return Grouping(group, tuple(name for *_, name in moves), _sealed(len(moves)), kind)
    return _blocks(moving, bounds, run_names)


def _cycles(start: int, stop: int, name: str, period: int) -> list[tuple[int, int, str]]:
    count = max((stop - start + period // 20) // period, 1)
    ends = [*(start + np.arange(1, count) * period).tolist(), stop]
    begins = [start, *ends[:-1]]
    return [(*span, f"{name}:{k}") for k, span in enumerate(zip(begins, ends, strict=True))]


def _sealed(count: int) -> tuple[int, ...]:
    return tuple(min(k, count - 2) for k in range(count) if k % BLOCKS in SEALED_BLOCKS)


def _blocks(
    moving: Bools, bounds: tuple[tuple[int, int], ...], run_names: tuple[str, ...]
) -> Grouping | None:
    indices = np.flatnonzero(moving)
    if indices.size < FEWEST_MOVING:
        return None
    group = np.full(moving.size, -1, dtype=np.int64)
    names: list[str] = []
    for name, (start, stop) in zip(run_names, bounds, strict=True):
        own = indices[np.searchsorted(indices, start) : np.searchsorted(indices, stop)]
        count = max(round(BLOCKS * own.size / indices.size), 1)
        for chunk in np.array_split(own, count):
            if chunk.size:
                group[chunk[0] : chunk[-1] + 1] = len(names)
                names.append(f"{name}:block{len(names)}")
    return Grouping(group, tuple(names), _sealed(len(names)), "blocks")
