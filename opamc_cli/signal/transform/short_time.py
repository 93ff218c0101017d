"""Short-time spectrum of an envelope: what ordinal patterns, blind to size, leave out."""

import numpy as np
from numpy.typing import NDArray

FLOOR_A2 = 1e-12
"""Power that stands for none, A²: a millionth of an ampere is below any sensor's resolution."""


def short_time_log_power(
    x: NDArray[np.floating], n_frames: int, n_bins: int
) -> NDArray[np.float32]:
    """Log power of the lowest frequencies in overlapping frames of a signal.

    Frames are equally long, overlap by half, cover the signal from end to end, lose their mean
    and are tapered by a Hann window. Bin k is k + 1 periods per frame. A signal too short for
    frames of `2 * n_bins` samples has fewer frames, in the end one with fewer bins.

    Parameters
    ----------
    x : array, shape (n,), A
        One motion's envelope; a frame that holds NaN gives NaN.
    n_frames : int
        Frames, at least 1.
    n_bins : int
        Bins, at least 1.

    Returns
    -------
    array of float32, shape (frames, bins)
        Natural logarithm of the power in A²; no rows for fewer than four samples.

    Notes
    -----
    P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967); here frames are not averaged, so
    that they tell where in the motion something changes.

    Examples
    --------
    >>> t = np.arange(900)
    >>> power = short_time_log_power(np.sin(2 * np.pi * 5 * t / 100), n_frames=17, n_bins=8)
    >>> power.shape, int(power.mean(axis=0).argmax()) + 1
    ((17, 8), 5)
    """
    samples = np.asarray(x, dtype=np.float64)
    if samples.size < 4:
        return np.zeros((0, n_bins), dtype=np.float32)
    n_frames = int(np.clip(samples.size // n_bins - 1, 1, n_frames))
    length = 2 * samples.size // (n_frames + 1)
    starts = np.linspace(0, samples.size - length, n_frames).round().astype(int)
    frames = samples[starts[:, np.newaxis] + np.arange(length)]
    taper = np.hanning(length)
    tapered = (frames - frames.mean(axis=1, keepdims=True)) * taper
    spectrum = np.fft.rfft(tapered, axis=1)[:, 1 : 1 + n_bins]
    power = (spectrum.real**2 + spectrum.imag**2) * (2 / taper.sum()) ** 2
    log_power: NDArray[np.float32] = np.log(power + FLOOR_A2).astype(np.float32)
    return log_power
