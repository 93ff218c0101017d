"""A joint whose drive follows a program: two masses, a sprung gear, two control loops, a cold hall.

It shares no code with the package nor with the other sources, and no choice was made by it. The
current is what the velocity loop asks for: what ails the gear shows as the drive answers it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

LOOP_HZ = 2000.0
PER_STEP = 4
"""Steps of the mechanics in one of the loops."""
STIFFER_K = 0.03
DRIER_K = 0.008
"""By which viscous and dry friction grow for each degree that it is colder."""
MOTOR_BITS, JOINT_BITS = 20, 18
FAULTS = ("friction", "tooth", "backlash", "bump", "stiffness")


@dataclass(frozen=True)
class Mechanics:
    """Constants of the joint, motor side unless said; torque in Nm, angles in rad."""

    ratio: float
    motor_inertia: float
    link_inertia: float
    stiffness: float
    damping: float
    torque_per_a: float
    dry: float
    viscous: float
    exponent: float
    stribeck: float
    stribeck_speed: float
    meshing: float
    link_dry: float
    gravity: float
    kinematic_error: float
    cogging: float
    position_gain: float
    velocity_gain: float
    integral_gain: float
    most_a: float
    tooth: float = 0.0
    bump: float = 0.0
    backlash: float = 0.0


@dataclass(frozen=True)
class ClosedLoopJoint:
    """One joint with its program and its sensors."""

    seed: int
    mechanics: Mechanics
    places: tuple[float, ...]
    speed: float
    steepest: float
    dwell_s: float
    cycles: int
    noise_a: float
    step_a: float
    at_motor: bool


def draw_joint(seed: int) -> ClosedLoopJoint:
    rng = np.random.default_rng([77, seed])
    ratio = float(rng.choice([80, 100, 120, 160]))
    torque_per_a = rng.uniform(0.08, 0.25)
    motor = 10 ** rng.uniform(-4.6, -4.0)
    link = motor * ratio**2 * rng.uniform(0.5, 2.0)
    stiffness = link * (2 * np.pi * rng.uniform(12, 28)) ** 2
    speed = rng.uniform(0.8, 2.5)
    steepest = speed * rng.uniform(3, 6)
    inertia = motor + link / ratio**2
    torque = inertia * ratio * steepest
    dry, exponent = torque * rng.uniform(0.3, 0.8), rng.uniform(0.6, 1.0)
    gravity = float(rng.choice([0.0, 1.0])) * torque * ratio * rng.uniform(0.5, 2)
    bandwidth = 2 * np.pi * rng.uniform(15, 30)
    velocity_gain = inertia * bandwidth / torque_per_a
    most_a = 12 * (torque + dry + gravity / ratio) / torque_per_a
    mechanics = Mechanics(
        ratio=ratio,
        motor_inertia=motor,
        link_inertia=link,
        stiffness=stiffness,
        damping=2 * rng.uniform(0.05, 0.12) * np.sqrt(0.3 * stiffness * link),
        torque_per_a=torque_per_a,
        dry=dry,
        viscous=torque * rng.uniform(0.3, 1.0) / (speed * ratio) ** exponent,
        exponent=exponent,
        stribeck=dry * rng.uniform(0, 0.3),
        stribeck_speed=speed * ratio * rng.uniform(0.02, 0.1),
        meshing=rng.uniform(0.02, 0.1),
        link_dry=dry * ratio * rng.uniform(0.1, 0.4),
        gravity=gravity,
        kinematic_error=rng.uniform(2e-5, 8e-5),
        cogging=rng.uniform(0, 0.02),
        position_gain=bandwidth / 6,
        velocity_gain=velocity_gain,
        integral_gain=velocity_gain * bandwidth / 4,
        most_a=most_a,
    )
    places = rng.uniform(-1.2, 1.2, int(rng.integers(3, 6)))
    return ClosedLoopJoint(
        seed=seed,
        mechanics=mechanics,
        places=(0.0, *places.tolist(), 0.0),
        speed=speed,
        steepest=steepest,
        dwell_s=rng.uniform(0.1, 0.6),
        cycles=int(rng.integers(2, 5)),
        noise_a=10 ** rng.uniform(-2.6, -1.9) * (torque + dry) / torque_per_a,
        step_a=2 * most_a / 2.0 ** int(rng.integers(11, 14)),
        at_motor=bool(rng.integers(2)),
    )


def faulty(mechanics: Mechanics, fault: str, size: float) -> Mechanics:
    """Of size 1: friction twice as large, a comb of 0.6 mrad, 2 mrad of play, 40 % stiff."""
    m = mechanics
    return {
        "friction": replace(m, dry=m.dry * (1 + size), viscous=m.viscous * (1 + size)),
        "tooth": replace(m, tooth=6e-4 * size),
        "backlash": replace(m, backlash=2e-3 * size),
        "bump": replace(m, bump=m.dry * size),
        "stiffness": replace(m, stiffness=m.stiffness * 0.4**size),
    }[fault]


def record(
    joint: ClosedLoopJoint,
    session: int,
    colder_k: float,
    rate_hz: float,
    fault: str | None = None,
    size: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the reported current (A) and the position (rad, joint side) of one session."""
    rng = np.random.default_rng([78, joint.seed, session])
    m = joint.mechanics
    dry = np.exp(DRIER_K * colder_k + rng.normal(0, 0.02))
    m = replace(m, dry=m.dry * dry, viscous=m.viscous * np.exp(STIFFER_K * colder_k))
    if fault is not None:
        m = faulty(m, fault, size)
    cycle = program(joint)
    wait = np.zeros(int(rng.uniform(0.2, 1.0) * LOOP_HZ))
    wanted = np.concatenate([wait, *[cycle] * joint.cycles])
    asked, motor, link = _driven(wanted, 1 / LOOP_HZ, **vars(m))
    step = round(LOOP_HZ / rate_hz)
    gain, offset = 1 + rng.normal(0, 0.004), rng.normal(0, 0.3) * joint.noise_a
    seen = np.convolve(gain * asked + offset, np.ones(step) / step)[: asked.size : step]
    seen = seen + rng.normal(0, joint.noise_a, seen.size)
    position = (motor / m.ratio if joint.at_motor else link)[::step]
    least = 2 * np.pi / 2.0 ** (MOTOR_BITS if joint.at_motor else JOINT_BITS)
    return _stepped(seen, joint.step_a), _stepped(position, least)


