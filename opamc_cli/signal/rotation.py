"""The sense in which a current vector turns, frame by frame."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray


@dataclass(frozen=True)
class Rotation:
    """Rotation of a current vector within frames.

    Attributes
    ----------
    turn : array of float32, shape (n,), A^2
        Sum over a frame of Im(z[t]·conj(z[t-1])): positive where the vector turns forwards,
        weighted with the power, so that noise at standstill counts little.
    power : array of float32, shape (n,), A^2
        Sum over a frame of abs(z[t]·z[t-1]). For a vector of constant frequency f the ratio
        turn/power is sin(2π·f/fs); for noise it is near 0.
    """

    turn: NDArray[np.float32]
    power: NDArray[np.float32]

    def direction(self, first: int, last: int) -> int:
        """Sense of rotation over the frames first .. last-1: 1, -1, or 0 if it does not turn."""
        return int(np.sign(self.turn[first:last].sum()))

    def agrees_with(self, frequency_hz: NDArray[np.floating], fs_hz: float) -> NDArray[np.bool_]:
        """Where the vector turns at least half as fast as a carrier of this frequency would.

        Noise has a ridge as well, but does not turn along with it.

        Parameters
        ----------
        frequency_hz : array, shape (n,), Hz
            Ridge of the carrier, for every frame.
        fs_hz : float
            Sampling rate, Hz.

        Returns
        -------
        array of bool, shape (n,)
        """
        expected = np.sin(2 * np.pi * np.minimum(frequency_hz / fs_hz, 0.25))
        agrees: NDArray[np.bool_] = np.abs(self.turn) >= 0.5 * expected * self.power
        return agrees & (self.power > 0)


class RotationStream:
    """Rotation of a current vector that arrives in pieces; does not depend on how it was cut.

    Parameters
    ----------
    step : int
        Samples per frame.
    """

    def __init__(self, step: int) -> None:
        self._step = step
        self._held = np.zeros(0, dtype=np.complex64)
        self._last: complex | None = None

    def push(self, z: NDArray[np.complexfloating]) -> Rotation:
        """Take the samples that follow, give the frames that they complete."""
        held = np.concatenate([self._held, z])
        n = held.size // self._step
        self._held = held[n * self._step :].copy()
        return self._rotation(held[: n * self._step], n)

    def finish(self) -> Rotation:
        """Give the last, shorter frame, if there is one."""
        rotation = self._rotation(self._held, 1 if self._held.size else 0)
        self._held = self._held[:0]
        return rotation

    def _rotation(self, z: NDArray[np.complexfloating], n: int) -> Rotation:
        turn = np.zeros(n, dtype=np.float32)
        power = np.zeros(n, dtype=np.float32)
        if n:
            before = z.dtype.type(z[0] if self._last is None else self._last)
            _accumulate(z.real, z.imag, before.real, before.imag, self._step, turn, power)
            self._last = complex(z[-1])
        return Rotation(turn, power)


def join_rotation(pieces: list[Rotation]) -> Rotation:
    """Frames of successive pieces as one."""
    return Rotation(
        np.concatenate([p.turn for p in pieces]), np.concatenate([p.power for p in pieces])
    )


@njit(cache=True, nogil=True)
def _accumulate(re, im, re_before, im_before, step, turn, power):  # type: ignore[no-untyped-def]
    for frame in range(turn.size):
        for t in range(frame * step, min(re.size, (frame + 1) * step)):
            along = re[t] * re_before + im[t] * im_before
            across = im[t] * re_before - re[t] * im_before
            if along == along and across == across:
                turn[frame] += across
                power[frame] += np.sqrt(along * along + across * across)
            re_before = re[t]
            im_before = im[t]
