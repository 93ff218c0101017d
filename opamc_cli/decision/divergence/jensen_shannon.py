"""Divergence between ordinal-pattern distributions, and what chance alone makes of it."""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln, xlogy

FloatArray = NDArray[np.float64]

MOST_SIZES = 32
"""Pairs of sizes that stand in for more."""


def normalise(counts: ArrayLike) -> FloatArray:
    """Turn counts into probabilities along the last axis.

    Parameters
    ----------
    counts : array_like, shape (..., K)
        Counts or unnormalised probabilities, not negative.

    Returns
    -------
    ndarray, shape (..., K)
        Rows that sum to one; a row without any count becomes NaN.
    """
    values = np.asarray(counts, dtype=np.float64)
    totals = values.sum(axis=-1, keepdims=True)
    rows: FloatArray = np.divide(values, totals, out=np.full_like(values, np.nan), where=totals > 0)
    return rows


def divergence_by_cell(p: ArrayLike, q: ArrayLike, base: float = 2.0) -> FloatArray:
    """Contribution of each pattern to the Jensen-Shannon divergence.

    Parameters
    ----------
    p, q : array_like, shape (..., K)
        Counts or probabilities, broadcast against each other; rows are normalised.
    base : float, default 2
        Base of the logarithm.

    Returns
    -------
    ndarray, shape (..., K)
        Not negative in any cell; the sum over the last axis is the divergence.
    """
    p_rows, q_rows = np.broadcast_arrays(normalise(p), normalise(q))
    middle = 0.5 * (p_rows + q_rows)
    half = 0.5 * (p_rows - q_rows)
    ratio = np.divide(half, middle, out=np.zeros_like(middle), where=middle > 0)
    # With p = m + d and q = m - d each cell is a sum that is not negative term by term, so equal
    # rows give exactly zero; the difference of entropies would leave rounding noise instead.
    one_sided = np.abs(ratio) >= 1.0
    inner = np.where(one_sided, 0.0, ratio)
    cells = 0.5 * middle * ((1 + inner) * np.log1p(inner) + (1 - inner) * np.log1p(-inner))
    cells = np.where(one_sided, middle * math.log(2.0), cells) + 0.0 * middle
    return np.asarray(np.maximum(cells, 0.0) / math.log(base))


def jensen_shannon(p: ArrayLike, q: ArrayLike, base: float = 2.0) -> Any:
    """Jensen-Shannon divergence (not its square root), row by row.

    Parameters
    ----------
    p, q : array_like, shape (..., K)
        Counts or probabilities, broadcast against each other; rows are normalised.
    base : float, default 2
        Base of the logarithm; with 2 the divergence lies in 0..1.

    Returns
    -------
    float or ndarray, shape (...)
        In 0..log(2)/log(base); NaN where a row has no counts.

    Notes
    -----
    Thesis (2021), equations (2-8) and (2-9); J. Lin, 1991. The thesis calls the divergence a
    metric (2.5.1): its square root is.
    """
    return divergence_by_cell(p, q, base).sum(axis=-1)


@cache
def _chance_share() -> tuple[FloatArray, FloatArray]:
    """Tabulate a cell's mean divergence, per probability and in nats, by its expected count.

    For k ~ Poisson(λ) the mean of ½[r·log(2r/(1+r)) + log(2/(1+r))] at r = k/λ, tabulated over
    log λ up to 100; beyond that the second-order term 1/(8λ) is right to half a percent.
    """
    expected = np.logspace(-4, 2, 241)[:, np.newaxis]
    hits = np.arange(0.0, 260.0)
    ratio = hits / expected
    gain = np.log(2 / (1 + ratio)) + xlogy(ratio, 2 * ratio / (1 + ratio))
    weight = np.exp(xlogy(hits, expected) - expected - gammaln(hits + 1))
    return np.log(expected[:, 0]), 0.5 * (weight * gain).sum(axis=1)


