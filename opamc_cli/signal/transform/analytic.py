"""The analytic signal of motor currents, and what is read from it."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

from opamc_cli.signal.transform.blocks import Block, OverlappingBlocks


def clarke(
    a: NDArray[np.floating], b: NDArray[np.floating], c: NDArray[np.floating]
) -> NDArray[np.complexfloating]:
    """Combine three phase currents into the current vector, their exact analytic signal.

    Parameters
    ----------
    a, b, c : array, shape (n,), A
        Phase currents. What is common to all three is dropped.

    Returns
    -------
    array, shape (n,), A
        Complex64 for float32 input, else complex128. Its modulus is the amplitude of balanced
        phases; its angle grows when the phases follow each other in the order a, b, c.

    Notes
    -----
    c = (2/3)(a + b·e^{+i2π/3} + c·e^{-i2π/3}), the amplitude-invariant Clarke transform.
    """
    a, b, c = np.asarray(a), np.asarray(b), np.asarray(c)
    single = a.dtype == b.dtype == c.dtype == np.float32
    real = np.float32 if single else np.float64
    z: NDArray[np.complexfloating] = np.empty(
        a.shape, dtype=np.complex64 if single else np.complex128
    )
    common = (a + b + c) * real(1 / 3)
    np.subtract(a, common, out=z.real)
    np.multiply(b - c, real(1 / np.sqrt(3)), out=z.imag)
    return z


def analytic_signal(x: NDArray[np.floating]) -> NDArray[np.complexfloating]:
    """Analytic signal x + i·HT[x] of one segment.

    Edge rule: the segment is continued by its even reflection on both sides, up to a length
    that the FFT likes, so that neither end sees the other. A mean stays in the real part.

    Parameters
    ----------
    x : array, shape (n,), A
        One phase current.

    Returns
    -------
    array, shape (n,), A
        Complex64 for float32 input, else complex128.

    Notes
    -----
    Equation (2-2) of the thesis.
    """
    x = np.asarray(x)
    n = x.size
    if n == 0:
        return np.zeros(0, dtype=np.complex64 if x.dtype == np.float32 else np.complex128)
    length = fft.next_fast_len(2 * n)
    before = (length - n) // 2
    padded = np.pad(x, (before, length - n - before), mode="reflect" if n > 1 else "edge")
    spectrum = fft.fft(padded)
    spectrum[1 : (length + 1) // 2] *= 2
    spectrum[length // 2 + 1 :] = 0
    z: NDArray[np.complexfloating] = fft.ifft(spectrum, overwrite_x=True)[before : before + n]
    return z


class AnalyticStream:
    """Analytic signal of one phase current that arrives in pieces.

    The Hilbert transform is a finite filter (Blackman window), so that no sample depends on
    anything further away than its half length, nor on how the pieces were cut. Below `f_min_hz`
    it fades out: a constant stays in the real part. Edge rule: even reflection.

    Parameters
    ----------
    fs_hz : float
        Sampling rate, Hz.
    f_min_hz : float
        Lowest carrier frequency that must come out whole, Hz.
    core : int
        Samples per internal block; does not change the result beyond rounding.

    Notes
    -----
    Equation (2-2) of the thesis.
    """

    def __init__(self, fs_hz: float, f_min_hz: float, core: int = 1 << 15) -> None:
        half = max(8, int(np.ceil(4 * fs_hz / f_min_hz)))
        self._blocks = OverlappingBlocks(core, half)
        self._n_fft = fft.next_fast_len(self._blocks.length + 2 * half, real=True)
        self._response = _hilbert_response(half, self._n_fft)

    def push(self, x: NDArray[np.floating]) -> NDArray[np.complexfloating]:
        """Take the samples that follow, give the analytic samples that they complete."""
        return self._transform(self._blocks.push(np.asarray(x)), np.asarray(x).dtype)

    def finish(self) -> NDArray[np.complexfloating]:
        """Give the analytic samples that the end of the stream completes."""
        return self._transform(self._blocks.finish(), np.dtype(np.float64))

    def _transform(
        self, blocks: Iterator[Block], empty: np.dtype[np.floating]
    ) -> NDArray[np.complexfloating]:
        overlap = self._blocks.overlap
        pieces = []
        for block in blocks:
            spectrum = fft.rfft(block.samples, self._n_fft) * self._response
            shifted = fft.irfft(spectrum, self._n_fft, overwrite_x=True)
            real = block.samples[overlap : overlap + block.n_valid]
            # The filter's own delay is `overlap`, which the block's left context is as well.
            imag = shifted[2 * overlap : 2 * overlap + block.n_valid]
            pieces.append(real + 1j * imag.astype(real.dtype))
        if not pieces:
            return np.zeros(0, dtype=np.result_type(empty, np.complex64))
        return np.concatenate(pieces)


def envelope(z: NDArray[np.complexfloating]) -> NDArray[np.floating]:
    """Envelope a(t) = abs(z), proportional to torque; equation (2-3) of the thesis.

    Parameters
    ----------
    z : array, shape (n,), A
        Analytic signal.

    Returns
    -------
    array, shape (n,), A
        Float32 for complex64 input, else float64.
    """
    # Written out: abs() guards against overflow, which currents do not need, at five times the
    # cost.
    modulus: NDArray[np.floating] = np.sqrt(z.real * z.real + z.imag * z.imag)
    return modulus


def temporal_fine_structure(
    z: NDArray[np.complexfloating], floor_a: float = 0.0
) -> NDArray[np.floating]:
    """Temporal fine structure cos(arg z): the carrier without its amplitude.

    Below the noise floor the direction of the vector is noise, and a unit phasor made of it
    would look like motion: there the vector is divided by the floor instead of its modulus, so
    that the result fades with the current.

    Parameters
    ----------
    z : array, shape (n,), A
        Analytic signal; NaN gives 0.
    floor_a : float
        Noise floor of the modulus, A, >= 0.

    Returns
    -------
    array, shape (n,), in -1..1
        Float32 for complex64 input, else float64.

    Notes
    -----
    Equations (2-4) and (2-5) of the thesis; the floor is ours.
    """
    z = np.ascontiguousarray(z)
    real = np.float32 if z.dtype == np.complex64 else np.float64
    tfs: NDArray[np.floating] = np.empty(z.shape, dtype=real)
    smallest = real(max(floor_a, 1e-15) ** 2)
    _fine_structure(z.real, z.imag, smallest, tfs)
    return tfs


@njit(cache=True, nogil=True)
def _fine_structure(re, im, smallest, tfs):  # type: ignore[no-untyped-def]
    zero = smallest - smallest
    for t in range(tfs.size):
        power = re[t] * re[t] + im[t] * im[t]
        value = re[t] / np.sqrt(max(power, smallest))
        tfs[t] = value if power == power else zero


@lru_cache(maxsize=8)
def _hilbert_response(half: int, n_fft: int) -> NDArray[np.complexfloating]:
    n = np.arange(-half, half + 1)
    taps = np.zeros(n.size)
    odd = n % 2 != 0
    taps[odd] = 2 / (np.pi * n[odd])
    response: NDArray[np.complexfloating] = fft.rfft(taps * np.blackman(n.size), n_fft)
    return response.astype(np.complex64)
