"""A joint of an industrial arm under a cascaded drive, with S-curves and a reported current.

It shares no code with the package nor with the other sources. The drive steps at 2 kHz; the log
holds the means of current and position over its own, slower period.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit
from numpy.random import Generator
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DRIVE_HZ = 2000.0
STROKES = ("cyclic", "program", "single")
RATES_HZ = (100.0, 125.0, 250.0, 500.0, 1000.0)
COLUMNS = {"inertia": [0], "gravity": [1, 2], "offset": [3], "coulomb": [4], "viscous": [5]}
EFFECTS = (
    "stribeck", "quadratic_friction", "sublinear_friction", "asymmetric_friction", "load_friction",
    "position_drag", "spring", "payload_change", "ripple", "elasticity", "hysteresis", "warmup",
    "time_delay", "offset", "mains_hum", "thermal_viscous", "coulomb", "viscous", "gravity",
    "inertia",
)  # fmt: skip
SWITCHES = (
    "stribeck", "stribeck_speed", "quadratic", "power", "exponent", "asymmetry", "meshing",
    "drag", "drag_at", "drag_width", "spring", "neutral", "loaded_from", "load_sin", "load_cos",
    "load_inertia", "ripple", "order", "phase", "dahl", "dahl_length", "warm", "warm_s", "hum",
    "hum_hz", "cold", "cold_per_c", "offset", "dry", "viscous", "weight", "weight_at", "inertia",
)  # fmt: skip
SIZES = (
    "stribeck", "quadratic", "power", "asymmetry", "meshing", "drag", "spring", "load_sin",
    "load_cos", "load_inertia", "ripple", "dahl", "warm", "hum", "cold", "offset", "dry",
    "viscous", "weight", "inertia",
)  # fmt: skip


@dataclass(frozen=True)
class Made:
    """What was logged, shape (n,) each, and what is hidden in it."""

    rate_hz: float
    current: Floats
    position: Floats
    temperature: Floats
    declared: tuple[str, ...]
    noise_a: float
    size: float
    """Of what the declared effects cannot hold of the hidden one, over the noise."""


@njit(cache=True)
def _drive(joint, hidden, wanted, wanted_speed, wanted_acceleration, warmer, steps):
    """Current, angle, speed, acceleration and hidden current, as means over each of the steps."""
    inertia, viscous, dry, offset, sine, cosine, stiffness, damping, share, bandwidth = joint
    (stribeck, stribeck_speed, quadratic, power, exponent, asymmetry, meshing, drag, drag_at,
     drag_width, spring, neutral, loaded_from, load_sin, load_cos, load_inertia, ripple, order,
     phase, dahl, dahl_length, warm, warm_s, hum, hum_hz, cold, cold_per_c, more, drier, thicker,
     weight, weight_at, heavier) = hidden  # fmt: skip
    tuned = inertia + heavier  # whoever sets up a drive tunes it to what it moves
    velocity_gain, position_gain = tuned * bandwidth, bandwidth / 5
    logged = np.zeros((5, wanted.size))
    angle = link = wanted[0]
    speed = link_speed = bristle = 0.0
    held = sine * np.sin(angle) + cosine * np.cos(angle) + offset
    current, dt = held, 1.0 / DRIVE_HZ
    h = dt / steps
    for j in range(wanted.size):
        error = position_gain * (wanted[j] - angle) + wanted_speed[j] - speed
        held += velocity_gain * bandwidth / 5 * error * dt
        asked = velocity_gain * error + held + tuned * wanted_acceleration[j]
        for s in range(steps):
            t = j * dt + s * h
            current += (asked - current) * h / 8e-4
            side, size = np.tanh(speed / 2e-3), abs(speed)
            carried = heavier
            at = link if stiffness > 0 else angle
            load = sine * np.sin(at) + cosine * np.cos(at)
            bristle += speed * h / dahl_length * (1 - side * bristle)
            extra = side * (
                stribeck * np.exp(-((size / stribeck_speed) ** 2)) + quadratic * size**2
                + power * size**exponent + drier
                + drag * np.exp(-0.5 * ((angle - drag_at) / drag_width) ** 2)
                + meshing * abs(load + share * inertia * wanted_acceleration[j])
            )  # fmt: skip
            extra += asymmetry * (0.3 * stribeck_speed + size) + spring * (angle - neutral) + more
            if t >= loaded_from:
                extra += load_sin * np.sin(angle) + load_cos * np.cos(angle)
                carried += load_inertia
            extra += ripple * np.sin(order * angle + phase) + dahl * bristle
            extra += speed * (warm * np.exp(-t / warm_s) + thicker)
            extra += speed * cold * (np.exp(-cold_per_c * warmer[j]) - 1)
            extra += weight * np.sin(angle + weight_at)
            resists = dry * side + viscous * speed + offset + extra
            before = angle
            if stiffness > 0:
                twist = stiffness * (angle - link) + damping * (speed - link_speed)
                acceleration = (current - resists - twist) / (inertia * (1 - share) + carried)
                link_speed += (twist - load) / (inertia * share) * h
                link += link_speed * h
            else:
                acceleration = (current - resists - load) / (inertia + carried)
            extra += carried * acceleration
            speed += acceleration * h
            angle += speed * h
            hums = hum * np.sin(2 * np.pi * hum_hz * t)
            logged[0, j] += (current + hums) / steps
            logged[1, j] += 0.5 * (before + angle) / steps
            logged[2, j] += speed / steps
            logged[3, j] += acceleration / steps
            logged[4, j] += (extra + hums) / steps
    return logged


def _move(way: float, top: float, steepest: float, jerk_s: float) -> Floats:
    """Speeds of one move, a trapezoid rounded off by a moving average."""
    top = min(top, float(np.sqrt(abs(way) * steepest)))
    ramp, length = top / steepest, abs(way) / top + top / steepest
    t = np.arange(int(np.ceil(length * DRIVE_HZ))) / DRIVE_HZ
    speed = np.clip(np.minimum(t, length - t) / ramp, 0, 1)
    width = max(int(jerk_s * DRIVE_HZ), 1)
    speed = np.convolve(speed, np.full(width, 1 / width))
    return np.asarray(speed * way * DRIVE_HZ / speed.sum())


def _path(rng: Generator, stroke: str, minutes: float) -> tuple[Floats, Floats, Floats, float]:
    """Angle, speed and acceleration that the drive wants, and how wide they reach."""
    span, home = rng.uniform(0.6, 2.6), rng.uniform(-1, 1)
    top = span * rng.uniform(0.25, 1.1)
    steepest, jerk_s = top * rng.uniform(2.5, 8), rng.uniform(0.02, 0.12)
    rest = np.zeros(int(0.3 * DRIVE_HZ))

    def program() -> Floats:
        places = [home, *(home + span * rng.uniform(-0.5, 0.5, rng.integers(3, 7))), home]
        parts = []
        for a, b in pairwise(places):
            if abs(b - a) > 0.02 * span:
                parts.append(_move(b - a, top * rng.uniform(0.4, 1), steepest, jerk_s))
                parts.append(np.zeros(int(rng.choice([0.02, 0.15, 0.4]) * DRIVE_HZ)))
        return np.concatenate(parts)

    samples = minutes * 60 * DRIVE_HZ
    if stroke == "cyclic":
        once = program()
        speed = np.tile(once, max(int(np.ceil(samples / once.size)), 4))
    elif stroke == "program":
        parts = [program()]
        while sum(part.size for part in parts) < samples:
            parts.append(program())
        speed = np.concatenate(parts)
    else:
        there = _move(1.4 * span, 1.4 * span / (min(minutes * 60, 25) - 1), steepest, jerk_s)
        speed = np.concatenate([there, rest, -there])
        home -= 0.7 * span
    speed = np.concatenate([rest, speed, rest])
    return home + np.cumsum(speed) / DRIVE_HZ, speed, np.gradient(speed) * DRIVE_HZ, span


def _hidden(
    rng: Generator, name: str, angle: Floats, span: float, top: float, ratio: float
) -> dict[str, float]:
    """Switches of one effect, in a size of about 1."""
    u, length_s = rng.uniform, angle.size / DRIVE_HZ
    drawn: dict[str, Callable[[], dict[str, float]]] = {
        "stribeck": lambda: {"stribeck": 1, "stribeck_speed": top * u(0.04, 0.25)},
        "quadratic_friction": lambda: {"quadratic": 1},
        "sublinear_friction": lambda: {"power": 1, "exponent": u(0.2, 0.6)},
        "asymmetric_friction": lambda: {"asymmetry": 1, "stribeck_speed": top * u(-1, 1)},
        "load_friction": lambda: {"meshing": 1},
        "position_drag": lambda: {
            "drag": 1, "drag_width": span * u(0.03, 0.12),
            "drag_at": float(angle[int(angle.size * u(0.2, 0.8))]),
        },
        "spring": lambda: {"spring": 1, "neutral": u(-1, 1)},
        "payload_change": lambda: {
            "loaded_from": length_s * u(0.3, 0.6), "load_sin": u(0.5, 1),
            "load_cos": u(-0.3, 0.3), "load_inertia": u(0.02, 0.1),
        },
        "ripple": lambda: {
            "ripple": 1, "phase": u(0, 6),
            "order": float(rng.choice([1, 2, 3, 4, 5, 8])) * ratio + 2 * float(rng.integers(2)),
        },
        "hysteresis": lambda: {"dahl": 1, "dahl_length": span * u(0.03, 0.2)},
        "warmup": lambda: {"warm": 1, "warm_s": length_s * u(0.2, 0.7)},
        "mains_hum": lambda: {"hum": 1, "hum_hz": 50 + u(-0.05, 0.05)},
        "thermal_viscous": lambda: {"cold": 1, "cold_per_c": u(0.01, 0.04)},
        "gravity": lambda: {"weight": 1, "weight_at": u(0, 6)},
        "offset": lambda: {"offset": 1},
        "coulomb": lambda: {"dry": 1},
        "viscous": lambda: {"viscous": 1},
        "inertia": lambda: {"inertia": 1},
    }  # fmt: skip
    none = dict.fromkeys(SWITCHES, 0.0) | {
        "stribeck_speed": 1.0, "drag_width": 1.0, "dahl_length": 1.0, "warm_s": 1.0,
        "exponent": 0.5, "loaded_from": np.inf,
    }  # fmt: skip
    return none | (drawn[name]() if name in drawn else {})


def record(number: int, hidden: str, size: float, stroke: str, rate_hz: float) -> Made:
    """Record one joint with an effect of some times the noise hidden in it.

    Raises
    ------
    ValueError
        If no spring or delay of that size can be made.
    """
    rng = np.random.default_rng([number, 77])
    minutes = float(rng.choice([0.5, 0.8, 1.2]))
    wanted, wanted_speed, wanted_acceleration, span = _path(rng, stroke, minutes)
    top = float(np.abs(wanted_speed).max())
    moving = np.abs(wanted_speed) > 0.02 * top
    u, ratio = rng.uniform, float(rng.choice([50, 80, 100, 120, 160]))
    share = u(0.3, 0.7)
    joint = np.array([
        u(0.03, 0.25), u(0.1, 0.6) / top, u(0.15, 0.6), u(-0.1, 0.1), u(0.2, 1.5), u(-0.3, 0.3),
        0.0, 0.0, share, 2 * np.pi * u(15, 40),
    ])  # fmt: skip
    if hidden == "gravity":
        joint[4:6] = 0
    if hidden in ("spring", "load_friction"):
        joint[4] = max(joint[4], 0.6)
    length_s = wanted.size / DRIVE_HZ
    time_s = np.arange(wanted.size) / DRIVE_HZ
    warmer = u(3, 12) * (1 - np.exp(-time_s / (length_s * u(0.3, 1.0))))
    noise_a = u(0.005, 0.03)
    switches = _hidden(rng, hidden, wanted, span, top, ratio)
    declared = tuple(name for name in COLUMNS if name != hidden)
    kept = [place for name in declared for place in COLUMNS[name]]

    def driven(scale: float, joint: Floats, steps: int = 2) -> Floats:
        scaled = [value * scale if key in SIZES else value for key, value in switches.items()]
        laid = (wanted, wanted_speed, wanted_acceleration, warmer)
        return np.asarray(_drive(joint, np.array(scaled), *laid, steps))

    def left(extra: Floats, made: Floats) -> float:
        """Root mean square of what the declared effects do not hold of a current."""
        _, q, v, a, _ = made
        rigid = np.stack([a, np.sin(q), np.cos(q), np.ones(q.size), np.sign(v), v], axis=1)
        rigid, extra = rigid[moving][:, kept], extra[moving]
        rest = extra - rigid @ np.linalg.lstsq(rigid, extra, rcond=None)[0]
        return float(np.sqrt(np.mean(rest**2)))

    made, found = driven(0.0, joint), 0.0
    if hidden == "elasticity":
        tried = []
        for resonance_hz in np.geomspace(6, 60, 12):
            w = 2 * np.pi * resonance_hz
            stiffness = w**2 * joint[0] * share * (1 - share)
            soft = joint.copy()
            soft[6:8] = stiffness, 0.1 * stiffness / w
            rung = driven(0.0, soft, 4)
            if np.isfinite(rung).all() and np.abs(rung[0]).max() < 50:
                tried.append((left(rung[0], rung) / noise_a, rung))
        found, made = min(tried, key=lambda one: abs(np.log(one[0] / size)))
    elif hidden == "time_delay":
        first = left(np.interp(time_s - 1e-3, time_s, made[0]) - made[0], made)
        late_s = 1e-3 * size * noise_a / first
        found = size if late_s < 0.1 else 0.0
        made[0] = np.interp(time_s - late_s, time_s, made[0])
    elif hidden:
        small = driven(1e-3, joint)
        made = driven(1e-3 * size * noise_a / left(small[4], small), joint)
        found = left(made[4], made) / noise_a
    if hidden in ("elasticity", "time_delay") and not size / 3 < found < 3 * size:
        msg = f"{hidden} of {size:g} times the noise cannot be made: {found:.2g}"
        raise ValueError(msg)
    return _logged(rng, made, warmer, rate_hz, declared=declared, noise_a=noise_a, size=found)


def _logged(rng: Generator, made: Floats, warmer: Floats, rate_hz: float, **told: Any) -> Made:
    """Log means over the reporting period, with the current's noise, in steps."""
    every = int(DRIVE_HZ / rate_hz)
    rows = np.stack([made[0], made[1], warmer])
    count = rows.shape[1] // every
    current, position, warm = rows[:, : count * every].reshape(3, count, every).mean(axis=2)
    current = current + told["noise_a"] * rng.normal(size=count)
    least_a = told["noise_a"] * float(rng.choice([0.1, 1.0]))
    step = float(rng.choice([2 * np.pi / 2**19, 2 * np.pi / 2**23, 1e-5]))
    return Made(
        rate_hz,
        np.round(current / least_a) * least_a,
        np.round(position / step) * step,
        np.round((20 + warm) / 0.1) * 0.1,
        **told,
    )
