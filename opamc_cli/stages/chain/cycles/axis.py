"""The segments of one axis of one run, and what they are identified by."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config.models import IdentifyConfig
from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.storage.sources import RunSource


@dataclass(frozen=True)
class Axis:
    """The segments of one axis of one run."""

    source: RunSource
    axis: int
    rows: pa.Table
    features: SegmentFeatures


def match_rule(config: IdentifyConfig) -> MatchRule:
    """Return the rule that the configuration states."""
    return MatchRule(
        min_similarity=config.min_similarity,
        duration_tolerance=config.duration_tolerance,
        f_max_tolerance=config.f_max_tolerance,
        use_direction=config.use_direction,
    )


def axes_of(table: pa.Table, sources: dict[str, RunSource]) -> Iterator[Axis]:
    """Cut a segment table into the series of each axis of each run, in the table's order."""
    names = table.column("run").to_pylist()
    axes = table.column("axis").to_pylist()
    keys = list(zip(names, axes, strict=True))
    for key in dict.fromkeys(keys):
        rows = table.take([i for i, other in enumerate(keys) if other == key])
        yield Axis(sources[key[0]], key[1], rows, segment_features(rows))


def segment_features(rows: pa.Table) -> SegmentFeatures:
    """Return what segments of one axis of one run are identified by, in the table's order."""
    start = values_of(rows, "start")
    stop = values_of(rows, "stop")
    rate = values_of(rows, "sampling_rate_hz")
    pause = np.full(len(start), np.nan)
    pause[1:] = (start[1:] - stop[:-1]) / rate[1:]
    duration_s = (stop - start) / rate
    # How long it lasts that a gap has cut is not known: it stays, and no cycle reaches across it.
    inner = slice(1, -1)
    duration_s[inner][values_of(rows, "edge")[inner].astype(bool)] = np.nan
    return SegmentFeatures(
        variance=values_of(rows, "variance").astype(np.float64),
        duration_s=duration_s,
        f_max_hz=values_of(rows, "f_max_hz"),
        direction=values_of(rows, "direction").astype(np.int64),
        pause_s=pause,
    )


def values_of(rows: pa.Table, name: str) -> npt.NDArray[Any]:
    """Return a column of a table."""
    return np.asarray(rows.column(name).to_numpy())


def span_at(rows: pa.Table, index: int) -> tuple[int, int]:
    """Return the first sample of a row's segment, and the one behind its last."""
    return rows.column("start")[index].as_py(), rows.column("stop")[index].as_py()


def whole_segments(part: Axis) -> npt.NDArray[np.int64]:
    """Return the indices of the segments that no edge of the recording and no gap has cut."""
    return np.flatnonzero(~values_of(part.rows, "edge").astype(bool))


def usable_segments(part: Axis, executions: bool) -> npt.NDArray[np.int64]:
    """Return the indices of the segments in which cycles are looked for.

    The recording's edges have cut none of them, unless each is an execution of the program.
    """
    cut = values_of(part.rows, "edge").astype(bool)
    cut[1:-1] = False
    return np.arange(cut.size) if executions else np.flatnonzero(~cut)
