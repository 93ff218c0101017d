"""A joint whose current is a formula: exact motion, an encoder, noise, and one effect hidden.

Unlike the testbed nothing is integrated, unlike the tests' simulator nothing is smoothed: a
trapezoidal speed has true steps of the acceleration. Motion and constants depend on the motion's
kind and the seed, not on the effect.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]
DECLARED = ("inertia", "gravity", "coulomb", "viscous")
RATES_HZ = (100.0, 200.0, 250.0, 500.0, 1000.0, 2000.0)
FINEST_ENCODER_RAD, COARSEST_ENCODER_RAD = 1e-6, 1e-3
PAUSE_S = 0.3


@dataclass(frozen=True)
class Path:
    """Position, speed and acceleration, shape (n,) each, exact at every sample."""

    rate_hz: float
    position: Floats
    velocity: Floats
    acceleration: Floats

    @property
    def time_s(self) -> Floats:
        """Seconds since the start."""
        return np.arange(self.position.size) / self.rate_hz

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Samples faster than a fiftieth of the top speed."""
        speeds = np.abs(self.velocity)
        return speeds > 0.02 * speeds.max()


@dataclass(frozen=True)
class Joint:
    """A joint on its path; `parts` holds the current of each declared effect."""

    path: Path
    gear_ratio: float
    pole_pairs: int
    temperature_c: Floats
    parts: dict[str, Floats]

    @property
    def whole(self) -> Floats:
        """Current of all declared effects."""
        return np.sum(list(self.parts.values()), axis=0)

    @property
    def load(self) -> Floats:
        """Current of inertia and gravity."""
        return self.parts["inertia"] + self.parts["gravity"]


@dataclass(frozen=True)
class Recorded:
    """What was logged, and what is true.

    Attributes
    ----------
    joint : Joint
        Without the encoder's steps.
    current_a, position_rad : arrays of shape (n,)
        As logged.
    temperature_c : array of shape (n,)
        In steps of 0.1 degrees.
    noise_a : float
        Standard deviation of the current's noise.
    encoder_rad : float
        Step of the position, 0 for none.
    """

    joint: Joint
    current_a: Floats
    position_rad: Floats
    temperature_c: Floats
    noise_a: float
    encoder_rad: float


def trapezoidal(distance: float, speed: float, steepest: float, rate_hz: float) -> Path:
    """Move with a trapezoidal speed."""
    length, side = abs(distance), np.sign(distance)
    speed = min(speed, float(np.sqrt(length * steepest)))
    ramp = speed / steepest
    duration = length / speed + ramp
    t = np.arange(0, duration, 1 / rate_hz)
    left = duration - t
    cases = [t < ramp, left < ramp]
    flat = speed * (t - ramp / 2)
    ends = [steepest * t**2 / 2, length - steepest * left**2 / 2]
    position = np.select(cases, ends, flat)
    velocity = np.select(cases, [steepest * t, steepest * left], speed)
    acceleration = np.select(cases, [steepest, -steepest], 0.0)
    return Path(rate_hz, side * position, side * velocity, side * acceleration)


def cubic(distance: float, speed: float, steepest: float, rate_hz: float) -> Path:
    """Move along the cubic that begins and ends at rest; its acceleration steps at both ends."""
    length = abs(distance)
    duration = max(1.5 * length / speed, np.sqrt(6.0 * length / steepest))
    s = np.arange(0, duration, 1 / rate_hz) / duration
    return Path(
        rate_hz,
        distance * (3 * s**2 - 2 * s**3),
        distance / duration * (6 * s - 6 * s**2),
        distance / duration**2 * (6 - 12 * s),
    )


def quintic(distance: float, speed: float, steepest: float, rate_hz: float) -> Path:
    """Move along the quintic that begins and ends at rest without acceleration."""
    length = abs(distance)
    duration = max(1.875 * length / speed, np.sqrt(5.78 * length / steepest))
    s = np.arange(0, duration, 1 / rate_hz) / duration
    return Path(
        rate_hz,
        distance * (10 * s**3 - 15 * s**4 + 6 * s**5),
        distance / duration * (30 * s**2 - 60 * s**3 + 30 * s**4),
        distance / duration**2 * (60 * s - 180 * s**2 + 120 * s**3),
    )


