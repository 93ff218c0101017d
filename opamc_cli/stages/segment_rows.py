"""Rows of the segment table, and what is told of the axis beside them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from opamc_cli.storage.runs import ROW_GROUP_SAMPLES, AxisChannels, Run

EDGE_S = 0.05
"""A motion that begins or ends this near to the recording's edge may have been cut by it."""


@dataclass(frozen=True)
class Segment:
    """One segment of an axis; see the schema of the segment table."""

    start: int
    stop: int
    f_max_hz: float
    direction: int
    kind: str = "motion"


@dataclass(frozen=True)
class AxisSegments:
    """What was found on one axis of one run.

    Attributes
    ----------
    run
        Name of the run.
    rows
        Rows of the segment table.
    notes
        One sentence for each doubtful channel.
    stands
        Why there is no row, or None.
    """

    run: str
    rows: tuple[dict[str, Any], ...]
    notes: tuple[str, ...] = ()
    stands: str | None = None


def make_rows(
    run: Run,
    channels: AxisChannels,
    segments: Sequence[Segment],
    currents: Sequence[str],
    signal: str,
) -> tuple[dict[str, Any], ...]:
    """Complete segments to rows: variance of the current, temperature, edges."""
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
            "variance": variance(run, currents, segment.start, segment.stop),
            "edge": segment.kind == "motion" and _touches_edge(run, segment),
            "kind": segment.kind,
            "signal": signal,
            "temperature_c": _mean_temperature(run, channels, segment),
        }
        for index, segment in enumerate(segments)
    )


def variance(run: Run, names: Sequence[str], start: int, stop: int) -> float:
    """Variance of a current over an interval, averaged over its phases; equation (3-2)."""
    n = np.zeros(len(names))
    first = np.zeros(len(names))
    second = np.zeros(len(names))
    for block in read_in_pieces(run, names, start, stop):
        for i, name in enumerate(names):
            x = block[name][np.isfinite(block[name])].astype(np.float64)
            n[i] += x.size
            first[i] += x.sum()
            second[i] += x @ x
    n = np.maximum(n, 1)
    return float(np.mean(np.maximum(second / n - (first / n) ** 2, 0)))


def read_in_pieces(
    run: Run, names: Sequence[str], start: int, stop: int
) -> Iterator[dict[str, npt.NDArray[Any]]]:
    """Read an interval of any length in bounded memory."""
    for begin in range(start, stop, ROW_GROUP_SAMPLES):
        yield run.read(names, begin, min(stop, begin + ROW_GROUP_SAMPLES))


def _touches_edge(run: Run, segment: Segment) -> bool:
    margin = EDGE_S * run.sampling_rate_hz
    return segment.start < margin or segment.stop > run.n_samples - margin


def _mean_temperature(run: Run, channels: AxisChannels, segment: Segment) -> float | None:
    if channels.temperature is None:
        return None
    total, n = 0.0, 0
    for block in read_in_pieces(run, [channels.temperature], segment.start, segment.stop):
        known = block[channels.temperature]
        known = known[np.isfinite(known)].astype(np.float64)
        total, n = total + float(known.sum()), n + known.size
    return total / n if n else None
