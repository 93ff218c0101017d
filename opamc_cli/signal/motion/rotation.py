"""The sense in which a current vector turns, frame by frame."""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

PARTS_OF_A_TURN = 16
"""Means of the current vector per turn at its highest frequency; it turns by 22 degrees between
two, and by less than half a turn up to eight times that frequency."""

SMOOTHED_TURNS = 8
"""Turns at the highest frequency over which the angle between parts is smoothed: unsmoothed the
turns of 96 motions of the testbed's joint under load, whose torque changes sign, scatter by 1.1 to
2.4, over four by 0.1 to 3.4, over eight by 0.1 to 1.2, over sixteen they are short by one."""

AXIS_TURNS = 2
"""Turns at the highest frequency over which the torque's axis is told: of 86 motions of strangers'
arms 81 have the right sign in 99 % of the samples of a twentieth of the current or more."""


@dataclass(frozen=True)
class Rotation:
    """Rotation of a current vector within frames.

    The sum over a frame of z[t]·conj(z[t-1]) has the angle by which the vector turns in a sample.
    White noise adds nothing to its mean, a change of the torque's sign next to nothing, and
    strong current counts more than weak.
    """

    turn: NDArray[np.float32]
    """Imaginary part of the sum: positive where the vector turns forwards; shape (n,), A^2."""
    along: NDArray[np.float32]
    """Real part of the sum; shape (n,), A^2."""

    def __getitem__(self, frames: slice) -> "Rotation":
        """Rotation within some of the frames."""
        return Rotation(self.turn[frames], self.along[frames])

    def direction(self) -> int:
        """Sense of rotation over all frames: 1, -1, or 0 if the vector does not turn."""
        return int(np.sign(self.turn.sum()))

    def smoothed(self, n_frames: int) -> "Rotation":
        """Rotation within each frame and its neighbours, `n_frames` in all; no edge rule needed.

        Beyond the ends nothing is added.
        """
        window = np.ones(n_frames, dtype=np.float32)
        n = self.turn.size
        first = (n_frames - 1) // 2
        return Rotation(
            np.convolve(self.turn, window)[first : first + n].astype(np.float32),
            np.convolve(self.along, window)[first : first + n].astype(np.float32),
        )

    def frequency_hz(self, fs_hz: float) -> NDArray[np.float64]:
        """Mean frequency within each frame, Hz; negative where the vector turns backwards."""
        angle: NDArray[np.float64] = np.arctan2(self.turn, self.along).astype(np.float64)
        return angle * fs_hz / (2 * np.pi)


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
        along = np.zeros(n, dtype=np.float32)
        if n:
            before = z.dtype.type(z[0] if self._last is None else self._last)
            _accumulate(z.real, z.imag, before.real, before.imag, self._step, turn, along)
            self._last = complex(z[-1])
        return Rotation(turn, along)


def join_rotation(pieces: list[Rotation]) -> Rotation:
    """Frames of successive pieces as one."""
    return Rotation(
        np.concatenate([p.turn for p in pieces]), np.concatenate([p.along for p in pieces])
    )


def turning_parts(
    z: NDArray[np.complexfloating], f_max_hz: float, fs_hz: float
) -> tuple[NDArray[np.complexfloating], NDArray[np.float64]]:
    """Cut a motion's current vector into parts of a turn, and tell how far it turns in each.

    Noise and a torque that changes sign win or lose half turns where the current is small: there
    its neighbours tell.

    Parameters
    ----------
    z : array, shape (n,), A
        Current vector; NaN are passed over.
    f_max_hz : float
        Highest frequency at which it turns, > 0, Hz.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    parts : array, shape (k,), A
        Means of the vector.
    turns : array, shape (k,)
        Of the vector in each, smoothed; negative backwards.
    """
    z = z[np.isfinite(z)]
    length = max(1, int(fs_hz / (PARTS_OF_A_TURN * f_max_hz)))
    count = z.size // length
    parts = z[: count * length].reshape(count, length).mean(axis=1)
    if count < 2:
        return parts, np.zeros(count)
    taper = np.hanning(SMOOTHED_TURNS * PARTS_OF_A_TURN + 2)[1:-1]
    steps = np.convolve(parts[1:] * parts[:-1].conj(), taper)[taper.size // 2 :][: count - 1]
    between = np.pad(np.angle(steps) / (2 * np.pi), 1, mode="edge")
    return parts, np.asarray((between[1:] + between[:-1]) / 2, dtype=np.float64)


def turned(z: NDArray[np.complexfloating], f_max_hz: float, fs_hz: float) -> NDArray[np.float64]:
    """Tell how far a motion's current vector has turned at each sample, (n,), turns.

    Arguments as of `turning_parts`; where the vector is unknown its neighbours tell.
    """
    turns = turning_parts(np.where(np.isfinite(z), z, 0), f_max_hz, fs_hz)[1]
    if not turns.size:
        return np.zeros(z.size)
    length = max(1, int(fs_hz / (PARTS_OF_A_TURN * f_max_hz)))
    middles = (np.arange(turns.size) + 0.5) * length
    return np.cumsum(np.interp(np.arange(z.size), middles, turns / length))


def torque_current(
    z: NDArray[np.complexfloating], f_max_hz: float, fs_hz: float
) -> NDArray[np.float64]:
    """Give a motion's current the sign that its envelope has lost.

    The vector is turned back by how far it turns, which its neighbours tell where the current is
    small; what is left hardly turns, and half the angle of its square is the torque's axis.

    Parameters
    ----------
    z : array, shape (n,), A
        Current vector; NaN where unknown.
    f_max_hz : float
        Highest frequency at which it turns, > 0, Hz.
    fs_hz : float
        Sampling rate, Hz.

    Returns
    -------
    array, shape (n,), A
        Current along that axis, of one sign or the other in all of the motion: which one the
        phases do not tell. NaN where unknown.
    """
    still = np.where(np.isfinite(z), z, 0) * np.exp(-2j * np.pi * turned(z, f_max_hz, fs_hz))
    taper = np.hanning(2 * int(AXIS_TURNS * fs_hz / f_max_hz / 2) + 3)
    square = np.convolve(still**2, taper)[taper.size // 2 :][: z.size]
    axis = np.unwrap(np.angle(square)) / 2
    return np.where(np.isfinite(z), (still * np.exp(-1j * axis)).real, np.nan)


@njit(cache=True, nogil=True)
def _accumulate(re, im, re_before, im_before, step, turn, along):  # type: ignore[no-untyped-def]
    for frame in range(turn.size):
        for t in range(frame * step, min(re.size, (frame + 1) * step)):
            real = re[t] * re_before + im[t] * im_before
            imag = im[t] * re_before - re[t] * im_before
            if real == real and imag == imag:
                along[frame] += real
                turn[frame] += imag
            re_before = re[t]
            im_before = im[t]