Move = Callable[[float, float, float, float], Path]


def stops(rng: np.random.Generator, rate_hz: float, move: Move, *, repeat: bool) -> Path:
    """Move from stop to stop: a cycle of two to four stops again and again, or all at random."""
    speed = rng.uniform(0.5, 2.5)
    steepest = speed * rng.uniform(1.5, 6.0)
    start = rng.uniform(-1.0, 1.0)
    if repeat:
        count = int(rng.integers(2, 5))
        sides = np.where(np.arange(count) % 2, -1, 1)
        cycle = [0.0, *(sides * rng.uniform(0.4, 1.6, count))]
        places = np.array([*cycle * int(rng.integers(6, 12)), 0.0])
    else:
        places = np.array([0.0, *rng.uniform(-1.5, 1.5, 40)])
    places = start + places[np.concatenate([[True], np.diff(places) != 0])]
    parts: list[tuple[Floats, Floats, Floats]] = []
    for here, there in pairwise(places):
        path = move(there - here, speed, steepest, rate_hz)
        parts.append((here + path.position, path.velocity, path.acceleration))
        rest = int(PAUSE_S * rate_hz * (1.0 if repeat else rng.uniform(0.5, 1.5)))
        parts.append((np.full(rest, there), np.zeros(rest), np.zeros(rest)))
    return Path(rate_hz, *(np.concatenate(channel) for channel in zip(*parts, strict=True)))


def fourier(rng: np.random.Generator, rate_hz: float) -> Path:
    """Move along five harmonics of one period, four to six times."""
    period = rng.uniform(8.0, 20.0)
    t = np.arange(0, period * int(rng.integers(4, 7)), 1 / rate_hz)
    position, velocity, acceleration = (np.zeros(t.size) for _ in range(3))
    for k in range(1, 6):
        w = 2 * np.pi * k / period
        sine, cosine = rng.normal(size=2) / k
        position += (sine * np.sin(w * t) - cosine * np.cos(w * t)) / w
        velocity += sine * np.cos(w * t) + cosine * np.sin(w * t)
        acceleration += w * (cosine * np.cos(w * t) - sine * np.sin(w * t))
    scale = rng.uniform(0.5, 2.5) / np.abs(velocity).max()
    return Path(rate_hz, scale * position, scale * velocity, scale * acceleration)


MOTIONS: dict[str, Callable[[np.random.Generator, float], Path]] = {
    "trapezoidal": lambda rng, rate: stops(rng, rate, trapezoidal, repeat=True),
    "cubic": lambda rng, rate: stops(rng, rate, cubic, repeat=True),
    "quintic": lambda rng, rate: stops(rng, rate, quintic, repeat=True),
    "fourier": fourier,
    "random": lambda rng, rate: stops(
        rng, rate, trapezoidal if rng.random() < 0.5 else quintic, repeat=False
    ),
}


def draw_joint(rng: np.random.Generator, path: Path) -> Joint:
    """Draw constants such that every declared effect takes some tenths to some amperes."""
    t = path.time_s
    warming = rng.uniform(5, 15) * (1 - np.exp(-t / (t[-1] * rng.uniform(0.3, 0.8))))
    swaying = 0.5 * np.sin(2 * np.pi * t / t[-1] * rng.uniform(1, 2.5))
    parts = {
        "inertia": rng.uniform(0.4, 2.4) * path.acceleration / np.abs(path.acceleration).max(),
        "gravity": rng.uniform(0.5, 4.0) * np.sin(path.position + rng.uniform(-3, 3)),
        "coulomb": rng.uniform(0.3, 1.0) * np.sign(path.velocity),
        "viscous": rng.uniform(0.2, 0.8) * path.velocity / np.abs(path.velocity).max(),
    }
    gear_ratio = float(rng.choice([50, 80, 100, 101, 120, 160]))
    pole_pairs = int(rng.choice([4, 5, 7, 10, 12]))
    return Joint(path, gear_ratio, pole_pairs, 25 + warming + swaying, parts)


Shape = Callable[[Joint, np.random.Generator, float], Floats]
EFFECTS: dict[str, Shape] = {}
"""Current of each effect, in any size; of a delay the strength is its length in samples."""


