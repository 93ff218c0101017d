"""What is left when the noise's colour is taken out: an autoregressive whitening filter."""

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz, toeplitz

from opamc_cli.joint.motion.track import Bools, Floats

AR_ORDER = 10
PAIRS_PER_TAP = 20
"""Samples and their predecessors that a tap takes; where there are fewer, fewer taps must do."""
FLOOR = 1e-3
"""Share of white noise that is always supposed."""


def autocovariance(noise: Floats, valid: Bools, longest: int) -> tuple[Floats, Floats]:
    """Autocovariance of a noise with gaps, by averages over the pairs that are there.

    Parameters
    ----------
    noise : array of shape (n,)
        Residual; samples that are not valid do not count.
    valid : bool array of shape (n,)
        Samples that count.
    longest : int
        Largest lag.

    Returns
    -------
    covariance, counts : arrays of shape (longest + 1,)
        Averages, and how many pairs each is of.
    """
    values = np.where(valid, noise, 0.0)
    longest = min(longest, values.size - 1)
    length = next_fast_len(values.size + longest, real=True)
    spectra = (rfft(values, length), rfft(valid.astype(float), length))
    sums, counts = (irfft(np.abs(one) ** 2, length)[: longest + 1] for one in spectra)
    counts = np.round(counts)
    return sums / np.maximum(counts, 1.0), counts


def autoregression(noise: Floats, valid: Bools, order: int = AR_ORDER) -> Floats:
    """Whitening filter of a noise with gaps, by the Yule-Walker equations.

    Parameters
    ----------
    noise : array of shape (n,)
        Residual; samples that are not valid do not count.
    valid : bool array of shape (n,)
        Samples that count.
    order : int
        Number of past samples that predict the present one, at most.

    Returns
    -------
    array of shape (p + 1,)
        Taps 1, -a_1, ..., -a_p; p is the order, or less where there are too few samples.
    """
    return filter_of(*autocovariance(noise, valid, order))


def filter_of(covariance: Floats, counts: Floats) -> Floats:
    """Whitening filter of a noise with a given autocovariance, by the Yule-Walker equations.

    Parameters
    ----------
    covariance, counts : arrays of shape (p + 1,)
        From `autocovariance`; lags of which there are too few pairs, and those beyond, do not
        count.

    References
    ----------
    Walker, Proceedings of the Royal Society A 131, 1931.
    """
    enough = counts >= PAIRS_PER_TAP * (np.arange(covariance.size) + 1)
    known = covariance.size if enough.all() else int(np.argmin(enough))
    covariance = covariance[:known].copy()
    if known < 2 or covariance[0] <= 0:
        return np.ones(1)
    # A floor under the noise: where there is none, misfits of 1/1000 would count as signals.
    covariance[0] *= 1 + FLOOR
    # Averages over different pairs need not be the covariance of any noise.
    least = float(np.linalg.eigvalsh(toeplitz(covariance))[0])
    covariance[0] += max(0.5 * FLOOR * covariance[0] - least, 0.0)
    coefficients = solve_toeplitz(covariance[:-1], covariance[1:])
    taps: Floats = np.concatenate([[1.0], -coefficients])
    return taps


def whitened(values: Floats, taps: Floats) -> Floats:
    """Apply a whitening filter along the first axis.

    Parameters
    ----------
    values : array of shape (n,) or (n, m)
        Signals.
    taps : array of shape (p + 1,)
        From `autoregression`.

    Returns
    -------
    array of the same shape
        The first p samples (and the first p after a gap) are not usable: see `settled`.
    """
    if taps.size == 1:
        return values
    if values.ndim == 1:
        return np.convolve(values, taps)[: values.size]
    filtered = np.empty(values.shape, order="F")
    for k in range(values.shape[1]):
        filtered[:, k] = np.convolve(values[:, k], taps)[: values.shape[0]]
    return filtered


def settled(valid: Bools, bounds: tuple[tuple[int, int], ...], past: int) -> Bools:
    """Tell the samples whose `past` predecessors in the same recording are all valid too.

    Parameters
    ----------
    valid : bool array of shape (n,)
        Samples that count.
    bounds : tuple of (int, int)
        Half-open recordings.
    past : int
        Taps of the whitening filter less one.

    Returns
    -------
    bool array of shape (n,)
    """
    result = np.zeros_like(valid)
    for start, stop in bounds:
        run = np.concatenate([[0], np.cumsum(valid[start:stop])])
        whole = np.zeros(stop - start, dtype=bool)
        if stop - start > past:
            whole[past:] = run[past + 1 :] - run[: run.size - past - 1] == past + 1
        result[start:stop] = whole
    return result
