"""What is left when the noise's colour is taken out: an autoregressive whitening filter."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz, toeplitz
from scipy.sparse import csr_array

from opamc_cli.joint.track import Bools, Floats
from opamc_cli.joint.tracking import SlowPart, Tracking

AR_ORDER = 10
PAIRS_PER_TAP = 20
"""Samples and their predecessors that a tap takes; where there are fewer, fewer taps must do."""
FLOOR = 1e-3
"""Share of white noise that is always supposed."""
LOOK_BACK = 40
"""How far back the samples may lie that predict one after a gap."""
LARGEST_ERROR = 1.5
"""Variance of a prediction, relative to that from p samples, above which it is of no use."""


@dataclass(frozen=True)
class NoiseModel:
    """A noise's fast part, by its whitening filter 1, -a_1, ..., -a_p, and its slow part."""

    taps: Floats
    slow: SlowPart | None = None


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


@dataclass(frozen=True)
class Whitening:
    """Whitening of samples with gaps: each is predicted from those before it that are valid.

    Attributes
    ----------
    taps : array of shape (p + 1,)
        From `autoregression`.
    rows : int array
        Places of the samples that can be whitened, ascending.
    late : int array
        Which of them have not all of their last p samples.
    filters : sparse array of shape (late.size, n)
        Their own filters.
    tracking : Tracking or None
        Takes the noise's slow part out, if there is one.
    """

    taps: Floats
    rows: NDArray[np.int64]
    late: NDArray[np.int64]
    filters: csr_array
    tracking: Tracking | None = None

    def __call__(self, values: Floats) -> Floats:
        """Whiten signals of shape (n,) or (n, m), at `rows`."""
        columns = values[:, None] if values.ndim == 1 else values
        white = np.empty((self.rows.size, columns.shape[1]), order="F")
        own = (self.late, self.filters.indptr, self.filters.indices, self.filters.data)
        for k in range(columns.shape[1]):
            signal = np.ascontiguousarray(columns[:, k], dtype=np.float64)
            _filter_rows(signal, self.taps, self.rows, self._runs, *own, white[:, k])
        if self.tracking is not None:
            self.tracking.take_out(white)
        return white.reshape((self.rows.size, *values.shape[1:]), order="F")

    @cached_property
    def _runs(self) -> NDArray[np.int64]:
        """Where successive rows begin and end, of those that follow one another."""
        edges = np.flatnonzero(np.diff(self.rows) != 1) + 1
        return np.concatenate([[0], edges, [self.rows.size]] if self.rows.size else [[0]])


@njit(cache=True, nogil=True)
def _filter_rows(
    signal: Floats,
    taps: Floats,
    rows: NDArray[np.int64],
    runs: NDArray[np.int64],
    late: NDArray[np.int64],
    starts: NDArray[np.int32],
    places: NDArray[np.int32],
    weights: Floats,
    white: Floats,
) -> None:
    # A search whitens thousands of columns: only what is wanted is filtered, run by run, so that
    # the innermost loop is one over neighbours.
    for run in range(runs.size - 1):
        first, last = runs[run], runs[run + 1]
        begin, size = rows[first], last - first
        own = white[first:last]
        for i in range(size):
            own[i] = 0.0
        for k in range(taps.size):
            tap, past = taps[k], signal[begin - k : begin - k + size]
            for i in range(size):
                own[i] += tap * past[i]
    for j in range(late.size):
        total = 0.0
        for place in range(starts[j], starts[j + 1]):
            total += weights[place] * signal[places[place]]
        white[late[j]] = total