def chance_divergence(
    pool: ArrayLike, n_segment: ArrayLike, n_pool: ArrayLike, base: float = 2.0
) -> Any:
    """Jensen-Shannon divergence that independent draws from one distribution would show.

    Parameters
    ----------
    pool : array_like, shape (K,)
        Counts or probabilities that stand for the common distribution.
    n_segment, n_pool : array_like
        Numbers of independent patterns in the two samples, broadcast against each other.
    base : float, default 2
        Base of the logarithm.

    Returns
    -------
    float or ndarray
        Expected divergence, in the units of `base`.

    Notes
    -----
    A cell of probability m is expected to be hit λ = m / (1/n₁ + 1/n₂) times; its mean divergence
    is that of a Poisson count of mean λ from a known rate. Where λ is large this is the
    second-order term (1 - m)/8 · (1/n₁ + 1/n₂) of I. Grosse et al. (Phys. Rev. E 65, 2002,
    041905), which is several times too large for cells that are hardly ever hit.
    """
    pmf = normalise(pool)
    rate = 1.0 / np.asarray(n_segment, dtype=np.float64) + 1.0 / np.asarray(
        n_pool, dtype=np.float64
    )
    expected = np.maximum(pmf / rate[..., np.newaxis], 1e-4)
    log_expected, share = _chance_share()
    cells = np.where(
        expected < 100.0, np.interp(np.log(expected), log_expected, share), 0.125 / expected
    )
    return (cells * pmf * (1.0 - pmf)).sum(axis=-1) / math.log(base)


def leave_cycle_out_divergences(
    counts_by_segment: ArrayLike, cycle_of_segment: ArrayLike, base: float = 2.0
) -> FloatArray:
    """Divergence of each segment from the pool of all segments of other cycles.

    Parameters
    ----------
    counts_by_segment : array_like, shape (S, K)
        Pattern counts of the segments of one axis, motion and order.
    cycle_of_segment : array_like, shape (S,)
        Label of the cycle, or of the session, that each segment belongs to.
    base : float, default 2
        Base of the logarithm.

    Returns
    -------
    ndarray, shape (S,)
        NaN for a segment whose cycle is the only one.

    Notes
    -----
    Deviates from the thesis (4.3.2), which compares a normal segment with a pool that holds it:
    the normal state then looks better than it is, the more so the fewer the cycles.
    """
    counts = np.asarray(counts_by_segment, dtype=np.float64)
    _, place = np.unique(np.asarray(cycle_of_segment), return_inverse=True)
    by_cycle = np.zeros((place.max(initial=-1) + 1, counts.shape[1]))
    np.add.at(by_cycle, place, counts)
    rest = counts.sum(axis=0) - by_cycle
    return np.asarray(jensen_shannon(counts, rest[place], base), dtype=np.float64)


def divergences_from_pool(
    counts_by_segment: ArrayLike, pool_counts: ArrayLike, base: float = 2.0
) -> FloatArray:
    """Divergence of each target segment from the whole baseline pool.

    Parameters
    ----------
    counts_by_segment : array_like, shape (S, K)
        Pattern counts of the target's segments.
    pool_counts : array_like, shape (K,) or (B, K)
        Pooled baseline counts, or the baseline's segments to be pooled.
    base : float, default 2
        Base of the logarithm.

    Returns
    -------
    ndarray, shape (S,)
    """
    pool = np.atleast_2d(np.asarray(pool_counts, dtype=np.float64)).sum(axis=0)
    counts = np.asarray(counts_by_segment, dtype=np.float64)
    return np.asarray(jensen_shannon(counts, pool, base), dtype=np.float64)


