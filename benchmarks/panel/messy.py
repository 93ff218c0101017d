"""Joints on which everything is a little wrong at once, and nothing exactly of the library.

Friction lies between powers of the speed, depends on the place, on the load and wears in; one to
five ripples vary over the turn and pass a lag; the arm rings, gravity wanders, noise is coloured,
the current is filtered, late and coarse, and so is the encoder. What lacks has no right name, so
only errors on sealed samples count, beside the rivals'.
"""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter

from panel.case import Case, Logged, Wanted

Floats = NDArray[np.float64]
DECLARED = ("inertia", "gravity", "offset", "coulomb", "viscous")
JOINTS = 20
"""Of one seed."""
STROKES = ("cycles", "random places", "fourier", "one slow stroke", "several speeds")
RATES_HZ = (100.0, 125.0, 250.0, 500.0, 1000.0)
AT_REST_S = 0.4


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Each stroke in turn; every second joint with its gear known."""
    for number in range(JOINTS * seed, JOINTS * (seed + 1)):
        rng = np.random.default_rng(number)
        stroke = STROKES[number % len(STROKES)]
        rate_hz = float(rng.choice(RATES_HZ))
        gear = (float(rng.choice([50, 80, 100, 101, 120, 160])), int(rng.choice([4, 5, 7, 10])))
        yield Case(
            "messy",
            f"{stroke} {rate_hz:g} Hz {number}",
            stroke,
            "position",
            DECLARED,
            None,
            partial(record, rng, stroke, rate_hz, gear),
            gear=gear if number % 2 else None,
            seed=number,
        )


def record(rng: Generator, stroke: str, rate_hz: float, gear: tuple[float, int]) -> list[Logged]:
    """Record one joint: its current at twice the rate or more, logged at the rate."""
    finer = round(max(2000.0, 2.0 * rate_hz) / rate_hz)
    fine_hz = rate_hz * finer
    speed, place = trajectory(rng, stroke, fine_hz)
    acceleration = np.gradient(speed) * fine_hz
    current = np.asarray(torque(rng, place, speed, acceleration, gear, fine_hz), float)

    noise_a = 10.0 ** rng.uniform(-2.3, -1.2)
    current += noise_a * disturbance(rng, place.size, fine_hz)
    follows = 1.0 - np.exp(-1.0 / (rng.uniform(0.5e-3, 8e-3) * fine_hz))
    current = lfilter([follows], [1.0, follows - 1.0], current, zi=[current[0] * (1.0 - follows)])[
        0
    ]
    current, place = current[::finer], place[::finer]
    current = rounded(current + noise_a * rng.normal(size=current.size), rng, [1e-4, 1e-3, 5e-3])
    current = np.pad(current, (int(rng.integers(0, 3)), 0), mode="edge")[: place.size]
    place = rounded(place, rng, [1e-9, 1e-6, 2e-5, 1e-4, 3e-4])
    logged = np.gradient(place) * rate_hz if rng.uniform() < 0.25 else None
    return [Logged(rate_hz, current=current, position=place, velocity=logged)]


def rounded(values: Floats, rng: Generator, steps: list[float]) -> Floats:
    """Log with one of these resolutions."""
    step = float(rng.choice(steps))
    return np.round(values / step) * step


def torque(
    rng: Generator,
    place: Floats,
    speed: Floats,
    acceleration: Floats,
    gear: tuple[float, int],
    rate_hz: float,
) -> Floats:
    """Make the current (A) of load, friction, ripples and ringing, before noise; shape (n,)."""
    time_s = np.arange(place.size) / rate_hz
    seconds = rng.normal(size=place.size // int(rate_hz) + 2)
    tilt = 0.03 * rng.uniform() * smoothed(seconds.repeat(int(rate_hz))[: place.size], rate_hz, 3.0)
    inertia = rng.uniform(0.05, 0.4)
    hang = rng.uniform(0.0, 2.0 * np.pi)
    load = inertia * acceleration + rng.uniform(0, 2) * np.sin(place + hang + tilt)

    side = np.tanh(speed / 10.0 ** rng.uniform(-3.0, -1.7))
    sticks = rng.uniform(0, 0.6) * np.exp(-np.abs(speed) / rng.uniform(0.02, 0.3))
    power = np.abs(speed) ** rng.uniform(0.5, 1.3)
    friction = rng.uniform(0.2, 0.8) * side * (1.0 + sticks)
    friction += rng.uniform(0.1, 0.6) * np.sign(speed) * power
    friction += rng.uniform(0, 0.15) * side * np.hypot(load, 0.05)
    uneven = sum(
        rng.normal() / k * np.cos(k * place + rng.uniform(0.0, 2.0 * np.pi)) for k in range(1, 14)
    )
    friction *= 1.0 + rng.uniform(0, 0.08) * uneven
    friction *= 1.0 + rng.uniform(0, 0.2) * np.exp(-time_s / rng.uniform(5.0, 60.0))

    current = load + friction + rng.uniform(-0.1, 0.1)
    current += ripples(rng, place, speed, gear)
    angular = 2.0 * np.pi * rng.uniform(5.0, 25.0)
    numerator, denominator = bilinear(
        [angular**2], [1.0, 2.0 * rng.uniform(0.03, 0.2) * angular, angular**2], rate_hz
    )
    rung = lfilter(numerator, denominator, acceleration) - acceleration
    return current + rng.uniform(0, 0.9) * inertia * rung


def ripples(rng: Generator, place: Floats, speed: Floats, gear: tuple[float, int]) -> Floats:
    """One to five ripples (A), each uneven over the turn and behind a lag of the drive."""
    ratio, poles = gear
    mesh = 2.0 * (ratio + 1.0) / ratio
    orders = [1.0, 2.0, 4.0, mesh, 2.0 * poles, 6.0 * poles, 6.0, 12.0, rng.uniform(3.0, 30.0)]
    scale_a = rng.uniform(0.005, 0.08)
    sum_a = np.zeros(place.size)
    for order in rng.permutation(orders)[: int(rng.integers(1, 6))]:
        passes = np.abs(speed) * ratio * order / (2.0 * np.pi * rng.uniform(20.0, 150.0))
        uneven = np.sin(place * rng.uniform(0.5, 3.0) + rng.uniform(0.0, 2.0 * np.pi))
        phase = order * ratio * place + rng.uniform(0.0, 2.0 * np.pi) - np.arctan(passes)
        sum_a += (
            scale_a * rng.exponential() * (1 + 0.4 * uneven) * np.cos(phase) / np.hypot(1, passes)
        )
    return sum_a


def disturbance(rng: Generator, samples: int, rate_hz: float) -> Floats:
    """Mains hum on half of the joints, coloured noise and a slow walk, in units of the noise."""
    hum = rng.uniform(0, 0.5) * (rng.uniform() < 0.5) * np.cos(
        2.0 * np.pi * rng.choice([50, 60]) * np.arange(samples) / rate_hz
    )  # fmt: skip
    coloured = lfilter([np.sqrt(1.0 - 0.98**2)], [1.0, -0.98], rng.normal(size=samples))
    walk = np.cumsum(rng.normal(size=samples)) / np.sqrt(samples)
    return np.asarray(hum + rng.uniform(0, 0.7) * coloured + 0.3 * walk, float)


def trajectory(rng: Generator, stroke: str, rate_hz: float) -> tuple[Floats, Floats]:
    """Speed (rad/s) and place (rad), at rest at both ends."""
    top = rng.uniform(0.3, 2.0)
    width_s = 0.0
    if stroke == "cycles":
        start, end = np.sort(rng.uniform(-1.8, 1.8, 2))
        places = [start, max(end, start + 0.6)] * int(rng.integers(4, 12))
        speed = moves(places, top, rng.uniform(2.0, 8.0) * top, rng.uniform(0.1, 0.6), rate_hz)
        width_s = rng.choice([0.0, 0.05, 0.15])
    elif stroke == "random places":
        places = list(rng.uniform(-1.8, 1.8, int(rng.integers(8, 30))))
        speed = moves(places, top, 5.0 * top, rng.uniform(0.05, 0.5), rate_hz)
        width_s = rng.uniform(0.1, 0.3)
    elif stroke == "fourier":
        places = [rng.uniform(-1.0, 0.0)]
        speed = harmonics(rng, top, rate_hz)
    elif stroke == "one slow stroke":
        top, length = rng.uniform(0.1, 0.5), rng.uniform(2.0, 5.5)
        places = [-length / 2, length / 2]
        speed = moves(places, top, 3.0 * top, 0.5, rate_hz)
        width_s = 0.1
    else:
        places = [-1.5, 1.5, -1.5]
        speeds = rng.permutation(np.geomspace(0.08, 1.0, int(rng.integers(4, 8)))) * top
        speed = np.concatenate([moves(places, each, 4.0 * top, 0.3, rate_hz) for each in speeds])
        width_s = 0.08
    speed = smoothed(np.pad(speed, int(AT_REST_S * rate_hz)), rate_hz, width_s)
    return speed, places[0] + np.cumsum(speed) / rate_hz


def harmonics(rng: Generator, top: float, rate_hz: float) -> Floats:
    """Five harmonics (rad/s) over one to four periods, from rest to rest."""
    period_s = rng.uniform(8.0, 20.0)
    turns = np.arange(int(rng.integers(1, 5) * period_s * rate_hz)) / rate_hz / period_s
    waves = [
        rng.normal() / np.sqrt(k) * wave(2.0 * np.pi * k * turns)
        for k in range(1, 6)
        for wave in (np.cos, np.sin)
    ]
    speed = np.sum(waves, axis=0)
    begun = np.clip(turns * period_s / 0.6, 0.0, 1.0)
    eased = begun**2 * (3.0 - 2.0 * begun)
    return np.asarray(top * speed / np.abs(speed).max() * eased * eased[::-1], float)


def moves(
    places: list[float], top: float, acceleration: float, rest_s: float, rate_hz: float
) -> Floats:
    """Speed (rad/s) of trapezoidal motions from place to place (rad), with rests between."""
    parts = [np.zeros(0)]
    for start, end in pairwise(places):
        distance = abs(end - start)
        reached = min(top, np.sqrt(distance * acceleration))
        rises_s = reached / acceleration
        lasts_s = max(distance / reached, rises_s) + rises_s
        time_s = (np.arange(max(int(lasts_s * rate_hz), 2)) + 0.5) / rate_hz
        slopes = np.minimum(acceleration * time_s, acceleration * (lasts_s - time_s))
        parts.append(np.sign(end - start) * np.clip(slopes, 0.0, reached))
        parts.append(np.zeros(int(rest_s * rate_hz)))
    return np.concatenate(parts)


def smoothed(values: Floats, rate_hz: float, width_s: float) -> Floats:
    """Convolve with a Hann window of twice this width."""
    half = max(int(width_s * rate_hz) // 2, 1)
    window = np.hanning(2 * half + 3)[1:-1]
    return np.convolve(np.pad(values, half, mode="edge"), window / window.sum(), mode="valid")
