r"""Measured joints with a known effect added to the logged current, by formulas of this file alone.

Motion, noise and all that a real joint does that no library holds are measured; only the effect is
made. The motion is what a stiff drive held, so the current that the same motion needs with one more
torque is the logged one and that torque, taken from the motion on the motor's side. Effects that
would have changed the motion (stick-slip, a drive at its limit) are not among them.

Sizes are in units of what the loop leaves of the sealed data without a graft, and of what the
declared effects cannot take up of the graft. Both this and the names that the loop gives without a
graft stand in `ungrafted.json`, made by

    python benchmarks/panel.py --source grafted --effects none --contestants loop \
        --keep benchmarks/panel/ungrafted.json

Where the grafted kind is among those names, nobody asks for it, and only errors count. Seeds below
`HELD_OUT` graft odd joints and states, those above even ones: what is learnt on the one half is
tried on joints, and with parameters, of the other.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.random import Generator

from panel.case import Case, Floats, Logged, Wanted
from panel.measured import ACTUATOR, DECLARED, FIVE, FOLDER, PROGRAMS, read, read_actuator

HELD_OUT = 100
UNGRAFTED = Path(__file__).parent / "ungrafted.json"
LEAST_LEFT = 0.15
"""Of a graft that the declared effects take up but for less nobody can tell the kind."""
MOST_MOVED = 0.25
"""Share of a graft that may change with how the motion is smoothed: the true motion is not known,
and the speed of a ball screw logged at 25 Hz is half noise."""
ANY = ("ripple", "position_drag", "time_delay")
ARM = (*ANY, "mains_hum", "load_friction")
EFFECTS = {
    "stroke": ARM,
    "programs": (*ARM, "stribeck", "payload_change"),
    "ball screw": (*ANY, "spring", "asymmetric_friction", "hysteresis", "warmup"),
}
"""What each kind of recording can show: one stroke, a program run twice, strokes to and fro. Of a
measured joint neither the acceleration is known, which elasticity answers to, nor, at next to one
speed, what other powers of the speed would be; gravity takes up a spring on the arm."""


def joints(kind: str) -> list[Case]:
    """All recordings of a kind without a graft, in order."""
    if kind == "ball screw":
        states = sorted(path.name for path in ACTUATOR.iterdir() if path.is_dir())
        makes = {state: partial(read_actuator, state, FIVE) for state in states}
        declared = tuple(name for name in DECLARED if name != "gravity")
    else:
        last, declared = (7, DECLARED) if kind == "stroke" else (8, DECLARED)
        makes = {
            f"joint {joint}": partial(
                read, (f"joint_{joint}_trapez",) if kind == "stroke" else PROGRAMS, joint
            )
            for joint in range(1, last)
        }
    return [
        Case("grafted", f"{kind}, {name}", kind, "position", declared, None, make)
        for name, make in makes.items()
    ]


def cases(seed: int, wanted: Wanted) -> Iterator[Case]:
    """Each effect once on each kind of recording, or all recordings without any."""
    if not (FOLDER.is_dir() and ACTUATOR.is_dir()):
        print(f"grafted joints left out: {FOLDER} or {ACTUATOR} is not there")
        return
    for kind, effects in EFFECTS.items():
        if wanted.effects == ("none",):
            yield from joints(kind)
            continue
        half = joints(kind)[seed >= HELD_OUT :: 2]
        for k, effect in enumerate(effects):
            joint = half[(k + seed) % len(half)]
            size = wanted.turn(k + seed)
            rest_a, present = ungrafted()[joint.name]
            number = crc32(f"{joint.name} {effect} {seed}".encode())
            yield replace(
                joint,
                name=f"{effect} on {joint.name} {seed}",
                hidden=None if effect in present else effect,
                present=present,
                size=size,
                seed=number,
                make=partial(grafted, joint, effect, size * rest_a, number),
            )


@cache
def ungrafted() -> dict[str, tuple[float, tuple[str, ...]]]:
    """Give what the loop leaves of each recording (A), and the names it has there, with ties."""
    found = {}
    for row in json.loads(UNGRAFTED.read_text(encoding="utf-8"))["rows"]:
        loop = row["results"]["loop"]
        names = {name for step in loop["added"] for name in (step["name"], *step["ties"])}
        # All joints of a program move at once, and ask something of each other.
        names |= {"coupling"} if row["stroke"] == "programs" else set()
        found[row["name"]] = (loop["after"], tuple(sorted(names)))
    return found


def grafted(joint: Case, effect: str, wanted_a: float, seed: int) -> list[Logged]:
    """Record with the effect, of which the declared ones cannot take up `wanted_a` rms.

    Raises
    ------
    ValueError
        Where the declared effects would take up nearly all of it, or no delay has the size.
    """
    recordings = joint.make()
    motions = [Motion.of(one) for one in recordings]
    moving = np.concatenate([m.moving for m in motions])
    rigid = np.concatenate([m.rigid("gravity" in joint.declared) for m in motions])

    def left_a(extra: list[Floats]) -> tuple[float, float]:
        """Give the rms that the declared effects leave of a graft, and its own beside its mean."""
        both = np.concatenate(extra)[moving]
        fitted = rigid[moving] @ np.linalg.lstsq(rigid[moving], both, rcond=1e-9)[0]
        return float(np.sqrt(np.mean((both - fitted) ** 2))), float(both.std())

    current = np.concatenate([one.current for one in recordings])  # type: ignore[misc]
    model = np.linalg.lstsq(rigid[moving], current[moving], rcond=1e-9)[0]
    starts = np.cumsum([m.place.size for m in motions])[:-1]
    fitted = np.split(rigid @ model, starts)
    if effect == "time_delay":
        most = int(0.1 * recordings[0].rate_hz)
        left = [left_a([late(part, k) - part for part in fitted])[0] for k in range(most + 1)]
        samples = int(np.argmin(np.abs(np.array(left) - wanted_a)))
        if not 0.7 < left[samples] / wanted_a < 1.4:
            msg = "no delay of up to 0.1 s has this size"
            raise ValueError(msg)
        return [delayed(one, samples) for one in recordings]
    loads = np.split(rigid[:, :-3] @ model[:-3], starts)
    extra = EXTRA[effect](np.random.default_rng(seed), motions, loads)
    sharper = [Motion.of(one, times=1) for one in recordings]
    other = EXTRA[effect](np.random.default_rng(seed), sharper, loads)
    left, whole = left_a(extra)
    moved, _ = left_a([a - b for a, b in zip(other, extra, strict=True)])
    if moved > MOST_MOVED * left:
        msg = f"{moved / left:.2f} of it changes with how the motion is smoothed"
        raise ValueError(msg)
    if left < LEAST_LEFT * whole or left == 0.0:
        msg = f"the declared effects leave {left / max(whole, 1e-12):.2f} of it"
        raise ValueError(msg)
    scale = wanted_a / left
    if effect == "load_friction" and scale > 1:
        msg = f"friction of {scale:.1f} times the load is none"
        raise ValueError(msg)
    return [
        replace(one, current=one.current + scale * part)
        for one, part in zip(recordings, extra, strict=True)
    ]


def late(values: Floats, samples: int) -> Floats:
    """Shift by whole samples, the first value held."""
    return np.concatenate([np.full(samples, values[0]), values[: values.size - samples]])


def delayed(one: Logged, samples: int) -> Logged:
    """Log the current later than all else, and what then has no partner not at all."""

    def cut(values: Floats | None) -> Floats | None:
        return None if values is None else values[samples:]

    assert one.current is not None
    return replace(
        one,
        current=one.current[: one.current.size - samples],
        position=cut(one.position),
        velocity=cut(one.velocity),
        temperature=cut(one.temperature),
        others={axis: values[samples:] for axis, values in one.others.items()},
    )


@dataclass(frozen=True)
class Motion:
    """A recording's smoothed motion in rad and seconds, shape (n,) each."""

    rate_hz: float
    place: Floats
    speed: Floats
    acceleration: Floats

    @classmethod
    def of(cls, one: Logged, times: int = 2) -> "Motion":
        """Smooth over 20 ms, or eight samples, so many times."""
        assert one.position is not None
        place = one.position
        for _ in range(times):
            place = smoothed(place, one.rate_hz)
        speed = np.gradient(place) * one.rate_hz
        return cls(one.rate_hz, place, speed, np.gradient(speed) * one.rate_hz)

    @property
    def top(self) -> float:
        """Speed that a fiftieth of the samples exceed, in rad/s, to two digits."""
        return float(f"{np.quantile(np.abs(self.speed), 0.98):.2g}")

    @property
    def moving(self) -> np.ndarray:
        """Samples above 2 % of the top speed."""
        return np.abs(self.speed) > 0.02 * self.top

    @property
    def side(self) -> Floats:
        """Direction, rounded off at a hundredth of the top speed."""
        return np.tanh(self.speed / (0.01 * self.top))

    def rigid(self, gravity: bool) -> Floats:
        """Columns of the declared effects, friction and offset last."""
        weight = [np.sin(self.place), np.cos(self.place)] if gravity else []
        parts = [self.acceleration, *weight, np.ones(self.place.size), self.side, self.speed]
        return np.stack(parts, axis=1)


