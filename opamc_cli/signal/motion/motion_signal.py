"""The motion signal S(t) and the ridge of the carrier's frequency, from a stream of TFS."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from opamc_cli.signal.transform.blocks import Block, OverlappingBlocks
from opamc_cli.signal.transform.wavelet import FilterBank, Morse, scale_frequencies

Engine = Literal["band-limited", "ssqueezepy"]

# Context on each side of a block, in standard deviations of the longest wavelet.
OVERLAP_DURATIONS = 5.0


@dataclass(frozen=True)
class MotionFrames:
    """Motion signal at evenly spaced samples."""

    step: int
    """Samples between frames; frame i is at sample i·step."""
    strength: NDArray[np.float32]
    """S(t), 0 at standstill, 1 for a carrier of constant frequency; shape (n,)."""
    ridge_hz: NDArray[np.float32]
    """Frequency of the scale with the largest modulus, refined between scales, Hz; shape (n,)."""


@dataclass(frozen=True)
class MotionBand:
    """Where carriers are looked for, and with which wavelet."""

    f_min_hz: float = 8.0
    f_max_hz: float = 800.0
    """With `f_min_hz`: lowest and highest peak frequency, Hz; `f_max_hz` below half the sampling
    rate."""
    voices_per_octave: int = 16
    """Scales per octave."""
    wavelet: Morse = field(default_factory=Morse)
    """The wavelet."""

    def frequencies_hz(self) -> NDArray[np.float64]:
        """Peak frequencies of the scales, ascending, Hz."""
        return scale_frequencies(self.f_min_hz, self.f_max_hz, self.voices_per_octave)


@lru_cache(maxsize=4)  # Axes and recordings of one rate share it; a short one costs less.
def _filter_bank(band: MotionBand, fs_hz: float, length: int, step: int) -> FilterBank:
    return FilterBank(band.wavelet, band.frequencies_hz(), fs_hz, length, step)


class MotionStream:
    """Motion signal of a temporal fine structure that arrives in pieces.

    S(t) = max over the scales of abs(CWT(TFS)), equation (3-1) of the thesis, and the frequency
    where the maximum is. Blocks overlap by five standard deviations of the longest wavelet; edge
    rule: even reflection at the recording's ends. Memory does not grow with the recording, and
    the result does not depend on how the pieces were cut.

    Parameters
    ----------
    band : MotionBand
        Frequencies and wavelet.
    fs_hz : float
        Sampling rate, Hz.
    step : int
        Samples between frames.
    block : int
        Samples per internal block, at least; changes the result only by rounding.
    engine : {"band-limited", "ssqueezepy"}
        What computes the transform; the second is some hundred times slower.
    """

    def __init__(
        self,
        band: MotionBand,
        fs_hz: float,
        step: int,
        block: int = 1 << 14,
        engine: Engine = "band-limited",
    ) -> None:
        overlap = OVERLAP_DURATIONS * band.wavelet.duration * fs_hz / band.f_min_hz
        overlap = step * int(np.ceil(overlap / step))
        length = step * _smooth_at_least(max(block, 4 * overlap) // step)
        self._blocks = OverlappingBlocks(length - 2 * overlap, overlap)
        self._step = step
        self._frequencies_hz = band.frequencies_hz()
        self._transform: Callable[[NDArray[np.floating]], NDArray[np.complex64]]
        if engine == "ssqueezepy":
            self._transform = _ssqueezepy_transform(band, fs_hz, step)
        else:
            self._transform = _filter_bank(band, fs_hz, length, step).transform

    def push(self, tfs: NDArray[np.floating]) -> MotionFrames:
        """Take the samples that follow, give the frames that they complete."""
        return self._frames(self._blocks.push(tfs))

    def finish(self) -> MotionFrames:
        """Give the frames that the end of the recording completes."""
        return self._frames(self._blocks.finish())

    def _frames(self, blocks: Iterator[Block]) -> MotionFrames:
        strengths = [np.zeros(0, dtype=np.float32)]
        ridges = [np.zeros(0, dtype=np.float32)]
        first = self._blocks.overlap // self._step
        for block in blocks:
            n = -(-block.n_valid // self._step)
            coefficients = self._transform(block.samples)[:, first : first + n]
            strength = np.empty(n, dtype=np.float32)
            position = np.empty(n, dtype=np.float32)
            _ridge(coefficients, strength, position)
            strengths.append(strength)
            ridges.append(self._pitch_to_hz(position))
        return MotionFrames(self._step, np.concatenate(strengths), np.concatenate(ridges))

    def _pitch_to_hz(self, position: NDArray[np.float32]) -> NDArray[np.float32]:
        lowest, highest = self._frequencies_hz[0], self._frequencies_hz[-1]
        octaves = np.log2(highest / lowest) / max(1, self._frequencies_hz.size - 1)
        ridge_hz: NDArray[np.float32] = (lowest * np.exp2(octaves * position)).astype(np.float32)
        return ridge_hz


def motion_frames(
    tfs: NDArray[np.floating],
    band: MotionBand,
    fs_hz: float,
    step: int,
    engine: Engine = "band-limited",
) -> MotionFrames:
    """Motion signal of a whole temporal fine structure; see `MotionStream`."""
    stream = MotionStream(band, fs_hz, step, engine=engine)
    return join_frames([stream.push(tfs), stream.finish()])


def join_frames(pieces: list[MotionFrames]) -> MotionFrames:
    """Frames of successive pieces as one."""
    return MotionFrames(
        pieces[0].step,
        np.concatenate([p.strength for p in pieces]),
        np.concatenate([p.ridge_hz for p in pieces]),
    )


def _ssqueezepy_transform(
    band: MotionBand, fs_hz: float, step: int
) -> Callable[[NDArray[np.floating]], NDArray[np.complex64]]:
    import ssqueezepy

    morse = ("gmw", {"gamma": band.wavelet.gamma, "beta": band.wavelet.beta})
    # It wants scales ascending, which are frequencies descending.
    scales = band.wavelet.peak_rad * fs_hz / (2 * np.pi * band.frequencies_hz()[::-1])

    def transform(block: NDArray[np.floating]) -> NDArray[np.complex64]:
        # A copy, since it zeroes NaN in its caller's array.
        coefficients, _ = ssqueezepy.cwt(
            block.astype(np.float32), morse, scales=scales, padtype=None, l1_norm=True
        )
        thinned: NDArray[np.complex64] = np.ascontiguousarray(coefficients[::-1, ::step])
        return thinned

    return transform


@njit(cache=True, nogil=True)
def _ridge(coefficients, strength, position):  # type: ignore[no-untyped-def]
    n_scales, n = coefficients.shape
    power = np.zeros((3, n), dtype=np.float32)  # below, at and above the largest one
    best = np.zeros(n, dtype=np.int32)
    previous = np.zeros(n, dtype=np.float32)
    for scale in range(n_scales):
        for t in range(n):
            re = coefficients[scale, t].real
            im = coefficients[scale, t].imag
            p = re * re + im * im
            if best[t] == scale - 1:
                power[2, t] = p
            if p > power[1, t] or scale == 0:
                power[0, t] = previous[t]
                power[1, t] = p
                power[2, t] = np.float32(0.0)
                best[t] = scale
            previous[t] = p
    for t in range(n):
        strength[t] = np.sqrt(power[1, t])
        position[t] = best[t]
        if 0 < best[t] < n_scales - 1 and power[0, t] > 0 and power[2, t] > 0:
            # Log modulus over pitch is close to a parabola for a single carrier.
            below = np.log(power[0, t])
            at = np.log(power[1, t])
            above = np.log(power[2, t])
            bend = below - 2 * at + above
            if bend < 0:
                position[t] += np.float32(0.5 * (below - above) / bend)


def _smooth_at_least(n: int) -> int:
    """Smallest power of two or 3·2^k not below n."""
    power = 1 << max(0, (n - 1).bit_length())
    return 3 * power // 4 if 3 * power // 4 >= n else power
