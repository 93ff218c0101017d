"""Signs that a channel cannot be trusted."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
MOST_BRIDGED = 3
"""Samples of a gap that is filled: a packet or two that a logger lost, less than any pattern
spans."""

FEWEST_CHANGES, LEAST_HELD, HELD_EVENLY, STEPS = 20, 3, 0.8, 4
"""Changes that tell at what distance they come; samples that a value is held for, at the least;
share of the distances that agree; and times its least change by which a channel usually does."""


def clipped_share(x: NDArray[np.floating]) -> float:
    """Share of the samples that sit at the channel's largest or smallest value, if it is clipped.

    A clipped channel reaches its extreme value far more often than the next value inside; a
    quantised crest does not. A current that rests at exactly zero is at no limit.

    Parameters
    ----------
    x : array, shape (n,)
        Samples of one channel; NaN is passed over.

    Returns
    -------
    float
        0 for a channel that does not look clipped.
    """
    known = x[np.isfinite(x)]
    if known.size < 2:
        return 0.0
    n_clipped = 0
    for extreme in (known.max(), known.min()):
        n_extreme = int(np.count_nonzero(known == extreme))
        inside = known[known != extreme]
        if extreme == 0 or n_extreme < max(10, known.size // 1000) or not inside.size:
            continue
        nearest = inside[np.argmin(np.abs(inside - extreme))]
        if n_extreme > 5 * np.count_nonzero(known == nearest):
            n_clipped += n_extreme
    return float(n_clipped / known.size)


def bridged(x: NDArray[np.floating]) -> NDArray[np.floating]:
    """Fill short gaps with a straight line between what is known.

    Parameters
    ----------
    x : array, shape (n,)
        Samples of one motion; NaN where unknown.

    Returns
    -------
    array, shape (n,)
        Gaps of more than `MOST_BRIDGED` samples, and those at an end, are left.
    """
    known = np.flatnonzero(np.isfinite(x))
    if known.size in (0, x.size):
        return x
    place = np.arange(known[0], known[-1] + 1)
    after = np.searchsorted(known, place)
    gap = known[after] - known[np.maximum(after - 1, 0)] - 1
    filled = x.copy()
    short = place[(gap > 0) & (gap <= MOST_BRIDGED)]
    filled[short] = np.interp(short, known, x[known])
    return filled


def held_for(x: NDArray[np.floating]) -> int | None:
    """Return for how many samples each value of a channel is held, None where they are its own.

    A channel that a bus brings less often than the logger writes a row keeps its last value until
    then: its changes come at one distance, and are of many sizes. A coarse encoder at an even speed
    changes at one distance, too, but by its one step.

    Parameters
    ----------
    x : array, shape (n,)
        Samples of one channel, as logged.
    """
    step = np.diff(x)
    change = np.flatnonzero(step)  # NaN is one
    if change.size < FEWEST_CHANGES or change.size > x.size / LEAST_HELD:
        return None
    apart, sizes = np.diff(change), np.abs(step[change])
    usual = round(float(np.median(apart)))
    apart = apart[apart <= 1.5 * usual]  # beyond, one value came twice
    even = np.mean(np.abs(apart - usual) <= max(1.0, 0.1 * usual)) >= HELD_EVENLY
    coarse = not np.median(sizes) >= STEPS * sizes.min()
    return usual if usual >= LEAST_HELD and even and not coarse else None


@dataclass(frozen=True)
class Limit:
    """Of one quantity of a joint, by its size."""

    impossible: float
    """More is of no joint."""
    unusual: float
    """More is of few."""
    unit: str
    """Of both."""
    looks_like: str
    """What it probably is instead."""
    lowest: float = -math.inf
    """Less is of no joint either, however small its size."""

    def holds(self, value: float | None) -> bool:
        """Whether a joint may have a value; what is not known, it may."""
        return value is None or not (value < self.lowest or abs(value) > self.impossible)

    @property
    def beyond(self) -> str:
        """What is of no joint, in words."""
        low = "beyond" if math.isinf(self.lowest) else f"below {self.lowest:g} or above"
        return f"{low} {self.impossible:g} {self.unit}"


LIMITS = {
    "A": Limit(1000.0, 200.0, "A", "mA taken for A"),
    "Nm": Limit(1e5, 3e4, "Nm", "mNm taken for Nm"),
    "velocity": Limit(100.0, 60.0, "rad/s", "degrees or rpm taken for rad/s, or the motor's side"),
    "position": Limit(100.0, 60.0, "rad/s", "degrees taken for rad, or the motor's side"),
    "temperature": Limit(250.0, 250.0, "°C", "another unit, or no sensor", lowest=-60.0),
}
"""By unit of the current, or by channel; of a position its speed counts.