def chance_inflation(
    divergences: ArrayLike, pool: ArrayLike, n_segment: ArrayLike, n_pool: ArrayLike
) -> float:
    """How many times more a baseline scatters than independent patterns would.

    Overlapping patterns of an autocorrelated envelope are not independent: N of them are worth
    N/φ. φ makes `chance_divergence` at N/φ counts equal the baseline's own mean leave-cycle-out
    divergence.

    Parameters
    ----------
    divergences : array_like, shape (S,)
        Leave-cycle-out divergences of the baseline, bit; NaN entries are passed over.
    pool : array_like, shape (K,)
        The baseline's pooled counts.
    n_segment, n_pool : array_like, shape (S,)
        Pattern counts of each segment and of the pool it was compared with.

    Returns
    -------
    float
        φ, from 0.001 to the largest segment's count; NaN if no divergence is finite.

    Notes
    -----
    The first-order correction of J. N. K. Rao and A. J. Scott (JASA 76, 1981) for counts from
    clustered samples. Counting N/φ patterns makes the baseline's mean excess zero and carries
    over to targets of any length, so that unequal counts are compared fairly.
    """
    values, segment, rest = (
        np.ravel(side)
        for side in np.broadcast_arrays(
            np.asarray(divergences, dtype=np.float64),
            np.asarray(n_segment, dtype=np.float64),
            np.asarray(n_pool, dtype=np.float64),
        )
    )
    usable = np.isfinite(values) & (segment > 0) & (rest > 0)
    if not usable.any():
        return math.nan
    observed = float(values[usable].mean())
    sizes, weights = _few_sizes(segment[usable], rest[usable])

    def above(log_inflation: float) -> float:
        inflation = math.exp(log_inflation)
        by_size = chance_divergence(pool, sizes[0] / inflation, sizes[1] / inflation)
        return math.log(float(weights @ by_size) / float(weights.sum()) / observed)

    low, high = 1e-3, float(segment[usable].max())
    if observed <= 0.0 or above(math.log(low)) >= 0.0:
        return low
    if above(math.log(high)) <= 0.0:
        return high
    return math.exp(_zero(above, math.log(low), math.log(high)))


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Return, to 1e-6, where a function that grows from `low` to `high` is zero.

    C. J. F. Ridders (IEEE Trans. Circuits Syst. 26, 1979, 979): it needs no derivative, cannot run
    away, and two calls halve the interval at least. Chance over φ is nearly a line by logarithms:
    ten calls find what bisection needed 26 for, which was a third of a decision.
    """
    at_low, at_high = function(low), function(high)
    last = math.inf
    while True:
        middle = 0.5 * (low + high)
        at_middle = function(middle)
        if at_middle == 0.0:
            return middle
        found = middle - (middle - low) * at_middle / math.sqrt(at_middle**2 - at_low * at_high)
        if abs(found - last) <= 1e-6 or high - low <= 1e-6:
            return found
        last, at_found = found, function(found)
        for place, value in ((middle, at_middle), (found, at_found)):
            if value < 0.0 and place > low:
                low, at_low = place, value
            elif value >= 0.0 and place < high:
                high, at_high = place, value


def _few_sizes(segment: FloatArray, rest: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Stand a few pairs of sizes in for many: chance hardly differs between close ones."""
    if len(segment) <= MOST_SIZES:
        return np.array([segment, rest]), np.ones(len(segment))
    order = np.argsort(1 / segment + 1 / rest, kind="stable")
    groups = np.array_split(order, MOST_SIZES)
    sizes = np.array([[segment[g].mean(), rest[g].mean()] for g in groups]).T
    return sizes, np.array([len(g) for g in groups], dtype=np.float64)


def effect_size(excess: ArrayLike) -> FloatArray:
    """Root-mean-square relative change of the pattern probabilities (Cohen's w).

    Parameters
    ----------
    excess : array_like, shape (...)
        Excess Jensen-Shannon divergence, bit; negative values count as none.

    Returns
    -------
    ndarray, shape (...)
        w = sqrt(8·JSD in nats), from JSD ≈ w²/8. By convention 0.1 is small, 0.3 medium and 0.5
        large (J. Cohen, Statistical Power Analysis for the Behavioral Sciences, 1988, 7.2).
    """
    nats = np.maximum(np.asarray(excess, dtype=np.float64), 0.0) * math.log(2.0)
    return np.asarray(np.sqrt(8.0 * nats))
