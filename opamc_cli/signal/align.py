"""Lag of a segment against its reference, by the largest cross-correlation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

# Overlaps shorter than this share of the shorter segment are not compared: a handful of samples
# correlates with anything.
MIN_OVERLAP_SHARE = 0.5


@dataclass(frozen=True)
class Alignment:
    """Where a segment fits its reference best.

    Attributes
    ----------
    lag : int
        Samples by which the segment comes later than the reference: reference[i] matches
        segment[i + lag].
    correlation : float
        Correlation coefficient of the overlapping samples at that lag, -1..1.
    """

    lag: int
    correlation: float


def align(
    reference: NDArray[np.inexact], segment: NDArray[np.inexact], max_lag: int | None = None
) -> Alignment:
    """Find the lag with the largest normalised cross-correlation.

    Parameters
    ----------
    reference, segment : array, shapes (n,) and (m,), same unit
        Real or complex; n and m may differ. NaN counts as the mean.
    max_lag : int or None
        Largest abs(lag) to look at; None for all with an overlap of at least half the shorter
        one.

    Returns
    -------
    Alignment
        Lag 0 and correlation 0 if there is nothing to compare, or if one is constant. Of equal
        maxima the lag nearest to 0, then the negative one.

    Notes
    -----
    Equation (4-1) of the thesis, with two differences. Each lag's sum is divided by the norms of
    the samples that overlap, of which there are fewer at large lags; without that a short overlap
    loses to lag 0 for no other reason than being short, and a long one wins by its power. And the
    means are taken off, since an envelope is positive and would correlate at any lag. Of complex
    input the modulus of the sum counts: the electrical angle at which a motion starts is chance.
    """
    x = _centred(reference)
    y = _centred(segment)
    n, m = x.size, y.size
    shorter = min(n, m)
    if not shorter:
        return Alignment(0, 0.0)
    lags = np.arange(-(n - 1), m)
    overlap = np.minimum(n, m - lags) - np.maximum(0, -lags)
    allowed = overlap >= max(1, int(np.ceil(MIN_OVERLAP_SHARE * shorter)))
    if max_lag is not None:
        allowed &= np.abs(lags) <= max_lag
    if not allowed.any():
        return Alignment(0, 0.0)

    correlation = _correlate(x, y)
    power = np.sqrt(
        np.maximum(_power_overlapping_x(x, lags, m) * _power_overlapping_y(y, lags, n), 0)
    )
    total = np.sqrt(np.sum(np.abs(x) ** 2) * np.sum(np.abs(y) ** 2))
    # Where next to no power overlaps the quotient would be rounding noise.
    meaningful = allowed & (power > 1e-9 * total)
    if total == 0 or not meaningful.any():
        return Alignment(0, 0.0)
    coefficient = np.full(lags.size, -np.inf)
    coefficient[meaningful] = correlation[meaningful] / power[meaningful]
    # Rounding must not decide between equal maxima.
    best = np.flatnonzero(coefficient >= coefficient.max() - 1e-9)
    chosen = best[np.lexsort((lags[best], np.abs(lags[best])))[0]]
    return Alignment(int(lags[chosen]), float(np.clip(coefficient[chosen], -1, 1)))


def _centred(x: NDArray[np.inexact]) -> NDArray[np.inexact]:
    wide = np.asarray(x).astype(np.complex128 if np.iscomplexobj(x) else np.float64)
    known = np.isfinite(wide)
    mean = wide[known].mean() if known.any() else 0.0
    return np.where(known, wide - mean, 0)


def _correlate(x: NDArray[np.inexact], y: NDArray[np.inexact]) -> NDArray[np.float64]:
    """Sum over i of conj(x[i])·y[i + lag], for lag = -(n-1) .. m-1."""
    n, m = x.size, y.size
    length = fft.next_fast_len(n + m - 1)
    if np.iscomplexobj(x) or np.iscomplexobj(y):
        circular = fft.ifft(np.conj(fft.fft(x, length)) * fft.fft(y, length))
        circular = np.abs(circular)
    else:
        circular = fft.irfft(np.conj(fft.rfft(x, length)) * fft.rfft(y, length), length)
    negative = circular[length - (n - 1) :] if n > 1 else circular[:0]
    ordered: NDArray[np.float64] = np.concatenate([negative, circular[:m]])
    return ordered


def _power_overlapping_x(
    x: NDArray[np.inexact], lags: NDArray[np.int_], m: int
) -> NDArray[np.float64]:
    return _power_between(x, np.maximum(0, -lags), np.minimum(x.size, m - lags))


def _power_overlapping_y(
    y: NDArray[np.inexact], lags: NDArray[np.int_], n: int
) -> NDArray[np.float64]:
    return _power_between(y, np.maximum(0, lags), np.minimum(y.size, n + lags))


def _power_between(
    x: NDArray[np.inexact], first: NDArray[np.int_], last: NDArray[np.int_]
) -> NDArray[np.float64]:
    cumulated = np.concatenate([[0.0], np.cumsum(np.abs(x) ** 2)])
    power: NDArray[np.float64] = cumulated[last] - cumulated[first]
    return power