def smoothed(values: Floats, rate_hz: float) -> Floats:
    """Average over 20 ms or eight samples; what is beyond an end is its image in the end point."""
    half = max(round(0.01 * rate_hz), 4)
    before = 2 * values[0] - values[half:0:-1]
    beyond = 2 * values[-1] - values[-2 : -half - 2 : -1]
    window = np.hanning(2 * half + 3)[1:-1]
    padded = np.concatenate([before, values, beyond])
    return np.convolve(padded, window / window.sum(), mode="valid")


def _span(motions: list[Motion]) -> tuple[float, float]:
    """Lowest place and travel."""
    low = min(float(m.place.min()) for m in motions)
    return low, max(float(m.place.max()) for m in motions) - low


def _ripple(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """Make waves over the angle, slower than a twenty-fifth of the rate where it moves fastest."""
    highest = 2 * np.pi * motions[0].rate_hz / 25 / max(m.top for m in motions)
    order, phase = rng.uniform(0.5, 1.0) * highest, rng.uniform(0, 2 * np.pi)
    return [np.sin(order * m.place + phase) for m in motions]


def _hum(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """Take a multiple of the mains, whose phase no recording knows of another."""
    hertz = rng.choice([50.0, 60.0]) * rng.uniform(0.998, 1.002) * rng.choice([1, 2, 3, 6])
    turn = [rng.uniform(0, 2 * np.pi) + 2 * np.pi * hertz * seconds(m) for m in motions]
    return [np.sin(angle) for angle in turn]


def seconds(m: Motion) -> Floats:
    """Time from the recording's start."""
    return np.arange(m.place.size) / m.rate_hz


def _drag(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    low, travel = _span(motions)
    place, width = low + rng.uniform(0.2, 0.8) * travel, rng.uniform(0.03, 0.12) * travel
    return [m.side * np.exp(-0.5 * ((m.place - place) / width) ** 2) for m in motions]


def _spring(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    sign = rng.choice([-1.0, 1.0])
    return [sign * m.place for m in motions]


def _load(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """Friction with the joint's own gravity and inertia, as the declared effects fit them."""
    return [m.side * np.abs(load) for m, load in zip(motions, loads, strict=True)]


def _stribeck(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    slow = rng.uniform(0.05, 0.3) * max(m.top for m in motions)
    return [m.side * np.exp(-((m.speed / slow) ** 2)) for m in motions]


def _asymmetric(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """More viscous friction one way."""
    way = rng.choice([-1.0, 1.0])
    return [np.where(way * m.speed > 0, m.speed, 0.0) for m in motions]


def _payload(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """Put a tool on after the first recording: its gravity; the acceleration is not known well."""
    hang = rng.uniform(0, 2 * np.pi)
    after = [np.sin(m.place + hang) for m in motions[1:]]
    return [np.zeros(motions[0].place.size), *after]


def _hysteresis(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """Friction that turns round over some travel from the last stroke's on (Dahl)."""
    length = rng.uniform(0.02, 0.15) * _span(motions)[1]
    states = []
    for m in motions:
        state = np.empty(m.place.size)
        now = -np.sign(m.place[-1] - m.place[0])
        for n, step in enumerate(np.diff(m.place, prepend=m.place[0])):
            now += (np.sign(step) - now) * (1 - np.exp(-abs(step) / length))
            state[n] = now
        states.append(state)
    return states


def _warmup(rng: Generator, motions: list[Motion], loads: list[Floats]) -> list[Floats]:
    """Let friction, dry and viscous, fade over the time that is logged."""
    begun = np.cumsum([0, *[m.place.size / m.rate_hz for m in motions]])
    lasts_s = rng.uniform(0.1, 0.6) * begun[-1]
    return [
        (0.6 * m.side + 0.4 * m.speed / m.top) * np.exp(-(start + seconds(m)) / lasts_s)
        for m, start in zip(motions, begun[:-1], strict=True)
    ]


EXTRA = {
    "ripple": _ripple,
    "mains_hum": _hum,
    "position_drag": _drag,
    "spring": _spring,
    "load_friction": _load,
    "stribeck": _stribeck,
    "asymmetric_friction": _asymmetric,
    "payload_change": _payload,
    "hysteresis": _hysteresis,
    "warmup": _warmup,
}
