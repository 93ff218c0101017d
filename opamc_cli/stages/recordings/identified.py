"""The identified segments of runs, and the course of the current over each."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config.models import PatternsConfig
from opamc_cli.signal.offset import TURNS_AT_TOP_SPEED
from opamc_cli.stages.recordings.envelope import current_offset, read_current
from opamc_cli.storage.sources import RunSource


@dataclass(frozen=True)
class IdentifiedPart:
    """The identified segments of one axis of one run."""

    source: RunSource
    """Where their samples are."""
    axis: int
    """Counted from 1."""
    rows: tuple[dict[str, Any], ...]
    """Rows of the motion table, in its order."""

    def courses(
        self, config: PatternsConfig
    ) -> Iterator[tuple[dict[str, Any], npt.NDArray[Any], bool]]:
        """Yield what is counted, segment by segment.

        Yields
        ------
        row
            Of the motion table, with the ends of the aligned segment.
        current
            Its vector, or the signed reported current, A, see `read_current`; the sensors' offset
            is taken off if that is wanted.
        whole
            Whether the recording holds all of it.
        """
        spans = [aligned_span(row) for row in self.rows]
        with self.source.open() as run:
            offset = 0j
            if config.remove_offset:
                offset = current_offset(run, self.axis, turning_motions(self.rows), config.envelope)
            for row, (start, stop) in zip(self.rows, spans, strict=True):
                current = read_current(run, self.axis, start, stop, config.envelope)
                current = current - current.dtype.type(offset) if offset else current
                # a current without bound is a fault of the logger, not a rank
                current = np.where(np.isinf(current), np.nan, current)
                place = {**row, "start": start, "stop": min(stop, run.n_samples)}
                yield place, current, stop <= run.n_samples


def identified_parts(motions: pa.Table, sources: Sequence[RunSource]) -> list[IdentifiedPart]:
    """Group the identified segments of a motion table by run and axis.

    Raises
    ------
    InputError
        If a run that is needed is gone or has changed.
    """
    by_name = {source.name: source for source in sources}
    rows_of: dict[tuple[str, int], list[dict[str, Any]]] = {}
    for row in motions.to_pylist():
        if row["motion"] >= 0:
            rows_of.setdefault((row["run"], row["axis"]), []).append(row)
    for name in dict.fromkeys(name for name, _ in rows_of):
        by_name[name].verify()
    return [
        IdentifiedPart(by_name[name], axis, tuple(rows)) for (name, axis), rows in rows_of.items()
    ]


def aligned_span(row: dict[str, Any]) -> tuple[int, int]:
    """Return the samples of a segment that correspond to its reference segment's.

    The segment's own ends are where a threshold was crossed; synchronised with the reference
    and of its length, every cycle is cut at the same places of the motion (thesis 4.1.1).
    """
    if row["kind"] == "window":
        return row["start"], row["stop"]
    start = max(row["start"] + row["lag"], 0)
    return start, start + row["reference_samples"]


def turning_motions(rows: Sequence[dict[str, Any]]) -> list[tuple[int, int, float]]:
    """Return the segments in which the current vector turns so often that its mean is an offset.

    Start, stop and highest frequency, Hz, of each. The reference segment tells, so that all
    recordings that are compared agree.
    """
    return [
        (*aligned_span(row), row["reference_f_max_hz"])
        for row in rows
        if row["reference_f_max_hz"] * row["reference_samples"]
        >= TURNS_AT_TOP_SPEED * row["sampling_rate_hz"]
    ]
