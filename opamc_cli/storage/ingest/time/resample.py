"""Unevenly stamped samples onto a uniform grid, block by block.

Between two samples the value is that of the cubic through the four nearest samples where these
are about a period apart (0.5 to 1.5 periods), else of the line through the two beside it. Linear
interpolation alone would cost a carrier at a seventh of the sampling rate up to 10 % of its
amplitude, the cubic 2 %. Longer steps than `max_gap_s` stay NaN: no values are invented.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from opamc_cli.storage.ingest.source import Block

Float = npt.NDArray[np.float64]

AT_SAMPLE = 1e-3
"""A grid point this near to a sample, in periods, is the sample, even beside a gap."""


def resample(
    blocks: Iterator[tuple[Float, Block]],
    start_s: float,
    rate_hz: float,
    n_samples: int,
    max_gap_s: float,
    cubic: bool = True,
) -> Iterator[Block]:
    """Yield samples at start_s + k / rate_hz, k = 0 .. n_samples - 1.

    Parameters
    ----------
    blocks
        (strictly increasing stamps in s, columns of float64), in order.
    start_s, rate_hz, n_samples
        The grid.
    max_gap_s
        Longest step that is interpolated across.
    cubic
        False: linear everywhere.
    """
    held_s: Float = np.empty(0)
    held: Block = {}
    done = 0
    for times_s, block in blocks:
        held_s = np.concatenate([held_s, times_s])
        held = {n: np.concatenate([held[n], v]) if n in held else v for n, v in block.items()}
        if len(held_s) < 4:
            continue
        # a grid point is final once two samples after it are known
        stop = min(n_samples, int(np.ceil((held_s[-2] - start_s) * rate_hz)))
        if stop > done:
            grid_s = start_s + np.arange(done, stop) / rate_hz
            yield _interpolated(held_s, held, grid_s, 1 / rate_hz, max_gap_s, cubic)
            done = stop
        first = max(int(np.searchsorted(held_s, start_s + done / rate_hz, "right")) - 3, 0)
        held_s, held = held_s[first:], {name: values[first:] for name, values in held.items()}
    if done < n_samples:
        grid_s = start_s + np.arange(done, n_samples) / rate_hz
        yield _interpolated(held_s, held, grid_s, 1 / rate_hz, max_gap_s, cubic)


def _interpolated(
    times_s: Float, columns: Block, grid_s: Float, period_s: float, max_gap_s: float, cubic: bool
) -> Block:
    last = len(times_s) - 1
    left = np.clip(np.searchsorted(times_s, grid_s, "right") - 1, 0, last - 1)
    step = times_s[left + 1] - times_s[left]
    into = np.clip((grid_s - times_s[left]) / step, 0.0, 1.0)
    near_left = into * step <= AT_SAMPLE * period_s
    near_right = (1 - into) * step <= AT_SAMPLE * period_s
    gap = (step > max_gap_s) & ~near_left & ~near_right
    weights, nodes, smooth = _lagrange(times_s, grid_s, left, period_s)
    result: Block = {}
    for name, values in columns.items():
        before, after = values[left], values[left + 1]
        value = before + (after - before) * into
        if cubic:
            curved = sum(w * values[n] for w, n in zip(weights, nodes, strict=True))
            value = np.where(smooth & np.isfinite(curved), curved, value)
        value = np.where(near_left, before, np.where(near_right, after, value))
        result[name] = np.where(gap, np.nan, value)
    return result


def _lagrange(
    times_s: Float, grid_s: Float, left: npt.NDArray[np.intp], period_s: float
) -> tuple[list[Float], list[npt.NDArray[np.intp]], npt.NDArray[np.bool_]]:
    """Return weights and indices of the four nearest samples, and where they may be used."""
    nodes = [np.clip(left + offset, 0, len(times_s) - 1) for offset in (-1, 0, 1, 2)]
    at = [times_s[node] for node in nodes]
    smooth = (left >= 1) & (left + 2 < len(times_s))
    for before, after in pairwise(at):
        step = after - before
        smooth &= (step >= 0.5 * period_s) & (step <= 1.5 * period_s)
    weights = []
    for i in range(4):
        weight = np.ones_like(grid_s)
        for j in range(4):
            if j != i:
                apart = np.where(at[i] == at[j], 1.0, at[i] - at[j])
                weight *= (grid_s - at[j]) / apart
        weights.append(weight)
    return weights, nodes, smooth