The largest drives of robots peak at some 150 A, and their first joints hold 20 kNm; the fastest
joint, the last one of a small arm, turns at 50 rad/s. Windings stand 180 °C, greases -50 °C; 300 is
a hall in K, and a wire that is broken or short reads 850 or -200.
"""

SELDOM = 0.01
"""Share of the samples up to which they are disturbances of a log that is right."""

ABOVE = 5.0
"""Times the largest of all other samples: as much stands out. A log in another unit, whose largest
samples alone are beyond any joint's, has others nearly as large."""

STRIDE_S = 0.05
"""Over which a position's speed is taken: steps and noise of the encoder do not count."""

WRAPPED = 0.5
"""Rad by which a jump may miss a whole turn to be one: a wrist that passes half a turn."""


@dataclass
class Size:
    """How large a channel's numbers are, counted block by block."""

    limit: Limit
    """What they are held against."""
    known: int = 0
    """Samples that were seen."""
    impossible: int = 0
    unusual: int = 0
    """With `impossible`: those beyond."""
    largest: float = 0.0
    """Of their sizes."""

    def add(self, values: NDArray[np.floating]) -> None:
        """Count a block; NaN is no large number."""
        extremes = (np.fmax.reduce(values, initial=0.0), np.fmin.reduce(values, initial=0.0))
        self.known += values.size
        self.largest = max(self.largest, float(extremes[0]), -float(extremes[1]))
        if self.largest <= self.limit.unusual and extremes[1] >= self.limit.lowest:
            return
        sizes, low = np.abs(values), values < self.limit.lowest
        self.impossible += int(np.count_nonzero((sizes > self.limit.impossible) | low))
        self.unusual += int(np.count_nonzero((sizes > self.limit.unusual) | low))

    @property
    def is_impossible(self) -> bool:
        """Whether so many are beyond any joint's that it is no disturbance."""
        return self.impossible > SELDOM * self.known

    def doubt(self) -> str | None:
        """Say what is odd about them; None if nothing is."""
        limit = self.limit
        if self.is_impossible:
            return (
                f"is {limit.beyond} in {self.impossible / self.known:.0%} of its samples (up to "
                f"{self.largest:.3g}), which no robot's joint is: {limit.looks_like}?"
            )
        if self.unusual > SELDOM * self.known:
            return (
                f"is beyond {limit.unusual:g} {limit.unit} in {self.unusual / self.known:.0%} of "
                f"its samples (up to {self.largest:.3g}), as few robots' joints are: "
                f"{limit.looks_like}?"
            )
        if self.impossible:
            return (
                f"has {self.impossible} samples {limit.beyond} (up to {self.largest:.3g}), which "
                "are no measurement"
            )
        return None


def spikes(values: NDArray[np.floating], limit: Limit) -> NDArray[np.intp]:
    """Return which samples are beyond any joint's and stand out of a log that is right.

    Parameters
    ----------
    values : array, shape (n,)
        Samples of one channel; NaN is none.
    limit
        What they are held against.

    Returns
    -------
    array of int, shape (k,)
        Their indices, ascending; empty where more than `SELDOM` are beyond.
    """
    none = np.zeros(0, dtype=np.intp)
    extremes = (np.fmax.reduce(values, initial=0.0), np.fmin.reduce(values, initial=0.0))
    if max(extremes[0], -extremes[1]) <= limit.impossible:
        return none
    sizes = np.abs(values)
    beyond = sizes > limit.impossible
    if np.count_nonzero(beyond) > SELDOM * values.size:
        return none
    usual = np.fmax.reduce(sizes[~beyond], initial=0.0)
    return np.flatnonzero(beyond) if sizes[beyond].min() > ABOVE * usual else none


def strided_speed(position_rad: FloatArray, fs_hz: float) -> FloatArray:
    """Return mean speeds, rad/s, of a position, (n,), over `STRIDE_S`, turns' jumps left out."""
    steps = np.diff(position_rad)
    turns = np.round(steps / (2 * np.pi))
    wrapped = (np.abs(turns) == 1) & (np.abs(np.abs(steps) - 2 * np.pi) < WRAPPED)
    path = np.cumsum(np.where(wrapped, steps - turns * 2 * np.pi, np.nan_to_num(steps)))
    stride = max(1, round(STRIDE_S * fs_hz))
    return np.asarray((path[stride:] - path[:-stride]) * fs_hz / stride)
