"""Moving averages, correlations and local polynomials of long recordings.

`scipy.signal` has them all, but loading it, with all of statistics and optimisation behind it,
takes longer than judging a short recording (0.8 s of processor time). What is here computes the
same in the same order, to the last digit.
"""

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import lstsq
from scipy.ndimage import convolve1d
from scipy.special import lambertw

Floats = NDArray[np.float64]


def convolved(values: Floats, kernel: Floats) -> Floats:
    """Sum products with a kernel wherever all of it lies on the recording, block by block.

    Parameters
    ----------
    values : array of shape (n,) or (n, m)
        Recordings side by side.
    kernel : array of shape (k,), 1 < k <= n
        Weights; the last one meets the first sample, as in every convolution.

    Returns
    -------
    array of shape (n - k + 1,) or (n - k + 1, m)

    Notes
    -----
    Overlap-add with the block that costs least: as `scipy.signal.oaconvolve(mode="valid")`.
    """
    n, k = len(values), kernel.size
    whole, overlap = n + k - 1, k - 1
    weights = kernel.reshape(-1, *(1,) * (values.ndim - 1))
    block = whole
    if k < n / 2:
        # the least of N (log2 N + 1) / (N - overlap), where N / overlap = ln(2 e N)
        best = -overlap * lambertw(-1 / (2 * math.e * overlap), k=-1).real
        block = next_fast_len(math.ceil(best))
    if block >= n:
        length = next_fast_len(whole, real=True)
        spectrum = rfft(values, length, axis=0) * rfft(weights, length, axis=0)
        return np.asarray(irfft(spectrum, length, axis=0)[overlap:n])
    step = block - overlap
    count = math.ceil((n + 1) / step)
    count += step * count < whole
    padded = np.pad(values, [(0, count * step - n)] + [(0, 0)] * (values.ndim - 1))
    blocks = padded.reshape(count, step, *values.shape[1:])
    spectrum = rfft(blocks, block, axis=1) * rfft(weights[np.newaxis], block, axis=1)
    sums = irfft(spectrum, block, axis=1)
    sums[1:, :overlap] += sums[:-1, step:]
    return np.asarray(sums[:, :step].reshape(padded.shape)[overlap:n])


def autocorrelation(values: Floats) -> Floats:
    """Sum ``values[t] * values[t + lag]`` over all t, for every lag from 0 to n - 1.

    Parameters
    ----------
    values : array of shape (n,)
        One recording.
    """
    n = values.size
    length = next_fast_len(2 * n - 1, real=True)
    spectrum = rfft(values, length) * rfft(values[::-1], length)
    return np.asarray(irfft(spectrum, length)[n - 1 : 2 * n - 1])


def polynomial_weights(
    window: int,
    order: int,
    derivative: int = 0,
    step: float = 1.0,
    use: Literal["convolution", "product"] = "convolution",
) -> Floats:
    """Return the weights of a local polynomial's value or derivative in the window's middle.

    Parameters
    ----------
    window : int
        Odd number of samples, above `order`.
    order, derivative : int
        Of the polynomial, and which derivative.
    step : float
        Between two samples.
    use : {"convolution", "product"}
        In which direction the weights run.

    References
    ----------
    Savitzky and Golay, Analytical Chemistry 36, 1964.
    """
    half = window // 2
    place = np.arange(-half, window - half, dtype=np.float64)
    powers = (place if use == "product" else place[::-1]) ** np.arange(order + 1.0)[:, np.newaxis]
    wanted = np.zeros(order + 1)
    wanted[derivative] = math.factorial(derivative) / step**derivative
    return _least_squares(powers, wanted, max(powers.shape))


def local_polynomial(
    values: Floats, window: int, order: int, derivative: int = 0, step: float = 1.0
) -> Floats:
    """Return the value or a derivative of a polynomial fitted around each sample.

    Parameters
    ----------
    values : array of shape (n,)
        Uniformly sampled.
    window : int
        Odd number of samples, above `order`, at most n.
    order, derivative : int
        Of the polynomial, and which derivative.
    step : float
        Between two samples.

    Returns
    -------
    array of shape (n,)
        Within half a window of an end, of the polynomial of the outermost window.
    """
    weights = polynomial_weights(window, order, derivative, step)
    smooth: Floats = convolve1d(values, weights, mode="constant")
    half = window // 2
    place = np.arange(0.0, window)
    ends = (
        (values[:window], smooth[:half], place[:half]),
        (values[-window:], smooth[-half:], place[-half:]),
    )
    powers = place[:, np.newaxis] ** np.arange(order, -1.0, -1.0)
    scale = np.sqrt(np.sum(powers * powers, axis=0))
    for outermost, end, at in ends:
        fitted = _least_squares(powers / scale, outermost, window) / scale
        end[:] = np.polyval(np.polyder(fitted, derivative), at) / step**derivative
    return smooth


def _least_squares(columns: Floats, values: Floats, size: int) -> Floats:
    found: Floats = lstsq(columns, values, cond=size * np.finfo(np.float64).eps)[0]
    return found