def hidden(shape: Shape) -> Shape:
    """Enter an effect by its function's name."""
    EFFECTS[shape.__name__] = shape
    return shape


def _shares(path: Path) -> tuple[Floats, Floats, float]:
    """Speed as a share of the top speed, direction, travel."""
    speed = path.velocity / np.abs(path.velocity).max()
    return speed, np.sign(path.velocity), float(np.ptp(path.position))


@hidden
def stribeck(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    speed, sign, _ = _shares(joint.path)
    return sign * np.exp(-((np.abs(speed) / rng.uniform(0.05, 0.25)) ** rng.choice([1, 2])))


@hidden
def quadratic_friction(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    speed, _, _ = _shares(joint.path)
    return speed * np.abs(speed)


@hidden
def sublinear_friction(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    speed, sign, _ = _shares(joint.path)
    return sign * np.abs(speed) ** rng.uniform(0.3, 0.6)


@hidden
def asymmetric_friction(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    speed, _, _ = _shares(joint.path)
    return np.where(speed > 0, 1 + 2 * speed, 0.0)


@hidden
def load_friction(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    return np.sign(joint.path.velocity) * np.abs(joint.load)


@hidden
def thermal_viscous(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    return joint.path.velocity * np.exp(-0.03 * (joint.temperature_c - 25))


@hidden
def warmup(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    t = joint.path.time_s
    fading = np.exp(-t / (t[-1] * rng.uniform(0.15, 0.4)))
    return (joint.parts["coulomb"] + joint.parts["viscous"]) * fading


@hidden
def offset(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    return np.ones(joint.path.position.size)


@hidden
def spring(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    return joint.path.position - rng.uniform(-0.5, 0.5)


@hidden
def payload_change(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    t = joint.path.time_s
    return np.where(t > t[-1] * rng.uniform(0.25, 0.7), joint.load, 0.0)


@hidden
def position_drag(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    _, sign, travel = _shares(joint.path)
    place = joint.path.position.min() + travel * rng.uniform(0.15, 0.85)
    width = travel * rng.uniform(0.02, 0.08)
    return sign * np.exp(-0.5 * ((joint.path.position - place) / width) ** 2)


@hidden
def hysteresis(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    _, _, travel = _shares(joint.path)
    length = travel * rng.uniform(0.03, 0.15)
    built = np.zeros(joint.path.position.size)
    state = 0.0
    for k, step in enumerate(np.diff(joint.path.position), 1):
        if step:
            side = np.sign(step)
            state = side + (state - side) * np.exp(-abs(step) / length)
        built[k] = state
    return built


@hidden
def elasticity(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    rate = joint.path.rate_hz
    w = 2 * np.pi * rng.uniform(4.0, min(20.0, rate / 8))
    loss = 2 * rng.uniform(0.02, 0.1) * w
    finer = max(1, int(np.ceil(2000 / rate)))
    h = 1 / rate / finer
    load = np.zeros(joint.path.position.size)
    place, pace = float(joint.path.acceleration[0]), 0.0
    for k, asked in enumerate(joint.path.acceleration):
        for _ in range(finer):
            pace += h * (w * w * (asked - place) - loss * pace)
            place += h * pace
        load[k] = place
    return load - joint.path.acceleration


@hidden
def time_delay(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    samples, whole = round(strength), joint.whole
    return np.concatenate([np.full(samples, whole[0]), whole[:-samples]]) - whole


@hidden
def ripple(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    speed, _, _ = _shares(joint.path)
    fastest = joint.gear_ratio * np.abs(joint.path.velocity).max() / 2 / np.pi
    passage = 2 * (joint.gear_ratio + 1) / joint.gear_ratio
    order = float(rng.choice([1, 2, 4, joint.pole_pairs, passage, 3.37]))
    while order * fastest > 0.35 * joint.path.rate_hz:
        order /= 2
    size = 1 - rng.uniform(0, 1) * np.abs(speed)
    return size * np.sin(order * joint.gear_ratio * joint.path.position + 1.0)


@hidden
def mains_hum(joint: Joint, rng: np.random.Generator, strength: float) -> Floats:
    rate = joint.path.rate_hz
    lines = [f for f in (50.0, 60.0, 100.0, 120.0, 150.0) if 2.5 * f < rate] or [60.0]
    return np.sin(2 * np.pi * rng.choice(lines) * joint.path.time_s + 0.3)


def coloured_noise(rng: np.random.Generator, size: int) -> Floats:
    """White noise, noise of first order, or 1/f noise on a white floor; standard deviation 1."""
    white = rng.normal(size=size)
    kind = rng.integers(3)
    if kind == 1:
        white = lfilter([1.0], [1.0, -0.8], white)
    elif kind == 2:
        spectrum = np.fft.rfft(white)
        spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
        slow = np.fft.irfft(spectrum, size)
        white = slow / slow.std() + 0.5 * rng.normal(size=size)
    return white / white.std()


def record(motion: str, effect: str | None, strength: float, seed: int) -> Recorded:
    """Draw a joint, hide an effect, and measure.

    Parameters
    ----------
    motion : str
        Key of `MOTIONS`.
    effect : str or None
        Key of `EFFECTS`; None for a joint that lacks nothing.
    strength : float
        Root mean square, in units of the noise, of what no declared effect can take over; of a
        delay within a factor of three.
    seed : int
        Joint, path and noise do not depend on effect and strength.

    Returns
    -------
    Recorded

    Raises
    ------
    ValueError
        If no delay up to 0.1 s is of that size, or a sprung load would outweigh the whole joint.
    """
    rng = np.random.default_rng([seed, list(MOTIONS).index(motion)])
    path = MOTIONS[motion](rng, float(rng.choice(RATES_HZ)))
    joint = draw_joint(rng, path)
    noise_a = rng.uniform(0.02, 0.06)
    noise = noise_a * coloured_noise(rng, path.position.size)
    bounds = np.log([FINEST_ENCODER_RAD, COARSEST_ENCODER_RAD])
    encoder_rad = 0.0 if rng.random() < 0.15 else float(np.exp(rng.uniform(*bounds)))
    current = joint.whole + noise
    if effect is not None:
        own = np.random.default_rng([seed, list(EFFECTS).index(effect), 1])
        current += scaled(effect, joint, own, strength, noise_a)
    position = path.position
    if encoder_rad:
        position = np.round(position / encoder_rad) * encoder_rad
    temperature = np.round(joint.temperature_c, 1)
    return Recorded(joint, current, position, temperature, noise_a, encoder_rad)


def scaled(
    effect: str, joint: Joint, rng: np.random.Generator, strength: float, noise_a: float
) -> Floats:
    """Return an effect's current, as large as asked for."""
    wanted, path = strength * noise_a, joint.path
    if effect == "time_delay":
        lengths = np.unique(np.geomspace(1, max(0.1 * path.rate_hz, 2), 30).round())
        shapes = [EFFECTS[effect](joint, rng, length) for length in lengths]
        sizes = [max(rest(shape, path), 1e-12) / wanted for shape in shapes]
        nearest = int(np.argmin(np.abs(np.log(sizes))))
        if not 1 / 3 < sizes[nearest] < 3:
            msg = f"no delay leaves {strength:g} times the noise: {strength * sizes[nearest]:.2g}"
            raise ValueError(msg)
        return shapes[nearest]
    shape = EFFECTS[effect](joint, rng, strength)
    scale = wanted / rest(shape, path)
    inertia = np.abs(joint.parts["inertia"]).max() / np.abs(path.acceleration).max()
    if effect == "elasticity" and scale > inertia:
        msg = (
            f"of {strength:g} times the noise the load has {scale / inertia:.2g} times the inertia"
        )
        raise ValueError(msg)
    return np.asarray(scale * shape)


def rest(shape: Floats, path: Path) -> float:
    """Root mean square, over the moving samples, of what the declared effects cannot take over."""
    declared = (
        path.acceleration,
        np.sin(path.position),
        np.cos(path.position),
        np.sign(path.velocity),
        path.velocity,
    )
    design = np.stack(declared, axis=1)[path.moving]
    wanted = shape[path.moving]
    left = wanted - design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
    return float(np.sqrt(np.mean(left**2)))
