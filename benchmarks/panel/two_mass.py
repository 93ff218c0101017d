"""An independent joint: two masses on a damped spring, driven by a field-oriented cascade.

Neither a formula nor the testbed: the motor's d and q currents follow their PI loops through
resistance, inductance and back EMF, a PI velocity loop without any feedforward follows a position
loop, dry friction is LuGre's bristle, and the encoder sits on the motor. Everything is integrated
at 20 kHz. An effect is hidden as what it physically is: a torque, a changed spring, a changed
friction law, an inverter's dead time, or an error of what is logged.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
STEP_HZ = 20_000.0
RATES_HZ = (100.0, 500.0, 2000.0)
DECLARED = ("inertia", "gravity", "offset", "coulomb", "viscous")
STROKES = ("cyclic", "one stroke", "torque steps", "several programs")
FEW = {
    "one stroke": (
        "ripple", "mains_hum", "position_drag", "load_friction", "spring", "elasticity",
        "time_delay",
    ),
    "torque steps": (
        "ripple", "stribeck", "position_drag", "hysteresis", "mains_hum", "time_delay",
    ),
}  # fmt: skip
"""Effects that such a stroke can show."""
TORQUES = (
    "stribeck", "quadratic_friction", "sublinear_friction", "asymmetric_friction", "load_friction",
    "thermal_viscous", "warmup", "spring", "payload_change", "position_drag", "hysteresis",
    "ripple",
)  # fmt: skip
"""Their current grows with their magnitude, nearly in proportion."""
SENSORS = ("offset", "mains_hum", "sensor_offset", "sensor_gain")
SEARCHED = {"elasticity": (40.0, 4.0), "time_delay": (5e-4, 0.08), "dead_time": (0.5, 12.0)}
"""A stiffness (as a resonance, Hz), a delay (s), a dead time (V): from hardly anything to much."""
EFFECTS = (*TORQUES, "offset", "mains_hum", "elasticity", "time_delay")
ELECTRICAL = ("sensor_offset", "sensor_gain", "dead_time")


@dataclass(frozen=True)
class TwoMass:
    """Constants of a joint; magnitudes of effects in N.m at the motor unless said otherwise."""

    ratio: float
    pole_pairs: int
    torque_constant: float  # N.m/A, of the q current
    motor_inertia: float
    load_inertia: float
    resonance_hz: float
    damping: float
    gravity: float  # N.m at the joint
    hang: float  # rad
    dry: float
    viscous: float  # N.m s/rad at the motor
    bandwidth_hz: float  # of the velocity loop
    effect: str = ""
    magnitude: float = 0.0
    shape: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Logged:
    """One recording as logged, shape (n,) and (n, 3), and the noise in it."""

    rate_hz: float
    current: Floats
    phases: Floats
    position: Floats
    temperature: Floats


@njit(cache=True)
def _integrate(
    target: Floats,
    torque_mode: bool,
    c: Floats,
    effect: int,
    size: float,
    first: float,
    second: float,
    every: int,
) -> Floats:
    """Integrate; every so many steps log i_q, i_d, motor angle, temperature.

    `target` is the commanded motor angle [rad], or in torque mode the commanded i_q [A].
    """  # fmt: skip
    h = 1.0 / STEP_HZ
    ratio, poles, kt, jm, jl, stiffness, loss, gravity, hang, dry, viscous, band, length, top = c
    resistance, inductance, flux = 0.4, 1.5e-3, kt / (1.5 * poles)
    w_current, w_velocity = 2 * np.pi * 600.0, 2 * np.pi * band
    total = jm + jl / ratio**2
    kp_v, ki_v = total * w_velocity / kt, total * w_velocity**2 / 5.0 / kt
    kp_i, ki_i = inductance * w_current, resistance * w_current
    bristle = 2.0 * dry / 0.02  # deflection of a fiftieth of a radian at the motor
    out = np.empty((target.size // every, 4))
    qm, wm, wl, z, dahl = target[0], 0.0, 0.0, 0.0, 0.0
    if torque_mode:
        qm = 0.0
    ql = qm / ratio
    ql -= gravity * np.sin(ql + hang) / stiffness
    i_d, i_q, sum_v, sum_d, sum_q = 0.0, gravity * np.sin(ql + hang) / ratio / kt, 0.0, 0.0, 0.0
    sum_v, sum_q, heat = i_q, resistance * i_q, 0.0
    for k in range(target.size):
        time = k * h
        # drive
        if torque_mode:
            asked = target[k]
        else:
            wanted = 25.0 * (target[k] - qm)
            if k + 1 < target.size:
                wanted += (target[k + 1] - target[k]) / h
            asked = kp_v * (wanted - wm) + sum_v
            sum_v += h * ki_v * (wanted - wm)
        we = poles * wm
        vd = kp_i * (0.0 - i_d) + sum_d - we * inductance * i_q
        vq = kp_i * (asked - i_q) + sum_q + we * (inductance * i_d + flux)
        sum_d += h * ki_i * (0.0 - i_d)
        sum_q += h * ki_i * (asked - i_q)
        if effect == 20:  # dead time: each phase loses a voltage in the direction of its current
            for phase in range(3):
                angle = poles * qm - phase * 2 * np.pi / 3
                flow = i_d * np.cos(angle) - i_q * np.sin(angle)
                lost = size * np.tanh(flow / 0.05)
                vd -= 2 / 3 * lost * np.cos(angle)
                vq += 2 / 3 * lost * np.sin(angle)
        i_d += h / inductance * (vd - resistance * i_d + we * inductance * i_q)
        i_q += h / inductance * (vq - resistance * i_q - we * (inductance * i_d + flux))
        # friction at the motor, in units of N.m
        speed, joint = abs(wm), abs(wm) / top
        level, wet = dry, viscous * wm
        torque = stiffness * (qm / ratio - ql) + loss * (wm / ratio - wl)
        if effect == 0:
            level += size * np.exp(-((joint / first) ** 2))
        elif effect == 1:
            wet += size * joint * wm / top
        elif effect == 2:
            level += size * joint**first
        elif effect == 3 and wm > 0:
            level += size * first
            wet += size * joint
        elif effect == 4:
            level += size * abs(torque) / ratio
        elif effect == 5:
            wet += size * wm / top * (np.exp(-0.04 * heat) - 1.0)
        elif effect == 6:
            level += size * first * np.exp(-time / second)
            wet += size * np.exp(-time / second) * wm / top
        # implicit in the bristle, whose own time constant is shorter than the step
        rate = bristle * speed / level
        slope = (z + h * wm) / (1 + h * rate) - z
        z += slope
        friction = bristle * z + wet
        pull = 0.0
        if effect == 11:
            pull = size * np.cos(first * qm + second)
        elif effect == 7:
            pull = size * (ql - first)
        elif effect == 9:
            pull = size * np.tanh(wl / 0.01) * np.exp(-0.5 * ((ql - first) / second) ** 2)
        elif effect == 10:
            move = h * wl
            dahl += (move - abs(move) * dahl) / first
            pull = size * dahl
        extra, weight = 0.0, 0.0
        if effect == 8 and time > first:
            extra, weight = 0.3 * size * ratio, size * ratio
        at_motor = pull if effect == 11 else 0.0
        at_load = (pull if effect != 11 else 0.0) * ratio
        wm += h / jm * (kt * i_q - torque / ratio - friction - at_motor)
        carried = torque - gravity * np.sin(ql + hang) - weight * np.sin(ql + hang) - at_load
        wl += h / (jl + extra) * carried
        qm += h * wm
        ql += h * wl
        heat += h / length * (8.0 * joint - heat)
        if k % every == 0 and k // every < out.shape[0]:
            row = k // every
            out[row, 0], out[row, 1], out[row, 2], out[row, 3] = i_q, i_d, qm, heat
    return out


def draw(rng: np.random.Generator, stroke: str) -> TwoMass:
    """Draw a stiff joint; a bench turns about a vertical axis."""
    ratio = float(rng.choice([50, 80, 100, 120]))
    motor = float(np.exp(rng.uniform(np.log(3e-5), np.log(2e-4))))
    load = motor * ratio**2 * rng.uniform(0.5, 2.0)
    weight = 0.0 if stroke == "torque steps" else rng.uniform(0.1, 0.4) * ratio
    dry = rng.uniform(0.04, 0.12)
    return TwoMass(
        ratio, int(rng.choice([4, 5, 7, 10])), rng.uniform(0.06, 0.2), motor, load,
        rng.uniform(120.0, 200.0), rng.uniform(0.03, 0.08), weight, rng.uniform(-3, 3), dry,
        dry * rng.uniform(0.3, 1.0) / 150.0, rng.uniform(15.0, 40.0),
    )  # fmt: skip


def joint_of(seed: int, stroke: str) -> TwoMass:
    """Joint of a seed, before anything is hidden in it."""
    return draw(np.random.default_rng([seed, STROKES.index(stroke)]), stroke)


def commands(rng: np.random.Generator, stroke: str, joint: TwoMass) -> tuple[list[Floats], float]:
    """Commanded motor angles, or q currents on a bench, of each recording, and the top speed."""
    top = joint.ratio * rng.uniform(0.6, 1.6)
    ramp = rng.uniform(0.15, 0.5)
    if stroke == "one stroke":
        return [trapezoid(0.0, top * rng.uniform(6, 12), top, ramp)], top
    if stroke == "torque steps":
        breaking, slope = joint.dry / joint.torque_constant, joint.viscous / joint.torque_constant
        steps = [np.zeros(int(0.5 * STEP_HZ))]
        for k in range(6):
            level = breaking + slope * 150.0 * rng.uniform(0.4, 1.2)
            side = -1.0 if k % 2 else 1.0
            steps.append(np.full(int(rng.uniform(0.6, 1.2) * STEP_HZ), side * level))
            steps.append(np.zeros(int(rng.uniform(0.6, 1.0) * STEP_HZ)))
        return [np.concatenate(steps)], 150.0
    recordings = []
    stops = joint.ratio * rng.uniform(-1.2, 1.2, 4)
    for run in range(1 if stroke == "cyclic" else 3):
        places, speeds = [0.0, *stops] * 6 + [0.0], [top] * 31
        if stroke == "several programs":
            places = [0.0, *(joint.ratio * rng.uniform(-1.2, 1.2, 7)), 0.0]
            speeds = list(top * rng.uniform(0.25, 1.0, 9) * (1.0, 0.6, 0.3)[run])
        parts = [np.zeros(int(0.3 * STEP_HZ))]
        for here, there, speed in zip(places[:-1], places[1:], speeds, strict=False):
            if abs(there - here) > 1e-3:
                parts += [trapezoid(here, there, speed, ramp), np.full(int(0.2 * STEP_HZ), there)]
        recordings.append(np.concatenate(parts))
    return recordings, top


def trapezoid(here: float, there: float, speed: float, ramp_s: float) -> Floats:
    """Go with a trapezoidal speed whose corners are rounded over a tenth of the ramp."""
    length = abs(there - here)
    speed = min(speed, length / ramp_s / 1.05)
    time_s = length / speed + ramp_s
    t = np.arange(0, time_s, 1 / STEP_HZ)
    v = speed * np.clip(np.minimum(t, time_s - t) / ramp_s, 0, 1)
    width = max(int(0.1 * ramp_s * STEP_HZ), 1)
    v = np.convolve(np.pad(v, width), np.ones(width) / width, mode="same")
    q = np.cumsum(v)
    moved: Floats = here + (there - here) * q / q[-1]
    return moved


def shape_of(rng: np.random.Generator, effect: str, length_s: float, joint: TwoMass, top: float,
             places: Floats, rate_hz: float) -> tuple[float, float]:  # fmt: skip
    """Draw an effect's parameters."""
    travel, low = float(np.ptp(places)), float(places.min())
    if effect == "stribeck":
        return rng.uniform(0.05, 0.25), 0.0
    if effect == "sublinear_friction":
        return rng.uniform(0.3, 0.6), 0.0
    if effect == "asymmetric_friction":
        return rng.uniform(0.2, 1.0), 0.0
    if effect == "warmup":
        return rng.uniform(0.0, 0.5), length_s * rng.uniform(0.15, 0.5)
    if effect == "spring":
        return low + travel * rng.uniform(0.2, 0.8), 0.0
    if effect == "payload_change":
        return length_s * rng.uniform(0.3, 0.6), 0.0
    if effect == "position_drag":
        return low + travel * rng.uniform(0.2, 0.8), travel * rng.uniform(0.03, 0.08)
    if effect == "hysteresis":
        return travel * rng.uniform(0.03, 0.12), 0.0
    if effect == "ripple":
        tooth = 2 * (joint.ratio + 1) / joint.ratio
        highest = 0.35 * rate_hz * 2 * np.pi / top
        orders = [k for k in (1.0, 2.0, 4.0, tooth, 2.0 * joint.pole_pairs) if k < highest]
        return float(rng.choice(orders or [highest / 2])), rng.uniform(0, 6)
    if effect == "mains_hum":
        return float(rng.choice([60.0] if rate_hz == 100.0 else [50.0, 60.0, 100.0])), 1.0
    return 0.0, 0.0