def whitening_with_gaps(
    noise: NoiseModel, valid: Bools, bounds: tuple[tuple[int, int], ...], wanted: Bools
) -> Whitening:
    """Filter for every sample that those before it predict about as well as they can.

    Where the last p samples are valid the filter is the autoregression's. After a gap there are
    fewer, or older ones; the best prediction from them has a larger error, by which the sample
    counts less. A filter that has to fill up after every gap would lose the first p samples of
    every move instead: half of all on a coarse grid.

    Parameters
    ----------
    noise : NoiseModel
        Of what is to become white.
    valid : bool array of shape (n,)
        Samples that may predict.
    bounds : tuple of (int, int)
        Half-open recordings.
    wanted : bool array of shape (n,)
        Samples to be whitened, all of them valid. Those whose prediction has more than
        `LARGEST_ERROR` of the variance that it has elsewhere are left out: they hold the level of
        a slow noise, which other gaps than the last share. So are the first p samples of each
        recording, which nothing is known before.

    Returns
    -------
    Whitening
    """
    rows = np.flatnonzero(wanted)
    taps = noise.taps
    order = taps.size - 1
    late = np.flatnonzero(~settled(valid, bounds, order)[rows])
    covariance = implied_covariance(taps, LOOK_BACK)
    first = np.zeros(valid.size, dtype=np.int64)
    for start, stop in bounds:
        first[start:stop] = start
    known: dict[bytes, Floats] = {}
    weights, columns, edges = [np.zeros(0)], [np.zeros(0, dtype=np.int64)], [0]
    kept = np.ones(rows.size, dtype=bool)
    for place in late:
        row = rows[place]
        lags = row - np.arange(max(row - LOOK_BACK, first[row]), row)
        lags = lags[valid[row - lags]][-order:]
        key = lags.tobytes()
        if key not in known:
            known[key] = _prediction(lags, covariance)
        weight = known[key]
        if row - first[row] < order or weight[-1] ** -2 > LARGEST_ERROR:
            kept[place] = False
            continue
        weights.append(weight)
        columns.append(np.concatenate([row - lags, [row]]))
        edges.append(edges[-1] + weight.size)
    late = (np.cumsum(kept) - 1)[late[kept[late]]]
    data = (np.concatenate(weights), np.concatenate(columns), edges)
    filters = csr_array(data, shape=(late.size, valid.size))
    fast = Whitening(taps, rows[kept], late, filters)
    if noise.slow is None:
        return fast
    steps = np.diff(fast.rows, prepend=fast.rows[:1])
    begins = np.searchsorted(fast.rows, [start for start, _ in bounds])
    steps[begins[begins < steps.size]] = 0
    return replace(fast, tracking=Tracking.of(noise.slow, steps, fast(np.ones(valid.size))))


def _prediction(lags: NDArray[np.int64], covariance: Floats) -> Floats:
    """Filter of a sample and those `lags` before it, scaled to the full filter's error."""
    among = covariance[np.abs(lags[:, None] - lags[None, :])]
    with_sample = covariance[lags]
    predictor = np.linalg.solve(among, with_sample)
    error = covariance[0] - float(predictor @ with_sample)
    weights: Floats = np.concatenate([-predictor, [1.0]]) / np.sqrt(max(error, 1.0))
    return weights


def implied_covariance(taps: Floats, longest: int) -> Floats:
    """Autocovariance of the noise that a whitening filter turns into white noise of variance 1.

    Parameters
    ----------
    taps : array of shape (p + 1,)
        From `autoregression`: 1, -a_1, ..., -a_p, stationary.
    longest : int
        Largest lag.

    Returns
    -------
    array of shape (longest + 1,)

    References
    ----------
    Walker, Proceedings of the Royal Society A 131, 1931.
    """
    order = taps.size - 1
    # sum_k taps[k] r[|j - k|] = 1 for j = 0, and 0 for j = 1 ... p
    equations = np.zeros((order + 1, order + 1))
    for j in range(order + 1):
        for k in range(order + 1):
            equations[j, abs(j - k)] += taps[k]
    start = np.linalg.solve(equations, np.eye(order + 1)[0])
    covariance = np.zeros(max(longest, order) + 1)
    covariance[: order + 1] = start
    for lag in range(order + 1, covariance.size):
        covariance[lag] = -float(taps[1:] @ covariance[lag - 1 : lag - order - 1 : -1])
    return covariance
