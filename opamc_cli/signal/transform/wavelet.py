"""Generalised Morse wavelets as band-pass filters, evaluated at a reduced rate."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import fft

# Where a filter has fallen to this share of its peak it is cut off; it bounds the error of the
# band-limited transform.
CUTOFF = 1e-5


@dataclass(frozen=True)
class Morse:
    """A generalised Morse wavelet.

    Attributes
    ----------
    gamma : float
        Symmetry γ, > 0; 3 is the most symmetric.
    beta : float
        β, > 0; the time-bandwidth product is β·γ. The source's toolbox default is a product of
        60, so β = 20; ssqueezepy's default is β = 60, a longer wavelet.

    Notes
    -----
    Olhede and Walden, 2002; Lilly and Olhede, 2009.
    """

    gamma: float = 3.0
    beta: float = 20.0

    @property
    def peak_rad(self) -> float:
        """Radian frequency (β/γ)^(1/γ) of the peak at scale 1."""
        return float((self.beta / self.gamma) ** (1 / self.gamma))

    @property
    def duration(self) -> float:
        """Standard deviation of the wavelet's envelope, in periods of its peak frequency."""
        return float(np.sqrt(self.beta * self.gamma) / (2 * np.pi))

    def response(self, ratio: NDArray[np.floating]) -> NDArray[np.floating]:
        """Response at `ratio` times the peak frequency; 2 at the peak.

        A unit cosine at the peak frequency then gives a modulus of 1: amplitude (L1)
        normalisation. The thesis prints 1/sqrt(a) in (2-1), with which its (3-1), 0 <= S <= 1,
        would not hold.
        """
        positive = np.maximum(ratio, np.finfo(np.float64).tiny)
        log_gain = self.beta * np.log(positive) + (self.beta / self.gamma) * (
            1 - positive**self.gamma
        )
        return np.where(ratio > 0, 2 * np.exp(log_gain), 0.0)

    def band(self) -> tuple[float, float]:
        """Ratios to the peak frequency between which the response exceeds the cutoff."""
        ratio = np.geomspace(1e-3, 20, 20_000)
        inside = np.flatnonzero(self.response(ratio) > 2 * CUTOFF)
        return float(ratio[inside[0]]), float(ratio[inside[-1]])


def scale_frequencies(
    f_min_hz: float, f_max_hz: float, voices_per_octave: int
) -> NDArray[np.float64]:
    """Peak frequencies, ascending, spaced evenly in pitch, from `f_min_hz` to `f_max_hz`.

    Raises
    ------
    ValueError
        Unless 0 < f_min_hz < f_max_hz and there is at least one voice per octave.
    """
    if not 0 < f_min_hz < f_max_hz or voices_per_octave < 1:
        msg = (
            f"need 0 < f_min_hz < f_max_hz and voices_per_octave >= 1, "
            f"got {f_min_hz}, {f_max_hz}, {voices_per_octave}"
        )
        raise ValueError(msg)
    n = int(np.ceil(np.log2(f_max_hz / f_min_hz) * voices_per_octave))
    return np.geomspace(f_min_hz, f_max_hz, n + 1)


class FilterBank:
    """Morse filters for blocks of one length, whose outputs are kept every `step` samples.

    Each filter lives in a narrow band: outside it nothing is multiplied. Only every `step`-th
    output is wanted: folding the band's bins modulo length/step before a short inverse FFT gives
    exactly these, since decimation in time is folding in frequency. Together this is some
    hundred times less work than a full-length inverse FFT per scale.

    Parameters
    ----------
    wavelet : Morse
        The wavelet.
    frequencies_hz : array, shape (n_scales,)
        Peak frequencies, ascending, below half the sampling rate.
    fs_hz : float
        Sampling rate, Hz.
    length : int
        Samples per block, a multiple of `step`.
    step : int
        Samples between outputs.
    """

    def __init__(
        self,
        wavelet: Morse,
        frequencies_hz: NDArray[np.float64],
        fs_hz: float,
        length: int,
        step: int,
    ) -> None:
        if length % step:
            msg = f"length must be a multiple of step, got {length} and {step}"
            raise ValueError(msg)
        self.frequencies_hz = frequencies_hz
        self.length = length
        self.step = step
        low, high = wavelet.band()
        bins_hz = np.arange(length // 2 + 1) * (fs_hz / length)
        self._first = np.searchsorted(bins_hz, low * frequencies_hz)
        last = np.searchsorted(bins_hz, high * frequencies_hz, side="right")
        gains = [
            wavelet.response(bins_hz[i:j] / f)
            for i, j, f in zip(self._first, last, frequencies_hz, strict=True)
        ]
        self._offset = np.concatenate([[0], np.cumsum([g.size for g in gains])])
        # The short inverse FFT divides by its own length, the full one would by the block's.
        self._gain = (np.concatenate(gains) / step).astype(np.float32)

    def transform(self, block: NDArray[np.floating]) -> NDArray[np.complex64]:
        """Wavelet transform of a block, at every `step`-th of its samples.

        Parameters
        ----------
        block : array, shape (length,)
            Real samples; the block is taken as periodic.

        Returns
        -------
        array of complex64, shape (n_scales, length // step)
            Coefficients; scales in the order of `frequencies_hz`.
        """
        # Single precision: the transform of a unit signal is right to 1e-6.
        spectrum = fft.rfft(block.astype(np.float32, copy=False), workers=1)
        folded = np.zeros((self.frequencies_hz.size, self.length // self.step), dtype=np.complex64)
        _fold(spectrum, self._gain, self._first, self._offset, folded)
        coefficients: NDArray[np.complex64] = fft.ifft(folded, axis=1, overwrite_x=True, workers=1)
        return coefficients


@njit(cache=True, nogil=True)
def _fold(spectrum, gain, first, offset, folded):  # type: ignore[no-untyped-def]
    n_scales, n_out = folded.shape
    for scale in range(n_scales):
        source = first[scale]
        done = offset[scale]
        while done < offset[scale + 1]:
            target = source % n_out
            run = min(n_out - target, offset[scale + 1] - done)
            row = folded[scale, target : target + run]
            band = spectrum[source : source + run]
            weight = gain[done : done + run]
            for i in range(run):
                row[i] += band[i] * weight[i]
            source += run
            done += run