def run(
    joint: TwoMass, orders: list[Floats], top: float, rate_hz: float, length_s: float, bench: bool
) -> list[Logged]:
    """Integrate the recordings, and log them without noise."""
    stiffness = (2 * np.pi * joint.resonance_hz) ** 2 * joint.load_inertia
    if joint.effect == "elasticity":
        stiffness = (2 * np.pi * joint.magnitude) ** 2 * joint.load_inertia
    loss = 2 * joint.damping * np.sqrt(stiffness * joint.load_inertia)
    constants = np.array([
        joint.ratio, joint.pole_pairs, joint.torque_constant, joint.motor_inertia,
        joint.load_inertia, stiffness, loss, joint.gravity, joint.hang, joint.dry, joint.viscous,
        joint.bandwidth_hz, length_s, top,
    ])  # fmt: skip
    number = TORQUES.index(joint.effect) if joint.effect in TORQUES else -1
    number = 20 if joint.effect == "dead_time" else number
    every, logged, begun = round(STEP_HZ / rate_hz), [], 0.0
    first, second = joint.shape
    for order in orders:
        since = first - begun if joint.effect == "payload_change" else first
        out = _integrate(
            order, bench, constants, number, joint.magnitude, since, second, every
        )  # fmt: skip
        i_q, i_d, angle, heat = out.T
        t = np.arange(i_q.size) / rate_hz
        if joint.effect == "time_delay":
            i_q = np.interp(t - joint.magnitude, t, i_q)
        if joint.effect == "offset":
            i_q = i_q + joint.magnitude
        if joint.effect == "mains_hum":
            i_q = i_q + joint.magnitude * np.cos(2 * np.pi * first * t + second)
        electrical = joint.pole_pairs * angle[:, None] - np.arange(3) * 2 * np.pi / 3
        phases = i_d[:, None] * np.cos(electrical) - i_q[:, None] * np.sin(electrical)
        if joint.effect == "sensor_offset":
            phases[:, 1] += joint.magnitude
        if joint.effect == "sensor_gain":
            phases[:, 2] *= 1 + joint.magnitude
        measured = -2 / 3 * (phases * np.sin(electrical)).sum(axis=1)
        warm = np.round(25.0 + 2 * heat, 1)
        logged.append(Logged(rate_hz, measured, phases, angle / joint.ratio, warm))
        begun += t[-1]
    return logged


