"""Motion programs: way points, dwells and cycles, for one axis after another or all at once."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from opamc_cli.testbed.trajectory import Move, evaluate_move, plan_move


@dataclass(frozen=True)
class Program:
    """What the robot is taught, the same for every axis that moves."""

    waypoints_rad: tuple[float, ...]
    """A cycle visits them in turn and returns to the first: as many motions as way points."""
    dwell_s: float
    dwell_jitter_s: float
    """With `dwell_s`: mean rest between motions, and half the width of its uniform jitter."""
    lead_s: float
    """Rest before the first and after the last motion of each axis."""
    cycles: int
    """Repetitions."""
    axes: tuple[int, ...]
    """The axes that move, counted from 1."""
    order: Literal["sequential", "together"]
    """One axis at a time as in the thesis (all cycles of one, then the next), or all at once."""
    speed_percent: float
    payload_kg: float
    """With `speed_percent`: speed override, 1..100; payload, 0 or more."""
    acceleration_rad_s2: float
    jerk_rad_s3: float
    """With `acceleration_rad_s2`: limits at full speed."""
    acceleration_exponent: float
    """The acceleration limit scales with the speed override to this power e, the jerk limit to
    2 e - 1, so that 1 keeps the ramps' duration and 2 scales time as a whole."""


@dataclass(frozen=True)
class ScheduledMove:
    """One motion of one axis with its place in the recording."""

    axis: int
    cycle: int
    motion: int
    start_s: float
    start_rad: float
    move: Move


@dataclass(frozen=True)
class Schedule:
    """All motions of a recording and its length."""

    moves: tuple[ScheduledMove, ...]
    duration_s: float


def schedule(
    program: Program, top_velocity_rad_s: dict[int, float], rng: np.random.Generator
) -> Schedule:
    """Lay a program out in time, from the axes' speeds at full override; `rng` draws the dwells."""
    speed = program.speed_percent / 100.0
    acceleration = program.acceleration_rad_s2 * speed**program.acceleration_exponent
    jerk = program.jerk_rad_s3 * speed ** (2 * program.acceleration_exponent - 1)
    together = program.order == "together"
    moves: list[ScheduledMove] = []
    clock = program.lead_s
    points = program.waypoints_rad
    groups = [program.axes] if together else [(axis,) for axis in program.axes]
    for group in groups:
        for cycle in range(program.cycles):
            for motion, start_rad in enumerate(points):
                distance = points[(motion + 1) % len(points)] - start_rad
                planned = [
                    ScheduledMove(
                        axis,
                        cycle,
                        motion,
                        clock,
                        start_rad,
                        plan_move(distance, top_velocity_rad_s[axis] * speed, acceleration, jerk),
                    )
                    for axis in group
                ]
                moves += planned
                jitter = rng.uniform(-1.0, 1.0) * program.dwell_jitter_s
                clock += max(m.move.duration_s for m in planned) + program.dwell_s + jitter
        clock += program.lead_s
    return Schedule(tuple(moves), clock)


def reference(
    plan: Schedule, axis: int, rest_rad: float, rate_hz: float, n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return reference position, velocity and acceleration of one axis.

    Parameters
    ----------
    plan : Schedule
    axis : int
    rest_rad : float
        Where the axis stands before its first motion.
    rate_hz : float
        Rate of the result.
    n : int
        Number of values.

    Returns
    -------
    position_rad, velocity_rad_s, acceleration_rad_s2 : ndarray, shape (n,)
    """
    position = np.full(n, rest_rad)
    velocity = np.zeros(n)
    acceleration = np.zeros(n)
    for item in plan.moves:
        if item.axis != axis:
            continue
        first = max(int(np.ceil(item.start_s * rate_hz)), 0)
        last = min(int(np.ceil((item.start_s + item.move.duration_s) * rate_hz)), n)
        times = np.arange(first, last) / rate_hz - item.start_s
        p, v, a = evaluate_move(item.move, times)
        position[first:last] = item.start_rad + p
        position[last:] = item.start_rad + item.move.distance_rad
        velocity[first:last] = v
        acceleration[first:last] = a
    return position, velocity, acceleration
