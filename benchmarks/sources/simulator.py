"""A joint in a few lines of numpy: other trajectories, robots and noises for every seed.

It shares no code with the package, so that what it calls an effect is written twice.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

DECLARED = ("inertia", "gravity", "coulomb", "viscous")
EFFECTS = (
    "stribeck",
    "ripple",
    "offset",
    "quadratic_friction",
    "sublinear_friction",
    "asymmetric_friction",
    "load_friction",
    "thermal_viscous",
    "warmup",
    "spring",
    "payload_change",
    "position_drag",
    "hysteresis",
    "elasticity",
    "time_delay",
    "mains_hum",
    "coulomb",
    "viscous",
    "gravity",
    "inertia",
)


ELECTRICAL = ("sensor_offset", "sensor_gain", "dead_time")


@dataclass(frozen=True)
class Simulated:
    rate_hz: float
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    temperature: np.ndarray
    current: np.ndarray
    effect: np.ndarray
    noise_rms: float
    gear_ratio: float
    pole_pairs: int
    truth: dict[str, float]
    columns: np.ndarray
    phases: np.ndarray


def trapezoid(distance, speed, acceleration, rate):
    distance, side = abs(distance), np.sign(distance)
    if speed**2 / acceleration > distance:
        speed = np.sqrt(distance * acceleration)
    ramp = speed / acceleration
    flat = distance / speed - ramp
    t = np.arange(int((2 * ramp + flat) * rate)) / rate
    a = np.where(t < ramp, acceleration, np.where(t < ramp + flat, 0.0, -acceleration))
    v = np.cumsum(a) / rate
    return side * np.cumsum(v) / rate


def quintic(distance, speed, _acceleration, rate):
    duration = 1.875 * abs(distance) / speed
    s = np.linspace(0, 1, max(int(duration * rate), 8))
    return distance * (10 * s**3 - 15 * s**4 + 6 * s**5)


def trajectory(rng, rate, kind, cycles, size):
    if kind == "sines":
        period = rng.uniform(5, 9)
        t = np.arange(int(period * cycles * rate)) / rate
        q = np.zeros(t.size)
        for k in range(1, 5):
            q += rng.normal() / k * np.sin(2 * np.pi * k * t / period + rng.uniform(0, 6))
        return q * size / np.ptp(q)
    move = trapezoid if kind == "trapezoid" else quintic
    stops = [0.0, *(rng.uniform(-0.5, 0.5, rng.integers(2, 5)) * size), size / 2, 0.0]
    parts = []
    for a, b in pairwise(stops):
        if abs(b - a) < 0.1 * size:
            b = a + 0.1 * size * np.sign(b - a + 1e-9)
        speed = rng.uniform(0.25, 1.2) * size
        step = move(b - (parts[-1][-1] if parts else 0.0), speed, 6 * speed, rate)
        start = parts[-1][-1] if parts else 0.0
        parts.append(start + step)
        parts.append(np.full(int(rng.uniform(0.05, 0.4) * rate), parts[-1][-1]))
    back = parts[-1][-1]
    parts.append(back + move(-back, 0.5 * size, 3 * size, rate))
    cycle = np.concatenate(parts)
    cycle = np.concatenate([cycle - cycle[-1] * np.linspace(0, 1, cycle.size)])
    return np.tile(cycle, cycles)


def coloured_noise(rng, n, rate):
    corner = np.exp(rng.uniform(np.log(0.3), np.log(40.0)))
    pole = np.exp(-2 * np.pi * corner / rate)
    slow = lfilter([1], [1, -pole], rng.normal(size=n + 2000))[2000:]
    white = rng.normal(size=n)
    share = rng.uniform(0, 1)
    return np.sqrt(share) * slow / slow.std() + np.sqrt(1 - share) * white / white.std()


def simulate(
    seed,
    effects=(),
    ratio=0.6,
    rate=None,
    kind=None,
    cycles=None,
    declared=DECLARED,
    quantum=None,
    phase_errors=False,
    current_filter_hz=None,
    current_quantum=None,
):
    rng = np.random.default_rng(seed)
    rate = rate or float(rng.choice([100.0, 250.0, 500.0, 1000.0, 2048.0]))
    kind = kind or rng.choice(["trapezoid", "quintic", "sines"])
    if "elasticity" in effects:
        # Sines that begin in full motion ring once, at the start, and never again.
        kind = "trapezoid"
    cycles = cycles or int(rng.integers(4, 9))
    size = rng.uniform(0.8, 3.0)
    gear_ratio = float(rng.choice([50, 80, 100, 101, 120, 160]))
    pole_pairs = int(rng.choice([4, 5, 7, 8, 10]))
    q = trajectory(rng, rate, kind, cycles, size) + rng.uniform(-1, 1)
    smooth = max(int(0.02 * rate), 1)
    window = np.hanning(smooth + 2)[1:-1]
    padded = np.pad(q, smooth, mode="edge")
    q = np.convolve(padded, window / window.sum(), mode="same")[smooth:-smooth]
    q = q[2 * smooth : -2 * smooth]
    v = np.gradient(q, 1 / rate)
    a = np.gradient(v, 1 / rate)
    n = q.size
    t = np.arange(n) / rate
    top = np.quantile(np.abs(v), 0.95)
    sign = np.sign(v)
    temperature = 25 + rng.uniform(4, 15) * (1 - np.exp(-t / (t[-1] * rng.uniform(0.3, 1.0))))
    temperature += 0.3 * np.sin(2 * np.pi * t / t[-1] * rng.uniform(0.5, 2))
    hang = rng.uniform(-3, 3)
    inertia = rng.uniform(0.3, 1.0) / a.std()
    weight = rng.uniform(0.3, 2.0)
    dry = rng.uniform(0.3, 1.0)
    wet = rng.uniform(0.2, 1.0) / top
    parts = {
        "inertia": inertia * a,
        "gravity": weight * np.sin(q + hang),
        "coulomb": dry * sign,
        "viscous": wet * v,
    }
    load = parts["inertia"] + parts["gravity"]
    base = sum(parts[name] for name in declared if name in parts)
    moving = np.abs(v) > 0.02 * top
    columns = np.stack([a, np.sin(q), np.cos(q), sign, v], axis=1)
    keep = [
        i
        for i, name in enumerate(("inertia", "gravity", "gravity", "coulomb", "viscous"))
        if name in declared
    ]
    columns = columns[:, keep]
    noise = coloured_noise(rng, n, rate)
    noise_rms = float(rng.uniform(0.02, 0.1) * np.std(base))
    noise *= noise_rms
    truth: dict[str, float] = {}
    total = np.zeros(n)
    field = pole_pairs * gear_ratio * q + rng.uniform(0, 6)
    for name in effects:
        if phase_errors and name in ELECTRICAL:
            continue

        def left(shape):
            rest = shape[moving]
            fitted = np.linalg.lstsq(columns[moving], rest, rcond=None)[0]
            return max(np.std(rest - columns[moving] @ fitted), 1e-12)

        wanted = ratio * noise_rms
        if name == "time_delay":
            # A delay is not scaled: its length is chosen so that it leaves the wanted residual.
            side = rng.choice([-1.0, 1.0])
            delays = side * np.geomspace(0.0005, 0.08, 30)
            shapes = [np.interp(t - delay, t, base) - base for delay in delays]
            nearest = int(np.argmin([abs(np.log(left(shape) / wanted)) for shape in shapes]))
            truth["delay_s"] = float(delays[nearest])
            total += shapes[nearest]
            continue
        shape = effect_shape(
            name,
            rng,
            truth,
            t,
            q,
            v,
            a,
            sign,
            top,
            load,
            base,
            temperature,
            gear_ratio,
            pole_pairs,
            rate,
            parts,
        )
        total += shape * wanted / left(shape)
    current = base + total + noise
    if current_filter_hz is not None:
        pole = np.exp(-2 * np.pi * current_filter_hz / rate)
        current = lfilter([1 - pole], [1, -pole], current)
    if current_quantum is not None:
        current = np.round(current / current_quantum) * current_quantum
    phases = np.stack([current * np.cos(field - k * 2 * np.pi / 3) for k in range(3)], axis=1)
    phases += 0.5 * noise_rms * rng.normal(size=phases.shape)
    errors = dict.fromkeys(effects) if phase_errors else {}
    if "sensor_offset" in errors:
        phases[:, 1] += 1.5 * ratio * noise_rms * np.sqrt(2)
    if "sensor_gain" in errors:
        phases[:, 2] *= 1 + 3 * ratio * noise_rms * np.sqrt(2) / np.sqrt(np.mean(current**2))
    if "dead_time" in errors:
        phases -= 8 * ratio * noise_rms * np.sign(phases)
    # At rest the brake holds: friction has no direction there.
    logged = q if quantum is None else np.round(q / quantum) * quantum
    return Simulated(
        rate,
        t,
        logged,
        v,
        a,
        temperature,
        current,
        total,
        noise_rms,
        gear_ratio,
        pole_pairs,
        truth,
        columns,
        phases,
    )


def effect_shape(
    name,
    rng,
    truth,
    t,
    q,
    v,
    a,
    sign,
    top,
    load,
    base,
    temperature,
    gear_ratio,
    pole_pairs,
    rate,
    parts,
):
    span = np.ptp(q)
    speed = np.abs(v)
    if name in parts:
        return parts[name]
    if name == "offset":
        return np.full(t.size, rng.choice([-1.0, 1.0]))
    if name == "stribeck":
        truth["stribeck_speed"] = rng.uniform(0.05, 0.3) * top
        return sign * np.exp(-((speed / truth["stribeck_speed"]) ** 2))
    if name == "quadratic_friction":
        return v * speed
    if name == "sublinear_friction":
        return sign * speed ** rng.uniform(0.3, 0.7)
    if name == "asymmetric_friction":
        return np.where(v > 0, 1.0, 0.0) * (rng.uniform(0.0, 0.5) * sign + v / top)
    if name == "load_friction":
        return np.abs(load) * sign
    if name == "thermal_viscous":
        return v * np.exp(-0.03 * (temperature - 25))
    if name == "warmup":
        truth["time_constant_s"] = rng.uniform(0.2, 0.6) * t[-1]
        return (rng.uniform(0.0, 0.5) * sign + v / top) * np.exp(-t / truth["time_constant_s"])
    if name == "spring":
        return q - rng.uniform(q.min(), q.max())
    if name == "payload_change":
        return (t > rng.uniform(0.2, 0.5) * t[-1]) * (0.3 * a / a.std() + np.sin(q + 0.5))
    if name == "position_drag":
        truth["place_rad"] = rng.uniform(q.min() + 0.25 * span, q.max() - 0.25 * span)
        return sign * np.exp(
            -0.5 * ((q - truth["place_rad"]) / (span * rng.uniform(0.03, 0.1))) ** 2
        )
    if name == "hysteresis":
        length = span * rng.uniform(0.03, 0.2)
        state = np.zeros(t.size)
        for i in range(1, t.size):
            dq = q[i] - q[i - 1]
            state[i] = state[i - 1] + (np.sign(dq) - state[i - 1]) * (1 - np.exp(-abs(dq) / length))
        return state
    if name == "elasticity":
        w = 2 * np.pi * rng.uniform(5, min(20, rate / 8))
        x, u = -a[0] / w**2, v[0]
        out = np.zeros(t.size)
        for i in range(t.size):
            for _ in range(4):
                u += (w * w * (q[i] - q[0] - x) - 0.1 * w * u) / rate / 4
                x += u / rate / 4
            out[i] = w * w * (q[i] - q[0] - x) - a[i]
        return out
    if name == "ripple":
        limit = 0.35 * rate * 2 * np.pi / (top * gear_ratio)
        orders = [k for k in (1.0, 2.0, 4.0, 2 * (gear_ratio + 1) / gear_ratio, 3.0) if k < limit]
        truth["order"] = float(rng.choice(orders)) if orders else 1.0
        angle = truth["order"] * gear_ratio * q
        size = 1 + rng.uniform(0, 0.5) * sign + rng.uniform(-0.5, 0.5) * speed / top
        return size * np.cos(angle + rng.uniform(0, 6) + 0.5 * sign)
    if name == "mains_hum":
        # At 100 samples a second 50 Hz stands still: no recording can show it.
        mains = [60.0] if rate == 100.0 else [50.0, 60.0]
        truth["frequency_hz"] = float(rng.choice(mains)) * rng.uniform(0.999, 1.001)
        return np.cos(2 * np.pi * truth["frequency_hz"] * t + rng.uniform(0, 6))
    if name == "sensor_offset":
        return np.cos(pole_pairs * gear_ratio * q + rng.uniform(0, 6))
    if name == "sensor_gain":
        return base * np.cos(2 * pole_pairs * gear_ratio * q + rng.uniform(0, 6))
    if name == "dead_time":
        return np.sign(base) * np.cos(6 * pole_pairs * gear_ratio * q)
    raise ValueError(name)