def record(
    effect: str, size: float, seed: int, stroke: str, rate_hz: float, *, compliant: bool = False
) -> tuple[TwoMass, list[Logged], float]:
    """Draw a joint, hide an effect, and measure.

    Parameters
    ----------
    effect : str
        Of `EFFECTS` or `ELECTRICAL`; empty for none.
    size : float
        Root mean square, in units of the noise, of what the declared effects cannot take over.
    seed : int
        Joint, motion and noise do not depend on effect and size.
    stroke : str
        Of `STROKES`.
    rate_hz : float
    compliant : bool
        Whether the joint rings at 9 to 20 Hz besides, which nothing declared holds.

    Returns
    -------
    joint : TwoMass
    recordings : list of Logged
    noise_a : float

    Raises
    ------
    ValueError
        If this joint cannot have an effect of that size.
    """
    rng = np.random.default_rng([seed, STROKES.index(stroke)])
    joint = draw(rng, stroke)
    orders, top = commands(rng, stroke, joint)
    if compliant:
        joint = replace(joint, resonance_hz=rng.uniform(9.0, 20.0))
    bench = stroke == "torque steps"
    length_s = sum(order.size for order in orders) / STEP_HZ

    def measure(one: TwoMass) -> list[Logged]:
        return run(one, orders, top, rate_hz, length_s, bench)

    plain = measure(joint)
    # Noise over what the rigid model leaves of a stiff joint, so that this one lacks nothing.
    floor = unexplained(plain, None)
    least = 0.0 if compliant else 1.5 * floor
    noise_a = max(least, rng.uniform(0.02, 0.05) * float(np.std(plain[0].current)))
    recordings = plain
    if effect:
        own = np.random.default_rng([seed, (*TORQUES, *SENSORS, *SEARCHED).index(effect), 1])
        places = np.concatenate([r.position for r in plain])
        joint = replace(
            joint, effect=effect,
            shape=shape_of(own, effect, length_s, joint, top, places, rate_hz),
        )  # fmt: skip
        wanted = size * noise_a
        low, high = SEARCHED.get(effect, (0.0, 0.0))
        middle = 1e-2
        for _ in range(9):
            # Most are nearly in proportion to their magnitude, the others are bisected.
            if effect in SEARCHED:
                middle = np.sqrt(low * high)
            recordings = measure(replace(joint, magnitude=middle))
            if effect in ELECTRICAL:
                got = in_phases(recordings, plain)
            elif bench:  # the current is commanded; what is missing shows in the motion
                got = np.sqrt(max(unexplained(recordings, None) ** 2 - floor**2, 1e-12))
            else:
                got = unexplained(recordings, plain, offset=effect != "offset")
            if abs(np.log(got / wanted)) < 0.1:
                break
            if effect in SEARCHED:
                low, high = (middle, high) if got < wanted else (low, middle)
            else:
                middle *= wanted / got
        joint = replace(joint, magnitude=float(middle))
        if abs(np.log(got / wanted)) > 0.4:
            msg = f"{effect} of {size:g} times the noise cannot be made: {got / noise_a:.2g}"
            raise ValueError(msg)
    noisy, counts = [], rng.choice([2.0**17, 2.0**20, 2.0**23])
    for r in recordings:
        share = rng.uniform(0.0, 0.7)
        noise = np.stack([coloured(rng, r.current.size, share) for _ in range(3)], axis=1)
        step = 2 * np.pi / counts
        noisy.append(
            replace(
                r, current=r.current + noise_a * noise[:, 0],
                phases=r.phases + noise_a * noise, position=np.round(r.position / step) * step,
            )
        )  # fmt: skip
    return joint, noisy, noise_a


