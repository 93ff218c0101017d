"""What one axis of one run looks like: its channels, their size, their sanity."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.signal.plausible.quality import clipped_share
from opamc_cli.signal.transform.analytic import clarke
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.storage.runs.columns import AxisChannels
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.sources import RunSource

LOOKS = 8
"""Places of each axis that are looked at, spread over the run."""

LONGEST_LOOK = 1 << 15
"""Samples of a stretch that are looked at."""

AT_ONE_PLACE = 2 * LONGEST_LOOK
"""Samples of neighbouring motions from which on no further one is looked at: of two at least."""

FROZEN_S = 0.25
"""A phase that keeps one value for so long while another swings is frozen: the slowest carrier
that counts as motion has two periods in it."""

SWING = 0.5
"""Of the others' largest swing: less is standstill, where a coarse converter keeps its value."""

SMALLEST = (0.01, 0.05)
"""Parts of a current's changes whose largest ones are one and the same where it comes in steps."""

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """One axis of one run."""

    run: str
    path: Path
    axis: int
    signal: tuple[str, ...]
    """Columns that the diagnosis uses."""
    moves: bool
    """Whether a motion was found; otherwise the rest is of stretches anywhere in the run."""
    size: Mapping[str, float]
    """Root mean square of each kind of channel about its mean, in the channel's unit."""
    imbalance: float | None
    """Root mean square of the sum of three phases over that of the phases; None without three."""
    clipped: Mapping[str, float]
    """Share of clipped samples by column."""
    missing: Mapping[str, float]
    """Share of samples that are no numbers, by column of a current."""
    changing: float
    """Share of a current's samples that differ from the one before, as many as differ from that
    and from the one after: of values that are each logged twice none; of the coarsest column."""
    steps: tuple[float, float]
    """Quantiles 0.01 and 0.05 of the sizes of a current's changes, those of nothing left out: both
    are the converter's step where it is no finer than the noise; of the coarsest column."""
    noise: float
    """Median size of a current's second differences, mean of its columns: what a filter takes."""
    frozen: tuple[str, float] | None
    """Column that keeps one value while another swings, and from when on in seconds, or None."""
    leaning: float | None = None
    """Of a reported current: share of it that has the sign of the speed, less what has the other;
    None without one."""
    reversing: float | None = None
    """Of a reported current: share of the samples that have the rarer of both signs."""
    level: float | None = None
    """Of a reported current: root mean square with its mean, which no sign changes."""
    one_way: float | None = None
    """Of a reported current: its mean over its level, -1..1, as a load leaves it that does not
    turn."""
    returning: float | None = None
    """Beside a reported current: share of the joint's way that leads in the rarer direction."""
    turning: float | None = None
    """Of three phases beside a logged motion: how much more their vector turns with the speed than
    against it, -1..1; None without both."""


@dataclass(frozen=True)
class _Job:
    """A run, and the motions that were found on each of its axes."""

    source: RunSource
    spans: Mapping[int, Sequence[tuple[int, int]]]


def measure(
    sources: Sequence[RunSource], segments: pa.Table, kept: KeptResults | None = None
) -> list[Measured]:
    """Measure every axis of every run, from a few of its motions that no gap has cut.

    Raises
    ------
    InputError
        If samples of a run cannot be read.
    """
    rows: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for row in segments.select(["run", "axis", "start", "stop", "edge"]).to_pylist():
        rows.setdefault((row["run"], row["axis"]), []).append(row)
    spans: dict[str, dict[int, list[tuple[int, int]]]] = {}
    for (name, axis), own in rows.items():
        whole = [*own[:1], *(row for row in own[1:-1] if not row["edge"]), *own[1:][-1:]]
        spans.setdefault(name, {})[axis] = [(row["start"], row["stop"]) for row in whole]
    measured = remembered(_measure_run, kept)
    return [
        Measured(source.name, source.path, **values)
        for source in sources
        for values in measured(_Job(source, spans.get(source.name, {})))
    ]


def _measure_run(job: _Job) -> tuple[dict[str, Any], ...]:
    with job.source.open() as run:
        return tuple(_measure(run, axis, job.spans.get(axis, [])) for axis in run.axes)


