"""Jerk-limited rest-to-rest moves."""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Move:
    """A rest-to-rest move in seven phases of constant jerk."""

    distance_rad: float
    """Signed distance."""
    durations_s: tuple[float, ...]
    """The seven phases' durations."""
    jerk_rad_s3: float
    """Magnitude of the jerk."""

    @property
    def duration_s(self) -> float:
        """Time from rest to rest."""
        return sum(self.durations_s)


def plan_move(
    distance_rad: float,
    velocity_rad_s: float,
    acceleration_rad_s2: float,
    jerk_rad_s3: float,
) -> Move:
    """Plan the fastest symmetric move of a signed distance within limits, all positive.

    Raises
    ------
    ValueError
        If a limit is not positive.
    """
    if min(velocity_rad_s, acceleration_rad_s2, jerk_rad_s3) <= 0:
        msg = "velocity, acceleration and jerk limits must be positive"
        raise ValueError(msg)
    distance = abs(distance_rad)
    velocity, acceleration, jerk = velocity_rad_s, acceleration_rad_s2, jerk_rad_s3

    def ramp(top: float) -> tuple[float, float]:
        if top * jerk < acceleration**2:
            return sqrt(top / jerk), 0.0
        return acceleration / jerk, top / acceleration - acceleration / jerk

    rise, hold = ramp(velocity)
    if velocity * (2 * rise + hold) > distance:  # the top velocity is not reached
        if distance >= 2 * acceleration**3 / jerk**2:
            lag = acceleration / jerk
            velocity = acceleration * (sqrt(lag**2 + 4 * distance / acceleration) - lag) / 2
            rise, hold = ramp(velocity)
        else:
            rise, hold = (distance / (2 * jerk)) ** (1 / 3), 0.0
            velocity = jerk * rise**2
    cruise = distance / velocity - (2 * rise + hold) if velocity > 0 else 0.0
    durations = (rise, hold, rise, max(cruise, 0.0), rise, hold, rise)
    return Move(distance_rad, durations, jerk_rad_s3)


def evaluate_move(
    move: Move, time_s: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Distance, velocity and acceleration at times since a move's start, each of shape (n,).

    Before and after the move it is at rest.
    """
    sign = 1.0 if move.distance_rad >= 0 else -1.0
    jerks = sign * move.jerk_rad_s3 * np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])
    durations = np.array(move.durations_s)
    starts = np.concatenate([[0.0], np.cumsum(durations)])
    states = np.zeros((8, 3))  # position, velocity, acceleration at each phase's start
    for k in range(7):
        p, v, a = states[k]
        t, j = durations[k], jerks[k]
        states[k + 1] = (
            p + v * t + a * t**2 / 2 + j * t**3 / 6,
            v + a * t + j * t**2 / 2,
            a + j * t,
        )
    clipped = np.clip(time_s, 0.0, starts[-1])
    phase = np.clip(np.searchsorted(starts, clipped, side="right") - 1, 0, 6)
    t = clipped - starts[phase]
    p, v, a = states[phase].T
    j = jerks[phase]
    position = p + v * t + a * t**2 / 2 + j * t**3 / 6
    velocity = v + a * t + j * t**2 / 2
    acceleration = np.where((time_s > 0) & (time_s < starts[-1]), a + j * t, 0.0)
    return position, velocity, acceleration
