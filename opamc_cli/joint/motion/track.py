"""A joint's recording as the loop sees it: one uniform grid, motion, current and groups."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from opamc_cli.signal.motion.smoothing import averaged, block_mean
from opamc_cli.signal.transform.least_squares import inverse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Laid = dict[Hashable, Floats]
Terms = tuple[Any, ...]
"""Fitted terms (`fit.model.Term`), which know tracks, and which tracks need not know."""


NOT_AVERAGED = ("direction", "moving", "clear", "group", "open_samples", "blur")
"""What has a value per sample, but in a block something else than their mean, or nothing."""

SHORTEST_PATH = 2.9
"""Travels of a path that passes its places again the same way; ways end a little apart."""
ENOUGH_ROWS = 4000
"""By which the load's shapes are told apart: built-in effects' loads are sums of them."""


@dataclass(frozen=True)
class Joint:
    """Constants of the joint; None where nobody knows them."""

    gear_ratio: float | None = None
    pole_pairs: int | None = None


@dataclass(frozen=True)
class Track:
    """All recordings of one joint, one after another on a uniform grid of samples."""

    rate_hz: float
    """Sampling rate of the grid."""
    bounds: tuple[tuple[int, int], ...]
    """Half-open (start, stop) of each recording on the grid."""
    time_s: Floats
    run_time_s: Floats
    """With `time_s`: seconds since the first recording began, and since the sample's own; (n,)."""
    current_a: Floats
    """Torque-producing motor current with its sign; (n,)."""
    position_rad: Floats
    velocity: Floats
    acceleration: Floats
    """With `position_rad`, `velocity`: smoothed motion: joint side where the scale is known, else
    of the angle that is known; (n,)."""
    machine_angle_rad: Floats
    """Angle whose orders are searched: motor, joint or electrical, as `angle_kind` says; (n,)."""
    angle_kind: str
    """What one revolution of `machine_angle_rad` is."""
    direction: Floats
    """-1, 0 or 1; 0 where the joint is too slow to tell; (n,)."""
    moving: Bools
    """Samples that count: the joint moves and its direction is certain; shape (n,)."""
    clear: Bools
    """Samples at which the smoothing of the motion takes nothing from the acceleration. On the
    coarse grid, where the current is equally smooth, others count as well; at the full rate
    residuals are looked at on these; bool array of shape (n,)."""
    group: Ints
    """Cycle, recording or block that is left out as one, -1 outside all of them; int, (n,)."""
    load_a: Floats
    model_a: Floats
    """With `load_a`: current that carries the load, and the whole fitted one, 0 at first; (n,)."""
    joint: Joint
    channels: frozenset[str]
    """What was logged or follows from it: position, logged (motion beside the current), scale,
    temperature, phases, electrical."""
    temperature_c: Floats | None = None
    payload_kg: Floats | None = None
    electrical_rad: Floats | None = None
    """With `temperature_c`, `payload_kg`: where known; (n,) or None."""
    static_terms: Terms = ()
    """Fitted terms that neither shift nor ripple."""
    open_samples: Bools | None = None
    """Moving samples that a fit may look at: none that are sealed; bool array of shape (n,) or
    None."""
    kernel: Floats = field(default_factory=lambda: np.ones(1))
    """Moving average of the acceleration; the coarse grid puts the current through it too."""
    evenly_smooth: bool = False
    """True where position and speed have gone through it; else the coarse grid does that."""
    blur: Floats | None = None
    """What the acceleration would gain or lose by a shorter and a longer window; (n, 2) or None."""
    others: Floats | None = None
    """Positions, speeds and accelerations of the arm's other joints, as smooth as this one's, where
    any of them moves; (n, 3m) or None."""
    other_axes: tuple[int, ...] = ()
    """Their axes; m of them."""
    full: "Track | None" = None
    """What an averaged track is the block means of: the same recordings at the full rate, with
    current, position, speed and direction as smooth as the acceleration."""
    period_s: float = np.inf
    """Time after which each recording's motion repeats itself, if it does."""
    reference: "Reference | None" = None
    """What regressors are measured by, where it is not to be that of these recordings."""
    guessed_s: tuple[float, ...] = ()
    turns: tuple[float, ...] = ()
    """Lengths of gaps without current in which the motion, of phases alone, is a guess; electrical
    radians per joint radian that phases beside a position tell."""

    @property
    def size(self) -> int:
        """Number of samples on the grid."""
        return int(self.time_s.size)

    @cached_property
    def speed_scale(self) -> float:
        """Speed that moving samples reach at their 95th percentile."""
        if self.reference is not None:
            return self.reference.speed
        speeds = np.abs(self.velocity[self.moving])
        return float(np.quantile(speeds, 0.95)) if speeds.size else 1.0

    @property
    def travel_rad(self) -> float:
        """Way from the lowest to the highest position of the moving samples."""
        return float(np.ptp(self.position_rad[self.moving]))

    @cached_property
    def order_resolution(self) -> float:
        """Smallest difference of orders that the travelled angle can tell apart."""
        return float(2 * np.pi / np.ptp(self.machine_angle_rad[self.moving]))

    @cached_property
    def middle_temperature_c(self) -> float:
        """Mean temperature of the moving samples; 0 where none is logged."""
        if self.reference is not None and self.reference.temperature_c is not None:
            return self.reference.temperature_c
        return 0.0 if self.temperature_c is None else float(self.temperature_c[self.moving].mean())

    @cached_property
    def inertia_weights(self) -> tuple[Ints, Floats]:
        """Samples of a load, and weights whose sum over them is what follows the acceleration."""
        rows = np.flatnonzero(self.moving)
        rows = rows[:: max(rows.size // ENOUGH_ROWS, 1)]
        place = self.position_rad[rows]
        shapes = np.stack((self.acceleration[rows], np.sin(place), np.cos(place), place, place**0))
        return rows, inverse(shapes @ shapes.T)[0] @ shapes

    @cached_property
    def starts_s(self) -> Floats:
        """When each recording began, in seconds; (r,)."""
        return np.unique(np.round(self.time_s - self.run_time_s, 3))

    @cached_property
    def comes_back(self) -> bool:
        """Whether a recording by itself passes its places again."""
        began = np.round(self.time_s - self.run_time_s, 3)
        return any(comes_back(self.position_rad[began == start]) for start in self.starts_s)

    @cached_property
    def laid(self) -> Laid:
        """Regressors that stay the same, by term and grid, for every model."""
        return {}

    @cached_property
    def full_columns(self) -> Floats:
        """Regressors of the static terms on the full rate's samples, shape (m, k)."""
        return self._static("full" if self.full else True)

    @cached_property
    def static_columns(self) -> Floats:
        """Regressors of the static terms on this track's own samples, shape (n, k)."""
        return self._static("means") if self.full else self.full_columns

    def _static(self, kind: Hashable) -> Floats:
        blocks = [np.zeros((self.size if kind == "means" else (self.full or self).size, 0))]
        for term in self.static_terms:
            block = self.laid.get((term.key, kind))
            if block is None:
                block = term.columns(self.full or self)
                block = self.own_means(block) if kind == "means" else block
            if term.is_constant:
                self.laid[term.key, kind] = block
            blocks.append(block)
        return np.concatenate(blocks, axis=1)

    @cached_property
    def static_sums(self) -> Floats:
        """Running sums of the static regressors, (m + recordings, k), from zero in each."""
        zero = np.zeros((1, self.full_columns.shape[1]))
        bounds = (self.full or self).bounds
        each = [np.cumsum(self.full_columns[start:stop], axis=0) for start, stop in bounds]
        return np.concatenate([part for sums in each for part in (zero, sums)])

    def own_means(self, values: Floats) -> Floats:
        """Average what is given at the full rate, (n,) or (n, k), over this track's own samples."""
        full = self.full or self
        return block_mean(values, full.bounds, round(full.rate_hz / self.rate_hz))

    def forget(self) -> None:
        """Drop what follows from the static terms: a search keeps hundreds of fits."""
        for name in ("full_columns", "static_columns", "static_sums"):
            self.__dict__.pop(name, None)

    def with_model(
        self, load_a: Floats, model_a: Floats, static_terms: Terms, laid: Laid | None = None
    ) -> "Track":
        """Return the same track with the fitted load and model currents, given at its full rate."""
        full = self.full and self.full.with_model(load_a, model_a, ())
        load_a, model_a = self.own_means(load_a), self.own_means(model_a)
        new = replace(self, load_a=load_a, model_a=model_a, static_terms=static_terms, full=full)
        # What follows from the motion alone stays, and is asked for at every step of a fit.
        for name in ("speed_scale", "inertia_weights", *{"order_resolution"} & vars(self).keys()):
            new.__dict__[name] = getattr(self, name)
        new.__dict__["laid"] = self.laid if laid is None else laid
        return new


@dataclass(frozen=True)
class Reference:
    """What regressors are measured by: a speed, in rad/s, and a temperature, if one is logged."""

    speed: float
    temperature_c: float | None


def comes_back(position_rad: Floats) -> bool:
    """Whether a path, (n,), goes there, back and there again."""
    return bool(np.abs(np.diff(position_rad)).sum() >= SHORTEST_PATH * np.ptp(position_rad))


def ranges(lengths: Iterable[int]) -> tuple[tuple[int, int], ...]:
    """Half-open ranges of so many samples each, one after another."""
    return tuple(pairwise(accumulate(lengths, initial=0)))


def sampled(track: Track) -> dict[str, Any]:
    """Return what a track has per sample, by name: every array but the kernel."""
    every = {one.name: getattr(track, one.name) for one in fields(track) if one.name != "kernel"}
    return {name: values for name, values in every.items() if isinstance(values, np.ndarray)}


def excerpt(track: Track, inside: Bools, spans: tuple[tuple[int, int], ...]) -> Track:
    """Cut spans out of a track, each inside one recording; each becomes a recording of its own.

    Samples that are not `inside`, bool (n,), lose their group.
    """
    rows = np.concatenate([np.arange(start, stop) for start, stop in spans])
    track = replace(track, group=np.where(inside, track.group, -1))
    taken = {name: values[rows] for name, values in sampled(track).items()}
    return replace(track, bounds=ranges(stop - start for start, stop in spans), **taken)


def by_motor(track: Track, told: Joint) -> Track:
    """Count a track's orders by the motor's turns, once its gear ratio or pole pairs are told."""
    turns, known = told.gear_ratio or 1 / (told.pole_pairs or 1), track.joint
    joint = Joint(told.gear_ratio or known.gear_ratio, told.pole_pairs or known.pole_pairs)
    angle = turns * track.machine_angle_rad
    return replace(track, machine_angle_rad=angle, angle_kind="motor", joint=joint)


def joined(pieces: Sequence[Track]) -> Track:
    """Lay tracks of one joint at one rate one after another; what one of them lacks, none has."""
    parts = [sampled(piece) for piece in pieces]
    whole: dict[str, Any] = dict.fromkeys(parts[0])
    for name in set.intersection(*map(set, parts)):
        each = [part[name] for part in parts]
        whole[name] = np.concatenate(each) if len(each) > 1 else each[0]
    return replace(
        pieces[0],
        **whole,
        bounds=ranges(piece.size for piece in pieces),
        channels=frozenset.intersection(*(piece.channels for piece in pieces)),
        kernel=max((piece.kernel for piece in pieces), key=len),
        evenly_smooth=all(piece.evenly_smooth for piece in pieces),
        guessed_s=sum((piece.guessed_s for piece in pieces), ()),
        turns=sum((piece.turns for piece in pieces), ()),
    )


def coarsen(track: Track, factor: int) -> Track:
    """Average a track over blocks of samples; a block moves if all of its samples move.

    Current, position and speed are first put through the moving average that the acceleration has
    gone through: next to a step of the acceleration, a speed that is rounded off less than the
    current is some per cent off, which looks like friction of another form.
    """
    if factor == 1 and track.kernel.size == 1:
        return track

    def mean(values: Floats) -> Floats:
        return block_mean(values, track.bounds, factor)

    def smooth(values: Floats) -> Floats:
        return averaged(values, track.bounds, track.kernel)

    full = replace(track, current_a=smooth(track.current_a), direction=smooth(track.direction))
    if not track.evenly_smooth:
        full = replace(
            full, position_rad=smooth(track.position_rad), velocity=smooth(track.velocity)
        )

    group = mean(track.group.astype(float))
    clear = mean(track.clear.astype(float)) > 1 - 1e-9
    whole = group == np.round(group)
    moving = (mean(track.moving.astype(float)) > 1 - 1e-9) & whole
    means: dict[str, Any] = sampled(full)
    means = {name: mean(one) for name, one in means.items() if name not in NOT_AVERAGED}
    return replace(
        track,
        rate_hz=track.rate_hz / factor,
        bounds=ranges((stop - start) // factor for start, stop in track.bounds),
        direction=np.sign(mean(track.direction)),
        moving=moving,
        clear=clear,
        group=np.where(whole, group, -1).astype(np.int64),
        blur=None,
        **means,
        full=full,
    )
