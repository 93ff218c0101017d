"""Ordinal patterns of a time series, counted for several orders in one pass."""

from collections.abc import Iterable
from math import factorial, floor, isfinite

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.ordinal.kernels import count_codes, encode

MIN_ORDER = 2
MAX_ORDER = 7


def time_delay(fs_hz: float, f_max_hz: float, order: int, gamma: float = 2.0) -> int:
    """Delay τ between the elements of a pattern, so that it spans γ carrier periods.

    Halves round up, as in the toolbox of the source; the result is at least 1.

    Parameters
    ----------
    fs_hz : float
        Sampling rate, > 0, Hz.
    f_max_hz : float
        Largest fundamental frequency of the motion, > 0, Hz.
    order : int
        Order α of the pattern, 2..7.
    gamma : float
        Carrier periods that the window (α-1)τ spans, > 0.

    Returns
    -------
    int
        τ in samples, at least 1.

    Raises
    ------
    ValueError
        If a rate, a frequency or γ is not positive and finite, or the order is out of range.

    Notes
    -----
    Equation (4-2) of the thesis.

    Examples
    --------
    >>> [time_delay(2048, f, 5, 2) for f in (68, 157, 314)]
    [15, 7, 3]
    """
    _check_order(order)
    for name, value in (("fs_hz", fs_hz), ("f_max_hz", f_max_hz), ("gamma", gamma)):
        if not (isfinite(value) and value > 0):
            msg = f"{name} must be positive and finite, got {value}"
            raise ValueError(msg)
    return max(1, floor(fs_hz / (f_max_hz * (order - 1)) * gamma + 0.5))


def n_windows(n_samples: int, order: int, tau: int) -> int:
    """Patterns that `n_samples` samples hold: N - (α-1)τ, or 0 if that is negative."""
    return max(0, n_samples - (order - 1) * tau)


def ordinal_counts(
    x: NDArray[np.floating], orders: Iterable[int], tau: int
) -> dict[int, NDArray[np.int64]]:
    """Count the ordinal patterns of every order asked for.

    Ties keep time order (the earlier of two equal values counts as the smaller one). A pattern
    that touches a NaN is not counted; how many there were is `n_windows(x.size, order, tau)`
    less the sum of the counts. Infinities are ordered like any other value. A series too short
    for one pattern gives zeros.

    Parameters
    ----------
    x : array, shape (n,), float32 or float64
        Equally spaced samples, any unit.
    orders : iterable of int
        Orders α, each 2..7.
    tau : int
        Delay between the elements of a pattern, samples, at least 1.

    Returns
    -------
    dict of int to array of int64, shape (α!,)
        For every order the count of each code; see `pattern_of_code` for a code's meaning.

    Raises
    ------
    ValueError
        If `x` is not one-dimensional, τ is below 1, or an order is out of range.

    Notes
    -----
    Equation (2-6) of the thesis; Bandt and Pompe, 2002. The code is the Lehmer code of the
    ranks, so that an order's code modulo (α-1)! is the code of the next lower order one delay
    later. The lower orders are therefore sums over the highest order's counts, plus the few
    patterns that start within the first τ samples, and cost nothing beside it.
    """
    wanted = sorted(set(orders))
    for order in wanted:
        _check_order(order)
    samples = _series(x, tau)
    if not wanted:
        return {}
    if samples.size and np.isnan(samples.min()):  # one pass, no temporary
        # The lower orders cannot be summed from the highest one here: a pattern free of NaN may
        # be the tail of one that is not.
        return {order: _counts_with_gaps(samples, order, tau) for order in wanted}

    top = wanted[-1]
    counts = {top: _counts_clean(samples, top, tau)}
    for order in range(top - 1, wanted[0] - 1, -1):
        tails = counts[order + 1].reshape(order + 1, factorial(order)).sum(axis=0)
        counts[order] = tails + _counts_clean(samples[: order * tau], order, tau)
    return {order: counts[order] for order in wanted}


def ordinal_codes(x: NDArray[np.floating], order: int, tau: int) -> NDArray[np.int16]:
    """Code of the pattern that starts at each sample.

    Parameters
    ----------
    x : array, shape (n,)
        Equally spaced samples, any unit.
    order : int
        Order α, 2..7.
    tau : int
        Delay, samples, at least 1.

    Returns
    -------
    array of int16, shape (max(0, n - (α-1)τ),)
        Codes 0 .. α!-1, or -1 where the pattern touches a NaN. Ties keep time order.

    Raises
    ------
    ValueError
        If `x` is not one-dimensional, τ is below 1, or the order is out of range.

    Notes
    -----
    Equation (2-6) of the thesis.
    """
    _check_order(order)
    samples = _series(x, tau)
    n = n_windows(samples.size, order, tau)
    codes: NDArray[np.int16] = np.zeros(n, dtype=np.int16)
    if n:
        encode(samples, np.isnan(samples), order, tau, codes)
    return codes


def pattern_of_code(code: int, order: int) -> tuple[int, ...]:
    """Permutation (r_1, …, r_α) that sorts the pattern ascending, counted from 1.

    Parameters
    ----------
    code : int
        0 .. α!-1, as counted by `ordinal_counts`.
    order : int
        Order α, 2..7.

    Returns
    -------
    tuple of int, length α
        The positions of the elements from the smallest to the largest.

    Raises
    ------
    ValueError
        If the code or the order is out of range.

    Notes
    -----
    Equation (2-6) of the thesis, with r = 1 for y_t itself: its index runs one too far, as its
    own worked example shows.

    Examples
    --------
    >>> y = np.array([-0.11, 1.77, -1.92, 1.77, -0.79])
    >>> pattern_of_code(int(ordinal_codes(y, 5, 1)[0]), 5)
    (3, 5, 1, 2, 4)
    """
    _check_order(order)
    if not 0 <= code < factorial(order):
        msg = f"code must be in 0..{factorial(order) - 1} for order {order}, got {code}"
        raise ValueError(msg)
    free = list(range(order))
    position_of_rank = [0] * order
    rest = code
    for position in range(order):
        smaller_later, rest = divmod(rest, factorial(order - 1 - position))
        position_of_rank[free.pop(smaller_later)] = position + 1
    return tuple(position_of_rank)


def _counts_clean(x: NDArray[np.floating], order: int, tau: int) -> NDArray[np.int64]:
    if not n_windows(x.size, order, tau):
        return np.zeros(factorial(order), dtype=np.int64)
    return count_codes(x, order, tau)


def _counts_with_gaps(x: NDArray[np.floating], order: int, tau: int) -> NDArray[np.int64]:
    codes = ordinal_codes(x, order, tau)
    return np.bincount(codes[codes >= 0], minlength=factorial(order)).astype(np.int64)


def _series(x: NDArray[np.floating], tau: int) -> NDArray[np.floating]:
    samples = np.asarray(x)
    if samples.ndim != 1:
        msg = f"x must have one dimension, got {samples.ndim}"
        raise ValueError(msg)
    if tau < 1:
        msg = f"tau must be at least 1, got {tau}"
        raise ValueError(msg)
    if samples.dtype not in (np.float32, np.float64):
        samples = samples.astype(np.float64)
    return np.ascontiguousarray(samples)


def _check_order(order: int) -> None:
    if not MIN_ORDER <= order <= MAX_ORDER:
        msg = f"order must be in {MIN_ORDER}..{MAX_ORDER}, got {order}"
        raise ValueError(msg)
