"""A small generator of phase currents whose movements are known.

A motor turns through a list of moves with jerk-limited ramps; its current carries inertia,
friction and a holding torque, so that it changes sign while braking, and may vanish at
standstill.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Move:
    """One move: ramp up in `ramp_s`, `cruise_s` at `f_max_hz`, ramp down, then rest."""

    f_max_hz: float
    direction: int = 1
    ramp_s: float = 0.2
    cruise_s: float = 0.4
    rest_s: float = 0.5


@dataclass(frozen=True)
class Torque:
    """Amplitudes of the current's parts, A."""

    hold: float = 0.5
    swing: float = 0.3  # part of the holding torque that changes with the joint's angle
    friction: float = 0.4
    viscous: float = 0.2
    inertia: float = 1.0
    ripple: float = 0.03


@dataclass(frozen=True)
class Recording:
    phases: np.ndarray  # (3, n) float32
    fs_hz: float
    frequency_hz: np.ndarray  # signed
    intervals: list[tuple[int, int]] = field(default_factory=list)


def ramp(n, smooth):
    """Speed from 0 to 1 over n samples: triangular acceleration, or constant."""
    s = (np.arange(n) + 0.5) / n
    if not smooth:
        return s
    return np.where(s < 0.5, 2 * s**2, 1 - 2 * (1 - s) ** 2)


def record(
    moves,
    fs_hz=2048.0,
    torque=None,
    noise=0.0,
    offset=0.0,
    lead_s=0.6,
    smooth=True,
    seed=0,
):
    """Phase currents of a list of moves; `noise` and `offset` in A, per phase."""
    torque = torque or Torque()
    rng = np.random.default_rng(seed)
    pieces = [np.zeros(round(lead_s * fs_hz))]
    intervals = []
    n = pieces[0].size
    for move in moves:
        up = ramp(round(move.ramp_s * fs_hz), smooth)
        speed = np.concatenate([up, np.ones(round(move.cruise_s * fs_hz)), up[::-1]])
        intervals.append((n, n + speed.size))
        pieces += [
            move.direction * move.f_max_hz * speed,
            np.zeros(round(move.rest_s * fs_hz)),
        ]
        n += speed.size + pieces[-1].size
    frequency = np.concatenate(pieces)
    angle = 2 * np.pi * np.cumsum(frequency) / fs_hz + rng.uniform(0, 2 * np.pi)

    fastest = max(m.f_max_hz for m in moves)
    speed = frequency / fastest
    acceleration = np.gradient(speed) * fs_hz * min(m.ramp_s for m in moves) / 2
    joint = 2 * np.pi * np.cumsum(frequency) / fs_hz / 500  # gear ratio 100, five pole pairs
    i_q = (
        torque.hold
        + torque.swing * np.sin(joint)
        + torque.friction * np.tanh(speed / 0.01)
        + torque.viscous * speed
        + torque.inertia * acceleration
        + torque.ripple * np.sin(2 * angle / 5)
    )
    vector = i_q * np.exp(1j * angle)
    phases = np.stack([(vector * np.exp(-2j * np.pi * k / 3)).real for k in range(3)])
    phases += noise * rng.standard_normal(phases.shape)
    phases += offset * rng.uniform(-1, 1, (3, 1))
    return Recording(phases.astype(np.float32), fs_hz, frequency, intervals)
