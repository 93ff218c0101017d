"""What differs from one recording session to the next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.testbed.parameters import Robot


@dataclass(frozen=True)
class AxisSession:
    """One axis as found in one session."""

    temperature_c: float
    """Winding and gear temperature at the start."""
    friction: float
    viscous: float
    """With `friction`: factors on all friction, and on its viscous part once more."""
    error: float
    """Factor on the kinematic error."""
    mount_rad: NDArray[np.float64]
    """Mounting angles: phases of four kinematic error terms, angle of the sector; shape (5,)."""
    phase_gain: NDArray[np.float64]
    phase_offset_a: NDArray[np.float64]
    """With `phase_gain`: of the three current sensors; shape (3,)."""


def draw_session(robot: Robot, axis: int, seed: int, session: int) -> AxisSession:
    """Draw the small differences of one session for one axis, counted from 1.

    The sensors' gain and offset belong to the robot (they depend on seed and axis) and wander a
    little from session to session; temperature and friction are the session's own.
    """
    spread, sensor = robot.spread, robot.sensor
    fixed = stream(seed, 0, axis, 0)
    gain = 1.0 + sensor.gain * fixed.standard_normal(3)
    offset = sensor.offset_a * fixed.standard_normal(3)
    mount = fixed.uniform(0.0, 2.0 * np.pi, 5)
    own = stream(seed, session + 1, axis, 0)
    # the room's temperature is common to all axes of a session
    room = stream(seed, session + 1, 0, 0).standard_normal() * spread.temperature_c
    thermal = robot.joints[axis - 1].thermal
    factors = np.clip(own.standard_normal(4), -2.5, 2.5)
    remount = own.uniform(0.0, 2.0 * np.pi, 5)
    return AxisSession(
        temperature_c=thermal.ambient_c + room + 0.3 * spread.temperature_c * factors[0],
        friction=1.0 + spread.friction * factors[1],
        viscous=1.0 + spread.viscous * factors[2],
        error=1.0 + spread.kinematic_error * factors[3],
        mount_rad=remount if spread.remount else mount,
        phase_gain=gain + spread.sensor_gain * own.standard_normal(3),
        phase_offset_a=offset + spread.sensor_offset_a * own.standard_normal(3),
    )


def stream(seed: int, *key: int) -> np.random.Generator:
    """Return the random stream of one purpose: the same whatever else was drawn before.

    Parameters
    ----------
    seed : int
        Not negative.
    *key : int
        What the stream is for.

    Returns
    -------
    numpy.random.Generator
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=key)))