def _stepped(values: np.ndarray, step: float) -> np.ndarray:
    return np.round(values / step) * step


def program(joint: ClosedLoopJoint) -> np.ndarray:
    """Cycloids from place to place."""
    parts = [np.full(int(0.5 * LOOP_HZ), joint.places[0])]
    for start, stop in zip(joint.places[:-1], joint.places[1:], strict=True):
        way = abs(stop - start)
        long = max(2 * way / joint.speed, np.sqrt(2 * np.pi * way / joint.steepest), 0.2)
        t = np.arange(0, long, 1 / LOOP_HZ) / long
        parts.append(start + (stop - start) * (t - np.sin(2 * np.pi * t) / (2 * np.pi)))
        parts.append(np.full(int(joint.dwell_s * LOOP_HZ), stop))
    parts.append(np.full(int(0.5 * LOOP_HZ), joint.places[-1]))
    return np.concatenate(parts)


@njit(cache=True)
def _driven(
    wanted, dt, ratio, motor_inertia, link_inertia, stiffness, damping, torque_per_a, dry, viscous,
    exponent, stribeck, stribeck_speed, meshing, link_dry, gravity, kinematic_error, cogging,
    position_gain, velocity_gain, integral_gain, most_a, tooth, bump, backlash,
):  # fmt: skip
    n = wanted.size
    motor, speed, link, link_speed = wanted[0] * ratio, 0.0, wanted[0], 0.0
    integral = gravity * np.sin(link) / ratio / torque_per_a
    current, motors, links = np.empty(n), np.empty(n), np.empty(n)
    h = dt / PER_STEP
    for i in range(n):
        ahead = (wanted[i + 1] - wanted[i - 1]) / (2 * dt) if 0 < i < n - 1 else 0.0
        lag = position_gain * (wanted[i] * ratio - motor) + ahead * ratio - speed
        integral += integral_gain * lag * dt
        asked = min(max(velocity_gain * lag + integral, -most_a), most_a)
        current[i], motors[i], links[i] = asked, motor, link
        for _ in range(PER_STEP):
            error = kinematic_error * (np.sin(2 * motor + 0.3) + 0.3 * np.sin(4 * motor + 1.0))
            error += tooth * max(np.sin(2 * (motor + link)), 0.0) ** 4
            twist = motor / ratio - link + error
            twist = np.sign(twist) * max(abs(twist) - backlash, 0.0)
            # a strain wave gear stiffens with its load
            torque = stiffness * twist * (1 + 0.3 * min((twist / 2e-3) ** 2, 1.0))
            torque += damping * (speed / ratio - link_speed)
            rubbing = dry + stribeck * np.exp(-abs(speed) / stribeck_speed)
            rubbing += meshing * abs(torque) / ratio + bump * np.exp(-(((link - 0.3) / 0.06) ** 2))
            friction = np.tanh(speed / 0.5) * rubbing
            friction += viscous * np.sign(speed) * abs(speed) ** exponent
            driving = torque_per_a * asked * (1 + cogging * np.sin(30 * motor))
            speed += h * (driving - friction - torque / ratio) / motor_inertia
            motor += h * speed
            held = gravity * np.sin(link) + link_dry * np.tanh(link_speed / 0.005)
            link_speed += h * (torque - held) / link_inertia
            link += h * link_speed
    return current, motors, links