def _measure(run: Run, axis: int, spans: Sequence[tuple[int, int]]) -> dict[str, Any]:
    """Return what a `Measured` says of an axis, but for which run it is."""
    channels = run.channels(axis)
    signal = _signal(channels)
    motion = [name for name in (channels.position, channels.velocity) if name]
    names = list(dict.fromkeys([*signal, *motion]))
    stretches = _neighbours(spans) or [
        (start, start + LONGEST_LOOK)
        for start in range(0, run.n_samples, max(run.n_samples // LOOKS, LONGEST_LOOK))
    ]
    looks = [
        {
            name: values.astype(np.float64)
            for name, values in run.read(names, start, min(stop, start + LONGEST_LOOK)).items()
        }
        for start, stop in stretches
    ]
    currents = [name for name in signal if name not in motion]
    motion_told = currents == [channels.current] and bool(motion)
    kinds = {"current": currents, "position": channels.position, "velocity": channels.velocity}
    return {
        "axis": axis,
        "signal": signal,
        "moves": bool(spans),
        "size": {
            kind: _rms([_centred(look[name]) for look in looks for name in named])
            for kind, own in kinds.items()
            if (named := [own] if isinstance(own, str) else own)
        },
        "imbalance": _imbalance(looks, currents) if len(currents) == 3 else None,
        "clipped": {
            name: clipped_share(np.concatenate([look[name] for look in looks])) for name in currents
        },
        "missing": {
            name: float(np.mean(~np.isfinite(np.concatenate([look[name] for look in looks]))))
            for name in currents
        },
        "changing": min(
            (_changing([look[name] for look in looks]) for name in currents), default=1.0
        ),
        "steps": max(
            (_steps([look[name] for look in looks]) for name in currents), default=(0.0, 0.0)
        ),
        "noise": float(np.mean([_noise([look[name] for look in looks]) for name in currents] or 0)),
        "frozen": _frozen(
            run, currents, motion, looks, [start for start, _ in stretches] if spans else []
        ),
        **(_signs(looks, currents[0], motion[0]) if motion_told else {}),
        **(
            {"turning": _turning(looks, currents, motion[0])}
            if motion and len(currents) == 3
            else {}
        ),
    }


def _neighbours(spans: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Pick motions at some places of a run, at each of them neighbours.

    Single ones, evenly spaced, may be the same motion of the program each time: of sixteen to and
    fro the way there alone.
    """
    picked = []
    apart = -(-len(spans) // LOOKS) or 1
    for first in range(0, len(spans), apart):
        seen = 0
        for start, stop in spans[first : first + apart]:
            if seen >= AT_ONE_PLACE:
                break
            picked.append((start, stop))
            seen += min(stop - start, LONGEST_LOOK)
    return picked


def _signal(channels: AxisChannels) -> tuple[str, ...]:
    """Columns that a diagnosis uses: the phases, or the reported current and what moves it."""
    if channels.phases:
        # two phases are used as one
        return channels.phases if len(channels.phases) == 3 else channels.phases[:1]
    motion = channels.position or channels.velocity
    return tuple(name for name in (channels.current, motion) if name)


def _imbalance(looks: Sequence[Mapping[str, Floats]], names: Sequence[str]) -> float | None:
    own = [[_centred(look[name]) for name in names] for look in looks]
    size = _rms([phase for phases in own for phase in phases])
    return _rms([np.sum(phases, axis=0) for phases in own]) / size if size > 0 else None


def _frozen(
    run: Run,
    currents: Sequence[str],
    motion: Sequence[str],
    looks: Sequence[Mapping[str, Floats]],
    starts: Sequence[int],
) -> tuple[str, float] | None:
    """Look for a channel that keeps its value while what belongs to it swings."""
    found = _still_beside(run, currents, currents) if len(currents) > 1 else []
    if len(motion) == 2:
        # a speed keeps its value while a joint turns evenly, a position does not
        found += _still_beside(run, motion, motion[:1])
    if len(currents) == 1 and motion:
        # nothing tells a frozen current from a joint that rests, but through a motion none rests
        name = currents[0]
        found += [
            (start, name)
            for start, look in zip(starts, looks, strict=False)
            if np.isfinite(look[name]).any() and not _swing(look[name])
        ]
    return (min(found)[1], min(found)[0] / run.sampling_rate_hz) if found else None


def _still_beside(run: Run, names: Sequence[str], suspects: Sequence[str]) -> list[tuple[int, str]]:
    """Return where suspects keep their value while another of the channels swings."""
    least = max(int(FROZEN_S * run.sampling_rate_hz), 2)
    measure = [name for name in names if name not in suspects] or names
    swing = 0.0
    found: list[tuple[str, int, float]] = []
    for start, block in run.blocks(names):
        swing = max(swing, *(_swing(block[name]) for name in measure))
        for name in suspects:
            for first, last in _constant(block[name], least):
                others = [_swing(block[n][first:last]) for n in names if n != name]
                found.append((name, start + first, max(others)))
    return [(at, name) for name, at, others in found if others > SWING * swing]


def _turning(looks: Sequence[Mapping[str, Floats]], phases: Sequence[str], motion: str) -> float:
    """Return how much more a current vector turns with the speed than against it."""
    vectors = [clarke(*(look[name] for name in phases)) for look in looks]
    turns = np.concatenate([(z * np.roll(z, 1).conj()).imag[1:] for z in vectors])
    with_speed = turns * np.sign(np.concatenate([_speed(look, motion)[1:] for look in looks]))
    size = np.nansum(np.abs(with_speed))
    return float(np.nansum(with_speed) / size) if size else 0.0


def _signs(looks: Sequence[Mapping[str, Floats]], current: str, motion: str) -> dict[str, float]:
    """Return how a reported current leans with the speed, the rarer signs of both, and its size."""
    values = np.concatenate([look[current] for look in looks])
    speeds = np.concatenate([_speed(look, motion) for look in looks])
    drawn, size = np.nansum(values * np.sign(speeds)), np.nansum(np.abs(values))
    forth, back = (float(np.nansum(np.maximum(way * speeds, 0.0))) for way in (1, -1))
    level = _rms([values])
    mean = float(np.nanmean(values)) if np.isfinite(values).any() else 0.0
    signed = [int(np.count_nonzero(values > 0)), int(np.count_nonzero(values < 0))]
    return {
        "leaning": float(drawn / size) if size else 0.0,
        "reversing": min(signed) / max(sum(signed), 1),
        "level": level,
        "one_way": mean / level if level else 0.0,
        "returning": min(forth, back) / (forth + back) if forth + back else 0.0,
    }


def _speed(look: Mapping[str, Floats], motion: str) -> Floats:
    """Return the speed of a look, or what it moves by from sample to sample."""
    values = look[motion]
    return values if motion.endswith("velocity") else np.diff(values, prepend=values[:1])


def _constant(values: npt.NDArray[np.floating], least: int) -> list[tuple[int, int]]:
    """Return the half-open stretches of at least `least` equal samples."""
    edges = np.concatenate(([0], np.flatnonzero(np.diff(values) != 0) + 1, [values.size]))
    return [
        (int(edges[i]), int(edges[i + 1])) for i in np.flatnonzero(np.diff(edges) >= least).tolist()
    ]


def _changing(parts: Sequence[Floats]) -> float:
    changes = _changes(parts) != 0
    both = changes[1:] & changes[:-1]
    return float(np.sqrt(np.mean(both))) if both.size else 1.0


def _steps(parts: Sequence[Floats]) -> tuple[float, float]:
    sizes = np.abs(_changes(parts))
    sizes = sizes[sizes > 0]
    smallest, small = np.quantile(sizes, SMALLEST) if sizes.size else (0.0, 0.0)
    return float(smallest), float(small)


def _noise(parts: Sequence[Floats]) -> float:
    bends = np.concatenate([np.abs(np.diff(part[np.isfinite(part)], 2)) for part in parts])
    return float(np.median(bends)) if bends.size else 0.0


def _changes(parts: Sequence[Floats]) -> Floats:
    return np.concatenate([np.diff(part[np.isfinite(part)]) for part in parts])


def _swing(values: npt.NDArray[np.floating]) -> float:
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _centred(values: Floats) -> Floats:
    known = values[np.isfinite(values)]
    return values - known.mean() if known.size else values


def _rms(parts: Sequence[Floats]) -> float:
    squares = np.concatenate([part[np.isfinite(part)] ** 2 for part in parts])
    return float(np.sqrt(squares.mean())) if squares.size else 0.0
