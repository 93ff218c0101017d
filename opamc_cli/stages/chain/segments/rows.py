"""Rows of the segment table, and what is told of the axis beside them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.plausible.quality import LIMITS, MOST_BRIDGED
from opamc_cli.storage.runs.columns import AxisChannels
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES

EDGE_S = 0.05
"""A motion this near to the recording's edge, or to a gap of this length, may be cut by it."""

STILL_SHARE = 0.05
"""A recording that stands still for less than this share never stands still."""


@dataclass(frozen=True)
class Segment:
    """One segment of an axis; see the schema of the segment table."""

    start: int
    stop: int
    f_max_hz: float
    direction: int
    variance: float
    kind: str = "motion"


FEWEST_HELD, RARELY = 20, 0.1
"""Equal samples in a row that are held, and the share of samples like the one before them up to
which they are: by chance twenty in a row are 1e-20."""

MOST_MISSING = 0.1
"""Share of an axis's samples without a number that is a note; of more it is said that they lack."""


class AxisSegments(NamedTuple):
    """What was found on one axis of one run."""

    run: str
    """Name of the run."""
    rows: tuple[dict[str, Any], ...]
    """Rows of the segment table."""
    notes: tuple[str, ...] = ()
    """One sentence for each doubtful channel."""
    stands: str | None = None
    """Why there is no row, or None."""
    lost: str | None = None
    """One sentence if so many samples are no numbers that motions are likely among them."""
    n_missing: int = 0
    """Samples at which its current, or what tells its motion, is no number or was not renewed."""


def lost(axis: int, share: float) -> str | None:
    """Say that a share of an axis's samples is no numbers, if it is more than a tenth."""
    if share <= MOST_MISSING:
        return None
    return (
        f"{share:.0%} of the current of axis {axis} is no numbers, and what moved "
        "meanwhile is not judged; check the log"
    )


class Flags:
    """Where something is so, gathered block by block."""

    def __init__(self) -> None:
        self._flips: list[int] = []
        self._is_so = False
        self._n = 0

    def push(self, is_so: npt.NDArray[np.bool_]) -> None:
        """Take the samples of the next block."""
        flips = np.flatnonzero(np.diff(is_so, prepend=self._is_so))
        self._flips += (flips + self._n).tolist()
        self._is_so, self._n = bool(is_so[-1]), self._n + is_so.size

    def spans(self, least: float = 1) -> list[tuple[int, int]]:
        """Return the first sample of each stretch that lasts as long, and the one behind it."""
        ends = [*self._flips, self._n] if self._is_so else self._flips
        return [(a, b) for a, b in zip(ends[::2], ends[1::2], strict=True) if b - a >= least]

    @property
    def share(self) -> float:
        """Share of the samples at which it is so."""
        return sum(b - a for a, b in self.spans()) / max(self._n, 1)


def lost_spans(unknown: Flags, held: Flags, rate_hz: float) -> list[tuple[int, int]]:
    """Return where channels are lost for a while: no numbers, or the last one kept.

    Values are kept by a logger that waits for its bus, if they change with nearly each sample else.
    """
    least = max(EDGE_S * rate_hz, MOST_BRIDGED + 1)
    kept = held.spans(max(least, FEWEST_HELD)) if held.share < RARELY else []
    return unknown.spans(least) + kept


def make_rows(
    run: Run,
    channels: AxisChannels,
    segments: Sequence[Segment],
    signal: str,
    gaps: Sequence[tuple[int, int]],
) -> tuple[dict[str, Any], ...]:
    """Complete segments to rows: temperature, edges, and what they have in common."""
    margin = EDGE_S * run.sampling_rate_hz
    beyond = [(0, 0), *gaps, (run.n_samples, run.n_samples)]
    return tuple(
        {
            "run": run.name,
            "axis": channels.axis,
            "segment": index,
            "start": segment.start,
            "stop": segment.stop,
            "sampling_rate_hz": run.sampling_rate_hz,
            "f_max_hz": segment.f_max_hz,
            "direction": segment.direction,
            "variance": segment.variance,
            "edge": segment.kind == "motion" and _is_cut(segment, beyond, margin),
            "kind": segment.kind,
            "signal": signal,
            "temperature_c": _mean_temperature(run, channels, segment),
        }
        for index, segment in enumerate(segments)
    )


def without_odd_warmth(run: Run, channels: AxisChannels, found: AxisSegments) -> AxisSegments:
    """Leave out temperatures that no joint has, as if not logged, and say so."""
    limit = LIMITS["temperature"]
    rows = [
        row if limit.holds(row["temperature_c"]) else row | {"temperature_c": None}
        for row in found.rows
    ]
    n_odd = sum(row is not own for row, own in zip(rows, found.rows, strict=True))
    if not n_odd:
        return found
    note = (
        f"{run.path}: column {channels.columns['temperature']} is {limit.beyond} in {n_odd} of "
        f"{len(rows)} segments, which no joint is, and left out there: {limit.looks_like}?"
    )
    return found._replace(rows=tuple(rows), notes=(*found.notes, note))


def read_variance(run: Run, names: Sequence[str], start: int, stop: int) -> float:
    """Variance of a current over an interval of any length; see `mean_variance`."""
    moments = np.zeros((3, len(names)))
    for block in read_in_pieces(run, names, start, stop):
        moments += _moments([block[name] for name in names])
    return _variance_of(moments)


def mean_variance(currents: Sequence[npt.NDArray[np.floating]]) -> float:
    """Variance of a current, averaged over its phases; equation (3-2). NaN is passed over."""
    return _variance_of(_moments(currents))


def _moments(currents: Sequence[npt.NDArray[np.floating]]) -> npt.NDArray[np.float64]:
    moments = np.zeros((3, len(currents)))
    for i, current in enumerate(currents):
        x = current.astype(np.float64)
        total = float(x.sum())
        if not np.isfinite(total):
            x = x[np.isfinite(x)]
            total = float(x.sum())
        moments[:, i] = x.size, total, x @ x
    return moments


def _variance_of(moments: npt.NDArray[np.float64]) -> float:
    n, first, second = np.maximum(moments[0], 1), moments[1], moments[2]
    return float(np.mean(np.maximum(second / n - (first / n) ** 2, 0)))


def read_in_pieces(
    run: Run, names: Sequence[str], start: int, stop: int
) -> Iterator[dict[str, npt.NDArray[Any]]]:
    """Read an interval of any length in bounded memory."""
    for begin in range(start, stop, ROW_GROUP_SAMPLES):
        yield run.read(names, begin, min(stop, begin + ROW_GROUP_SAMPLES))


def _is_cut(segment: Segment, beyond: Sequence[tuple[int, int]], margin: float) -> bool:
    return any(a - margin < segment.stop and segment.start < b + margin for a, b in beyond)


def _mean_temperature(run: Run, channels: AxisChannels, segment: Segment) -> float | None:
    name = channels.columns.get("temperature")
    if name is None:
        return None
    total, n = 0.0, 0
    for block in read_in_pieces(run, [name], segment.start, segment.stop):
        known = block[name]
        known = known[np.isfinite(known)].astype(np.float64)
        total, n = total + float(known.sum()), n + known.size
    return total / n if n else None