def coloured(rng: np.random.Generator, size: int, share: float) -> Floats:
    """White noise, of which a share has been averaged over eight samples; standard deviation 1."""
    white = rng.normal(size=size + 7)
    slow = np.convolve(white, np.ones(8) / np.sqrt(8), mode="valid")
    mixed: Floats = np.sqrt(1 - share) * rng.normal(size=size) + np.sqrt(share) * slow
    return mixed


def unexplained(
    recordings: list[Logged], plain: list[Logged] | None, *, offset: bool = True
) -> float:
    """Root mean square, over the moving samples, that no declared effect takes over.

    Of the current's difference from the plain joint's, where that is given.
    """
    columns, wanted = [], []
    for k, r in enumerate(recordings):
        v = np.gradient(r.position) * r.rate_hz
        a = np.gradient(v) * r.rate_hz
        moving = np.abs(v) > 0.02 * np.abs(v).max()
        one = np.full(v.size, float(offset))
        shapes = [a, np.sin(r.position), np.cos(r.position), one, np.sign(v), v]
        columns.append(np.stack(shapes, axis=1)[moving])
        wanted.append((r.current - (plain[k].current if plain else 0.0))[moving])
    y, design = np.concatenate(wanted), np.concatenate(columns)
    design /= np.linalg.norm(design, axis=0) + 1e-300
    return float(np.sqrt(np.mean((y - design @ np.linalg.lstsq(design, y, rcond=1e-9)[0]) ** 2)))


def in_phases(recordings: list[Logged], plain: list[Logged]) -> float:
    """Root mean square that the phases differ by, as a q current's."""
    pairs = zip(recordings, plain, strict=True)
    differences = np.concatenate([r.phases - base.phases for r, base in pairs])
    return float(np.sqrt(2 * np.mean(differences**2)))
