"""Synchronisation of a segment with its reference by cross-correlation."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft

MIN_OVERLAP = 0.5
"""Least share of the shorter segment that must overlap at a lag for the lag to count."""

ROUNDING = 1e-12
"""It must not decide between lags that are equally good."""


@dataclass(frozen=True)
class Alignment:
    """The lag at which a segment fits its reference best."""

    lag: int
    """Samples by which the segment's content comes later than the reference's, counted from the
    starts of both: ``segment[i + lag]`` corresponds to ``reference[i]``."""
    correlation: float
    """Pearson correlation of the overlapping parts at this lag, 0..1."""


def align(
    reference: npt.NDArray[np.floating], segment: npt.NDArray[np.floating], max_lag: int
) -> Alignment:
    """Find the lag at which the reference segment explains the most.

    Equation (4-1) sums over the overlap alone, so that a larger overlap wins by its size, and a
    segment's height with it. Here each lag has the Pearson correlation r of the overlapping parts,
    and that of the largest -n log(1 - r^2) wins, n samples overlapping: the log likelihood that
    they gain by each other. By r alone half of a smooth motion may fit another part of it better
    than noise or friction let the whole fit itself. A lag with too little overlap or a negative
    correlation does not count. Segments may differ in length. Equal gains: the smallest lag in
    modulus wins, then the negative one. A constant or NaN-bearing segment has lag 0 and
    correlation 0.

    Parameters
    ----------
    reference
        Shape (n,), any unit.
    segment
        Shape (m,), the same unit and rate.
    max_lag
        Largest lag in modulus, samples, >= 0.

    Returns
    -------
    Alignment
        Lag and correlation.

    Notes
    -----
    Equation (4-1) of the thesis.
    """
    x = np.asarray(reference, dtype=np.float64)
    y = np.asarray(segment, dtype=np.float64)
    if x.size == 0 or y.size == 0:
        return Alignment(0, 0.0)
    x = x - x.mean()
    y = y - y.mean()
    # beyond the longer one's length nothing overlaps
    max_lag = min(max_lag, max(x.size, y.size))
    lags = np.arange(-max_lag, max_lag + 1)
    # overlap of reference samples i with segment samples i + lag
    first = np.maximum(0, -lags)
    last = np.minimum(x.size, y.size - lags)
    enough = last - first >= MIN_OVERLAP * min(x.size, y.size)
    if not enough.any():
        return Alignment(0, 0.0)
    lags, first, last = lags[enough], first[enough], last[enough]

    size = fft.next_fast_len(x.size + y.size, real=True)
    product = fft.irfft(np.conj(fft.rfft(x, size)) * fft.rfft(y, size), size)[lags % size]
    sum_x, energy_x = _between(x, first, last)
    sum_y, energy_y = _between(y, first + lags, last + lags)
    overlap = last - first
    spread_x = energy_x - sum_x * sum_x / overlap
    spread_y = energy_y - sum_y * sum_y / overlap
    # a part that is constant but for rounding has no correlation
    varies = (spread_x > 1e-9 * (x @ x)) & (spread_y > 1e-9 * (y @ y))
    norm = np.sqrt(np.where(varies, spread_x * spread_y, 1.0))
    correlation = np.where(varies, (product - sum_x * sum_y / overlap) / norm, 0.0)
    correlation = np.clip(np.nan_to_num(correlation), 0.0, 1.0)
    gain = -overlap * np.log(np.maximum(1 - correlation**2, ROUNDING))
    if not gain.any():
        return Alignment(0, 0.0)
    best = np.flatnonzero(gain >= gain.max() * (1 - ROUNDING))
    winner = best[np.argmin(np.abs(lags[best]))]
    return Alignment(int(lags[winner]), float(correlation[winner]))


def _between(
    values: npt.NDArray[np.float64], first: npt.NDArray[np.int64], last: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Sum the values and their squares over first..last (half-open)."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    squares = np.concatenate(([0.0], np.cumsum(values * values)))
    return total[last] - total[first], squares[last] - squares[first]
