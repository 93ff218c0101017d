"""A cobot of three joints (yaw, shoulder, elbow) with strain wave gears, as its controller logs it.

The links' dynamics are coupled, and every gear has a spring that stiffens, a kinematic error,
friction that depends on speed, load and temperature, and perhaps a damaged tooth or a rough place.
A PI velocity loop below a position loop sees a quantised motor encoder; the current is logged
behind a filter, with noise, and rounded. It shares no code with the package nor with the other
sources, and no choice of the loop was made by it.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.random import Generator
from numpy.typing import NDArray

Floats = NDArray[np.float64]
RATIO = 101.0
POLE_PAIRS = 5
STEP_HZ = 8000
"""Of the mechanics; the drive's loops and the log take every so many of these steps."""
LOW_RAD, HIGH_RAD = np.array([-1.6, -0.2, -1.8]), np.array([1.6, 1.5, 0.3])
SECONDS = 60.0
"""Of a recording, in whole cycles of which there are `CYCLES`."""
CYCLES = (3, 8)
HIDDEN = {
    "ripple": "ripple",
    "comb": "ripple",
    "stribeck": "stribeck",
    "load friction": "load_friction",
    "quadratic friction": "quadratic_friction",
    "pit": "position_drag",
    "warming": "warmup",
    "warming with thermometer": "thermal_viscous",
    "payload": "payload_change",
    "delay": "time_delay",
    "offset": "offset",
}
"""What can be hidden, and the effect that is its right name."""
DELAY_SAMPLES = 3
OFFSET_A = 0.4
PAYLOAD_KG = 2.0


class Links(NamedTuple):
    """Two rods on a turning base, with a point mass at the end of each."""

    upper_m: float
    fore_m: float
    elbow_kg: float
    hand_kg: float
    base_inertia: float  # kg m²
    shoulder_inertia: float
    elbow_inertia: float


class Joints(NamedTuple):
    """Constants of the three joints, all as seen at the joint; shape (3,)."""

    inertia: Floats  # of the motor, kg m²
    torque_per_a: Floats  # N.m/A
    stiffness: Floats  # N.m/rad
    stiffening: Floats  # 1/rad², of the spring's cubic part
    damping: Floats  # N.m s/rad, of the gear
    encoder_rad: Floats  # step of the motor's encoder
    kinematic_error: Floats  # rad, twice a turn of the motor; other orders in proportion
    error_phase: Floats  # rad
    comb: Floats  # rad, where the wave generator's lobes pass a damaged tooth of the flexspline
    dry: Floats  # N.m at 25 °C
    load_share: Floats  # of the gear's torque that rubs
    stribeck: Floats  # N.m
    stribeck_speed: Floats  # rad/s
    viscous: Floats  # N.m s/rad at 25 °C
    quadratic: Floats  # N.m s²/rad²
    pit: Floats  # N.m
    pit_place: Floats  # rad
    cogging: Floats  # share of the motor's torque
    begins_c: Floats  # °C
    heating: Floats  # °C/rad


class Drive(NamedTuple):
    """The three cascades and what is logged of them; gains of shape (3,)."""

    position_gain: float  # 1/s
    velocity_gain: Floats  # A s/rad
    integral_gain: float  # 1/s
    loop_steps: int
    log_steps: int
    filter_share: float  # of the logged current, per step of the mechanics


@dataclass(frozen=True)
class Cobot:
    """One arm with its program; one joint moves, the others hold."""

    seed: int
    moving: int
    links: Links
    joints: Joints
    bandwidth: float  # rad/s, of the velocity loop
    position_gain: float
    integral_gain: float
    loop_steps: int
    rate_hz: int
    cut_hz: float
    step_a: float
    noise_a: float
    smooth: bool
    places: tuple[Floats, ...]
    rests_s: Floats
    top_speed: Floats
    most_acceleration: Floats


@dataclass(frozen=True)
class Record:
    """What is logged of the joint that moves, shape (n,) each."""

    rate_hz: float
    current: Floats
    position: Floats
    temperature: Floats


