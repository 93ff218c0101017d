"""Which samples stand or fall together: cycles, recordings or blocks, and which are sealed."""

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from opamc_cli.joint.motion.track import Bools, Floats, Ints

REPEAT_ERROR = 0.02
LONGEST_SHARE = 0.7
SEALED_SHARE = 0.27
BLOCKS_WITHOUT_CYCLES = 12
SEALED_BLOCKS = (2, 5, 9)
"""Neither the first nor the last, and not evenly spaced: of a programme of four motions that was
run three times, every fourth block is the same motion, which nothing open would have shown."""
FEWEST_GROUPS = 4
"""Sealed as wholes: of two, a way there and a way back, one alone would show no friction."""
FEWEST_PER_BLOCK = 20
"""Samples: some four per coefficient of the declared effects."""
FEWEST_MOVING = BLOCKS_WITHOUT_CYCLES * FEWEST_PER_BLOCK


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


def cycle_length(*paths: Floats) -> int | None:
    """Shortest lag, in samples, at which the speed (or position) of a recording repeats itself.

    None where it does not. A lag counts if the mean square of ``path[t + lag] - path[t]`` is below
    2 % of twice the variance, up to 70 % of the recording; of such neighbours the best. Of several
    joints' paths, (n,) each, all have to repeat themselves at once.
    """
    n, variances = paths[0].size, [float(np.var(path)) for path in paths]
    if n < 16 or min(variances) <= 0:
        return None
    every = [_mismatch(path) / (2 * of) for path, of in zip(paths, variances, strict=True)]
    mismatch = np.max(every, axis=0)[: int(n * LONGEST_SHARE)]
    # Everything looks alike at short lags: first leave that neighbourhood.
    away = int(np.argmax(mismatch > 0.5))
    alike = np.flatnonzero(mismatch[away:] < REPEAT_ERROR) + away
    if not away or not alike.size:
        return None
    near = mismatch[alike[0] : alike[0] + alike[0] // 10 + 1]
    return int(alike[0] + np.argmin(near))


def _mismatch(path: Floats) -> Floats:
    """Mean square of ``path[t + lag] - path[t]`` for every lag below n, by one correlation."""
    n = path.size
    centred = path - path.mean()
    length = next_fast_len(2 * n, real=True)
    products = irfft(np.abs(rfft(centred, length)) ** 2, length)[:n]
    squares = np.concatenate([[0.0], np.cumsum(centred**2)])
    lags = np.arange(n)
    overlap = n - lags
    return np.asarray((squares[overlap] + squares[n] - squares[lags] - 2 * products) / overlap)


def group_samples(
    moving: Bools,
    bounds: tuple[tuple[int, int], ...],
    period: int | None,
    rate_hz: float,
    run_names: tuple[str, ...],
) -> Grouping | None:
    """Split recordings into groups and seal some of them, before anything else is looked at.

    Of moving samples, bool (n,); `period` is that of a cycle, if the motion repeats. None where too
    little moves to seal anything off. The last 27 % of the cycles of each recording are
    sealed, if each holds four or more, else the third, sixth and tenth of every twelve cycles or
    recordings. Fewer than four are cut into blocks of equal moving time, of which a quarter is
    sealed, since the end of a single stroke would be a place that the fit has never seen.
    """
    group = np.full(moving.size, -1, dtype=np.int64)
    pieces: list[tuple[int, int, int, str]] = []  # run, start, stop, name
    for run, (start, stop) in enumerate(bounds):
        if period is not None and stop - start >= 2 * period:
            cycles = (stop - start + period // 20) // period
            for cycle in range(cycles):
                end = start + (cycle + 1) * period if cycle + 1 < cycles else stop
                pieces.append((run, start + cycle * period, end, f"{run_names[run]}:{cycle}"))
        else:
            pieces.append((run, start, stop, run_names[run]))
    needed = 0.1 * rate_hz
    pieces = [piece for piece in pieces if moving[piece[1] : piece[2]].sum() >= needed]
    if len(pieces) < FEWEST_GROUPS:
        return _blocks(moving, bounds, run_names)
    for number, (_, start, stop, _) in enumerate(pieces):
        group[start:stop] = number
    kind = "cycles" if period is not None else "recordings"
    names = tuple(name for *_, name in pieces)
    return Grouping(group, names, _sealed([run for run, *_ in pieces]), kind)


def _sealed(runs: list[int]) -> tuple[int, ...]:
    """Which pieces are sealed: the last of each run, if each has four or more, else as of blocks.

    The last runs may be all that there is of a speed, or a program: of ten runs of a joint at three
    speeds all of the third were sealed, and every line was taken back that the others had shown.
    """
    batches = [np.flatnonzero(np.equal(runs, run)) for run in dict.fromkeys(runs)]
    if min(batch.size for batch in batches) < 4:
        return tuple(k for k in range(len(runs)) if k % BLOCKS_WITHOUT_CYCLES in SEALED_BLOCKS)
    last = [batch[-max(round(SEALED_SHARE * batch.size), 1) :] for batch in batches]
    return tuple(np.sort(np.concatenate(last)).tolist())


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
        count = max(round(BLOCKS_WITHOUT_CYCLES * own.size / indices.size), 1)
        for chunk in np.array_split(own, count):
            if chunk.size:
                group[chunk[0] : chunk[-1] + 1] = len(names)
                names.append(f"{name}:block{len(names)}")
    return Grouping(group, tuple(names), SEALED_BLOCKS, "blocks")
