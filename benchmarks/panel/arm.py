"""The shoulder of an arm whose elbow moves beside it, or a wheel that asks nothing of it.

Two rods on parallel axes (Spong, Hutchinson, Vidyasagar, 2006, section 7.3). What the elbow asks of
the shoulder's current has the size that was asked for; of a balanced wheel in its place the
shoulder's current holds nothing. Cyclic motions of both, and programs that never repeat.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from panel.case import Case, Logged, Wanted

Floats = NDArray[np.float64]
DECLARED = ("inertia", "gravity", "offset", "coulomb", "viscous")
STROKES = ("cyclic", "program")
RATES_HZ = (100.0, 250.0, 500.0)
NOISE_A = 0.02


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Every size and stroke with an elbow, as many with a wheel."""
    for k, size in enumerate(wanted.sizes):
        for stroke in STROKES:
            for hidden in ("coupling", ""):
                number = 100 * seed + 10 * k + 2 * STROKES.index(stroke) + (not hidden)
                rate_hz = RATES_HZ[number // 2 % len(RATES_HZ)]
                yield Case(
                    "arm",
                    f"{hidden or 'none'} {stroke} {rate_hz:g} Hz {number}",
                    stroke,
                    "position",
                    DECLARED,
                    hidden,
                    partial(record, number, stroke, rate_hz, size if hidden else 0.0),
                    size=size if hidden else None,
                    seed=number,
                )


def record(number: int, stroke: str, rate_hz: float, size: float) -> list[Logged]:
    """Record the shoulder; `size` is what the elbow asks, over the noise, less what it may hide."""
    rng = np.random.default_rng(number)
    period_s = rng.uniform(4.0, 6.0)
    first, second = (path(rng, stroke, rate_hz, period_s) for _ in range(2))
    (q, v, a), (q2, v2, a2) = first, second
    inertia, reach = rng.uniform(0.05, 0.3), rng.uniform(0.3, 1.0)
    asked = (
        (rng.uniform(0.2, 0.5) + reach * np.cos(q2)) * a2
        + 2 * reach * np.cos(q2) * a
        - reach * np.sin(q2) * (2 * v * v2 + v2**2)
        + rng.uniform(0.0, 10.0) * np.cos(q + q2)
    )
    current = inertia * a + rng.uniform(0, 2) * np.sin(q + rng.uniform(0, 6))
    current += rng.uniform(-0.1, 0.1)
    current += rng.uniform(0.1, 0.5) * np.sign(v) + rng.uniform(0.0, 0.4) * v
    rigid = np.stack([a, np.sin(q), np.cos(q), np.ones(q.size), np.sign(v), v], axis=1)
    moving = np.abs(v) > 0.02 * np.abs(v).max()
    left = (asked - rigid @ np.linalg.lstsq(rigid[moving], asked[moving], rcond=None)[0])[moving]
    current += size * NOISE_A * asked / float(np.sqrt(np.mean(left**2)))
    current += NOISE_A * rng.normal(size=q.size)
    step = float(rng.choice([1e-6, 1e-5, 1e-4]))
    place, beside = (np.round(one / step) * step for one in (q, q2))
    return [Logged(rate_hz, current=current, position=place, others={2: beside})]


def path(
    rng: Generator, stroke: str, rate_hz: float, period_s: float
) -> tuple[Floats, Floats, Floats]:
    """Position, speed and acceleration of waves: of one period six times over, or of many."""
    time_s = np.arange(int(6 * period_s * rate_hz)) / rate_hz
    every = np.arange(1.0, 5.0) if stroke == "cyclic" else rng.uniform(0.3, 4.0, 8)
    q, v, a = (np.zeros(time_s.size) for _ in range(3))
    for times in every:
        w, phase = 2 * np.pi * times / period_s, rng.uniform(0, 2 * np.pi)
        size = rng.uniform(0.1, 0.6) / times
        q += size * np.sin(w * time_s + phase)
        v += size * w * np.cos(w * time_s + phase)
        a -= size * w**2 * np.sin(w * time_s + phase)
    return q, v, a
