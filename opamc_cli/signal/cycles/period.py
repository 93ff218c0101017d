"""After how many samples a path repeats itself."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

REPEAT_ERROR = 0.02
LONGEST_SHARE = 0.7


def cycle_length(*paths: Floats, known: Bools | None = None) -> int | None:
    """Shortest lag, in samples, at which the speed (or position) of a recording repeats itself.

    None where it does not. A lag counts if the mean square of ``path[t + lag] - path[t]``, where
    both are `known`, (n,), is below 2 % of twice the variance, up to 70 % of the recording; of such
    neighbours the best. All of several joints' paths, (n,) each, have to repeat at once.
    """
    n = paths[0].size
    counts = np.ones(n, dtype=bool) if known is None else known
    variances = [float(np.var(path[counts])) if counts.any() else 0.0 for path in paths]
    if n < 16 or min(variances) <= 0:
        return None
    every = [_mismatch(path, counts) / (2 * of) for path, of in zip(paths, variances, strict=True)]
    mismatch = np.max(every, axis=0)[: int(n * LONGEST_SHARE)]
    # Everything looks alike at short lags: first leave that neighbourhood.
    away = int(np.argmax(mismatch > 0.5))
    alike = np.flatnonzero(mismatch[away:] < REPEAT_ERROR) + away
    if not away or not alike.size:
        return None
    near = mismatch[alike[0] : alike[0] + alike[0] // 10 + 1]
    return int(alike[0] + np.argmin(near))


def _mismatch(path: Floats, counts: Bools) -> Floats:
    """Mean square of ``path[t + lag] - path[t]`` where both count, by lag; infinite of none."""
    n = path.size
    centred = np.where(counts, path - path[counts].mean(), 0.0)
    length = next_fast_len(2 * n, real=True)
    ones, values, squares = (rfft(one, length) for one in (1.0 * counts, centred, centred**2))
    both = irfft(np.abs(ones) ** 2, length)[:n]
    sums = 2 * irfft((np.conj(ones) * squares).real - np.abs(values) ** 2, length)[:n]
    return np.where(both > 0.5, sums / np.maximum(both, 1.0), np.inf)