@njit(cache=True)
def _driven(wanted, links, joints, drive, payload_kg, payload_from, steps):
    """Integrate; `wanted` holds position and speed at the loops' rate, shape (m, 6).

    Returns filtered currents, encoders and temperatures, shape (rows, 9).
    """
    dt = 1 / STEP_HZ
    upper, fore, elbow_kg, hand_kg = links.upper_m, links.fore_m, links.elbow_kg, links.hand_kg
    loop_s = drive.loop_steps * dt
    motor, motor_speed, speed = np.zeros(3), np.zeros(3), np.zeros(3)
    asked, current, filtered = np.zeros(3), np.zeros(3), np.zeros(3)
    seen_speed, torque = np.zeros(3), np.zeros(3)
    motor[:] = wanted[0, :3]
    encoder, heat = motor.copy(), joints.begins_c.copy()
    # It begins at rest, its springs and integrals holding the weight.
    c2, c23 = np.cos(motor[1]), np.cos(motor[1] + motor[2])
    weight = np.array([
        0.0,
        9.81 * (elbow_kg * upper * c2 + hand_kg * (upper * c2 + fore * c23)),
        9.81 * hand_kg * fore * c23,
    ])  # fmt: skip
    place = motor - weight / joints.stiffness
    integral = weight / joints.torque_per_a
    out = np.zeros(((steps + drive.log_steps - 1) // drive.log_steps, 9))
    for step in range(steps):
        carried = hand_kg + (payload_kg if step * dt >= payload_from else 0.0)
        if step % drive.loop_steps == 0:
            row = wanted[step // drive.loop_steps]
            for k in range(3):
                fine = joints.encoder_rad[k]
                read = np.floor(motor[k] / fine + 0.5) * fine
                seen_speed[k] += 0.5 * ((read - encoder[k]) / loop_s - seen_speed[k])
                encoder[k] = read
                lag = row[3 + k] + drive.position_gain * (row[k] - read) - seen_speed[k]
                gain = drive.velocity_gain[k]
                integral[k] += gain * drive.integral_gain * lag * loop_s
                asked[k] = gain * lag + integral[k]
        for k in range(3):
            current[k] += dt / 0.0006 * (asked[k] - current[k])
            turn = RATIO * motor[k]
            size, phase = joints.kinematic_error[k], joints.error_phase[k]
            error = (
                size * np.sin(2 * turn + phase)
                + 0.3 * size * np.sin(4 * turn + 1.3 * phase)
                + 0.15 * size * np.sin(turn + 0.4)
                + 0.1 * size * np.sin(6 * turn + 2)
            )
            if joints.comb[k] != 0.0:
                passed = turn * (RATIO + 1) / RATIO
                passed = passed - np.pi * np.floor(passed / np.pi)
                near = min(passed, np.pi - passed)
                error -= joints.comb[k] * np.exp(-0.5 * (near / 0.2) ** 2)
            twist = motor[k] + error - place[k]
            torque[k] = joints.stiffness[k] * twist * (1 + joints.stiffening[k] * twist * twist)
            torque[k] += joints.damping[k] * (motor_speed[k] - speed[k])
            heat[k] += dt * (joints.heating[k] * abs(motor_speed[k]))
            warmer = heat[k] - 25.0
            rubbing = (
                joints.dry[k] * (1 - 0.004 * warmer)
                + joints.load_share[k] * abs(torque[k])
                + joints.stribeck[k] * np.exp(-((motor_speed[k] / joints.stribeck_speed[k]) ** 2))
            )
            if joints.pit[k] != 0.0:
                beside = (place[k] - joints.pit_place[k]) / 0.03
                rubbing += joints.pit[k] * np.exp(-0.5 * beside**2)
            friction = (
                rubbing * np.tanh(motor_speed[k] / 0.003)
                + joints.viscous[k] * np.exp(-0.022 * warmer) * motor_speed[k]
                + joints.quadratic[k] * motor_speed[k] * abs(motor_speed[k])
            )
            cogging = 1 + joints.cogging[k] * np.sin(6 * POLE_PAIRS * turn)
            driving = joints.torque_per_a[k] * current[k] * cogging
            motor_speed[k] += dt * (driving - friction - torque[k]) / joints.inertia[k]
        for k in range(3):
            motor[k] += dt * motor_speed[k]
        s2, c2, s3, c3 = np.sin(place[1]), np.cos(place[1]), np.sin(place[2]), np.cos(place[2])
        s23, c23 = np.sin(place[1] + place[2]), np.cos(place[1] + place[2])
        at_elbow, at_hand = upper * c2, upper * c2 + fore * c23
        m11 = links.base_inertia + elbow_kg * at_elbow * at_elbow + carried * at_hand * at_hand
        dropped = upper * s2 + fore * s23
        m11_by_2 = -2 * elbow_kg * at_elbow * upper * s2 - 2 * carried * at_hand * dropped
        m11_by_3 = -2 * carried * at_hand * fore * s23
        m22 = (
            elbow_kg * upper * upper
            + carried * (upper * upper + fore * fore + 2 * upper * fore * c3)
            + links.shoulder_inertia
        )
        m23 = carried * (fore * fore + upper * fore * c3) + links.elbow_inertia
        m33 = carried * fore * fore + links.elbow_inertia
        twice = carried * upper * fore * s3
        pull1 = torque[0] - (m11_by_2 * speed[1] + m11_by_3 * speed[2]) * speed[0]
        pull2 = (
            torque[1]
            + twice * (2 * speed[1] * speed[2] + speed[2] * speed[2])
            + 0.5 * m11_by_2 * speed[0] * speed[0]
            - 9.81 * (elbow_kg * upper * c2 + carried * (upper * c2 + fore * c23))
        )
        pull3 = (
            torque[2]
            - twice * speed[1] * speed[1]
            + 0.5 * m11_by_3 * speed[0] * speed[0]
            - 9.81 * carried * fore * c23
        )
        determinant = m22 * m33 - m23 * m23
        speed[0] += dt * pull1 / m11
        speed[1] += dt * (m33 * pull2 - m23 * pull3) / determinant
        speed[2] += dt * (m22 * pull3 - m23 * pull2) / determinant
        for k in range(3):
            place[k] += dt * speed[k]
            filtered[k] += drive.filter_share * (current[k] - filtered[k])
        if step % drive.log_steps == 0:
            row_out = out[step // drive.log_steps]
            row_out[:3], row_out[3:6], row_out[6:] = filtered, encoder, heat
    return out


def draw(seed: int, moving: int, *, whole: bool) -> Cobot:
    """Draw an arm.

    Parameters
    ----------
    seed : int
    moving : int
        The joint that moves: 0 yaw, 1 shoulder, 2 elbow.
    whole : bool
        With kinematic error, stiffening, load friction, Stribeck friction and cogging. Without
        them the gears are four times as stiff besides, and little but warmth lacks in a rigid
        model.
    """
    rng = np.random.default_rng([77, seed])
    links = Links(
        rng.uniform(0.38, 0.48), rng.uniform(0.35, 0.45), rng.uniform(4, 7), rng.uniform(2.5, 5),
        rng.uniform(0.3, 0.8), 0.1, 0.05,
    )  # fmt: skip
    none = np.zeros(3)
    inertia = np.array([0.9, 0.9, 0.5]) * rng.uniform(0.7, 1.3, 3)
    torque_per_a = np.array([11.0, 11, 8]) * rng.uniform(0.85, 1.15, 3)
    stiffness = np.array([2.2e4, 2.2e4, 1.1e4]) * rng.uniform(0.8, 1.3, 3)
    counts = rng.choice([4096, 8192, 16384])
    error, phase = rng.uniform(0.5, 2.2, 3) * 1e-4, rng.uniform(0, 6.28, 3)
    stiffening, damping = rng.uniform(0, 2e4), rng.uniform(20, 60, 3)
    dry = np.array([7.0, 7, 3.5]) * rng.uniform(0.7, 1.3, 3)
    load_share = rng.uniform(0.02, 0.06, 3)
    stribeck, stribeck_speed = dry * rng.uniform(0.1, 0.4, 3), rng.uniform(0.03, 0.12, 3)
    viscous = np.array([9.0, 9, 5]) * rng.uniform(0.7, 1.4, 3)
    cogging = rng.uniform(0, 0.01, 3)
    bandwidth, position_gain = rng.uniform(70, 130), rng.uniform(15, 30)
    integral_gain = rng.uniform(8, 20)
    loop_steps, rate_hz = int(rng.choice([4, 8])), int(rng.choice([125, 250, 500]))
    cut_hz = rng.uniform(40, 150)
    step_a, noise_a = float(rng.choice([0.001, 0.004, 0.01])), rng.uniform(0.005, 0.03)
    smooth = bool(rng.integers(2))
    places, rests_s = _program(rng, moving)
    top_speed = rng.uniform(0.7, 1.6) * np.array([1, 1, 1.2])
    most_acceleration = rng.uniform(3, 8) * np.ones(3)
    heating = np.full(3, rng.uniform(0.03, 0.1))
    joints = Joints(
        inertia, torque_per_a, stiffness if whole else 4 * stiffness,
        np.full(3, stiffening) if whole else none, damping,
        np.full(3, 2 * np.pi / RATIO / counts), error if whole else none, phase, none, dry,
        load_share if whole else none, stribeck if whole else none, stribeck_speed, viscous, none,
        none, none, cogging if whole else none, none, heating,
    )  # fmt: skip
    return Cobot(
        seed, moving, links, joints, bandwidth, position_gain, integral_gain, loop_steps, rate_hz,
        cut_hz, step_a, noise_a, smooth, places, rests_s, top_speed, most_acceleration,
    )  # fmt: skip


def _program(rng: Generator, moving: int) -> tuple[tuple[Floats, ...], Floats]:
    """Six places (rad, shape (3,) each) and back to the first; rests after each (s)."""
    home = np.array([rng.uniform(-0.4, 0.4), rng.uniform(0.3, 0.9), rng.uniform(-0.9, -0.2)])
    places = [home]
    for _ in range(5):
        way = rng.choice([-1, 1], 3) * rng.uniform(0.35, 1.2, 3)
        way[np.arange(3) != moving] = 0
        here = places[-1]
        there = here + way
        # What would leave the range turns round.
        there = np.where(there > HIGH_RAD, here - abs(way), there)
        there = np.where(here + way < LOW_RAD, here + abs(way), there)
        places.append(np.clip(there, LOW_RAD, HIGH_RAD))
    return (*places, home), rng.uniform(0.25, 0.8, 6)


def _move(here: Floats, there: Floats, cobot: Cobot, loop_hz: float) -> Floats:
    """Position and speed of one move, shape (n, 6): trapezoid, or polynomial of seventh order."""
    way = there - here
    long = 0.0
    for k, length in enumerate(abs(way)):
        top, most = cobot.top_speed[k], cobot.most_acceleration[k]
        if length < 1e-9:
            continue
        if cobot.smooth:
            long = max(long, 2.19 * length / top, np.sqrt(7.52 * length / most))
        elif length > top**2 / most:
            long = max(long, length / top + top / most)
        else:
            long = max(long, 2 * np.sqrt(length / most))
    n = max(2, round(long * loop_hz))
    u = (np.arange(n) + 1) / n
    if cobot.smooth:
        s = u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)
        ds = 140 * u**3 * (1 - u) ** 3
    else:
        p = 0.25
        ends = 1 - (1 - u) ** 2 / (2 * p * (1 - p))
        s = np.where(
            u < p, u * u / (2 * p * (1 - p)), np.where(u > 1 - p, ends, (u - p / 2) / (1 - p))
        )
        slows = np.where(u > 1 - p, (1 - u) / (p * (1 - p)), 1 / (1 - p))
        ds = np.where(u < p, u / (p * (1 - p)), slows)
    return np.hstack([here + s[:, None] * way, ds[:, None] * way / (n / loop_hz)])


def _wanted(cobot: Cobot, rng: Generator, cycles: int) -> Floats:
    """Position and speed that the loops are to follow, shape (n, 6)."""
    loop_hz = STEP_HZ / cobot.loop_steps

    def rest(place: Floats, seconds: float) -> Floats:
        still = np.concatenate([place, np.zeros(3)])
        return np.tile(still, (max(1, int(seconds * loop_hz)), 1))

    parts = [rest(cobot.places[0], 0.5 + 0.4 * rng.random())]
    for _ in range(cycles):
        for (here, there), seconds in zip(pairwise(cobot.places), cobot.rests_s, strict=True):
            parts.append(_move(here, there, cobot, loop_hz))
            parts.append(rest(there, seconds * (1 + 0.02 * rng.standard_normal())))
    parts.append(rest(cobot.places[-1], 0.5))
    return np.vstack(parts)


def _with(joints: Joints, hidden: str, k: int, place: float) -> Joints:
    """Hide something in the mechanics of joint k; `place` is where its pit would be (rad)."""

    def changed(**values: float) -> Joints:
        new = {name: getattr(joints, name).copy() for name in values}
        for name, value in values.items():
            new[name][k] = value
        return joints._replace(**new)

    dry = joints.dry[k]
    return {
        "ripple": changed(kinematic_error=joints.kinematic_error[k] + 2e-4),
        "comb": changed(comb=3e-4, dry=dry * 1.1),
        "stribeck": changed(stribeck=5.0, stribeck_speed=0.08),
        "load friction": changed(load_share=0.12),
        "quadratic friction": changed(quadratic=6.0),
        "pit": changed(pit=0.6 * dry, pit_place=place),
        "warming": changed(heating=0.6),
        "warming with thermometer": changed(heating=0.6),
    }.get(hidden, joints)


def record(cobot: Cobot, hidden: str = "") -> Record:
    """Record the joint that moves.

    Parameters
    ----------
    cobot : Cobot
    hidden : str
        Of `HIDDEN`; empty for nothing.
    """
    moving = cobot.moving
    loop_hz = STEP_HZ / cobot.loop_steps
    cycle_s = len(_wanted(cobot, np.random.default_rng([78, cobot.seed, 0, 0]), 1)) / loop_hz
    cycles = int(np.clip(SECONDS // cycle_s, *CYCLES))
    rng = np.random.default_rng([78, cobot.seed, 0, 0])
    wanted = _wanted(cobot, rng, cycles)
    seconds = len(wanted) / loop_hz

    day = np.random.default_rng([79, cobot.seed, 0])
    joints = cobot.joints._replace(
        begins_c=27 + day.uniform(0, 1, 3),
        dry=cobot.joints.dry * (1 + 0.02 * day.standard_normal(3)),
    )
    wobble = 1 + 0.02 * day.standard_normal(3)
    places = np.array(cobot.places)[:, moving]
    pit_place = 0.5 * (places.min() + places.max()) + 0.15 * (places.max() - places.min())
    drive = Drive(
        cobot.position_gain,
        joints.inertia * 2 * cobot.bandwidth * wobble / joints.torque_per_a,
        cobot.integral_gain,
        cobot.loop_steps,
        STEP_HZ // cobot.rate_hz,
        1 - np.exp(-2 * np.pi * cobot.cut_hz / STEP_HZ),
    )
    payload = (PAYLOAD_KG, 0.5 * cycle_s * cycles) if hidden == "payload" else (0.0, 0.0)
    out = _driven(
        wanted, cobot.links, _with(joints, hidden, moving, pit_place), drive, *payload,
        int((seconds - 0.002) * STEP_HZ),
    )[: int(seconds * cobot.rate_hz) - 2]  # fmt: skip
    current = out[:, moving] + cobot.noise_a * rng.standard_normal((len(out), 3))[:, moving]
    if hidden == "offset":
        current = current + OFFSET_A
    if hidden == "delay":
        current = np.concatenate([np.repeat(current[:1], DELAY_SAMPLES), current[:-DELAY_SAMPLES]])
    return Record(
        cobot.rate_hz,
        np.round(current / cobot.step_a) * cobot.step_a,
        out[:, 3 + moving],
        out[:, 6 + moving],
    )
