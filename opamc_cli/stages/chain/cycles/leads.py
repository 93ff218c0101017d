"""Where segments lead: their places where a position is logged, else how far they turn."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.cycles.features import SegmentFeatures
from opamc_cli.signal.motion.rotation import turning_parts
from opamc_cli.signal.offset import TURNS_AT_TOP_SPEED
from opamc_cli.stages.chain.cycles.axis import (
    Axis,
    span_at,
    values_of,
)
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.processes.parallel import map_items, unwatched
from opamc_cli.stages.recordings.envelope import (
    current_offset,
    read_current,
)
from opamc_cli.storage.runs.run import Run


def with_leads(parts: Sequence[Axis], jobs: int, kept: KeptResults | None) -> list[Axis]:
    """Add where each segment leads: its places where they are logged, else how far it turns."""
    found = map_items(remembered(_leads, kept), parts, jobs, unwatched)
    if found.errors:  # which the identification meets again, and tells
        return list(parts)
    return [
        replace(part, features=_leading(part.features, **leads))
        for part, leads in zip(parts, found.results, strict=True)
    ]


def _leading(
    features: SegmentFeatures,
    places_rad: npt.NDArray[np.float64] | None = None,
    turns: npt.NDArray[np.float64] | None = None,
) -> SegmentFeatures:
    return replace(features, places_rad=places_rad, turns=turns)


def _leads(part: Axis) -> dict[str, npt.NDArray[np.float64]]:
    """Read what `SegmentFeatures` knows of where segments lead; empty where nothing tells."""
    if part.rows["kind"][0].as_py() == "window":
        return {}
    with part.source.open() as run:
        channels = run.channels(part.axis)
        if channels.position is not None:
            return {"places_rad": _places(run, part, channels.position)}
        by_carrier = part.rows["signal"].unique().to_pylist() == ["phases"]
        turn = by_carrier and len(channels.phases) == 3
        return {"turns": _turns(run, part)} if turn else {}


def _places(run: Run, part: Axis, column: str) -> npt.NDArray[np.float64]:
    """Read where an axis is at each segment's start and stop, (n, 2), rad."""
    asked = np.column_stack([values_of(part.rows, "start"), values_of(part.rows, "stop") - 1])
    places = np.full(asked.shape, np.nan)
    for start, block in run.blocks([column]):
        values = block[column]
        here = (asked >= start) & (asked < start + values.size)
        places[here] = values[asked[here] - start]
    return places


def _turns(run: Run, part: Axis) -> npt.NDArray[np.float64]:
    """Read how far the current vector of an axis turns in each segment, (n,)."""
    f_max_hz = part.features.f_max_hz
    motions = [(*span_at(part.rows, i), hz) for i, hz in enumerate(f_max_hz.tolist())]
    often = [motions[i] for i in np.flatnonzero(part.features.way >= TURNS_AT_TOP_SPEED)]
    offset = current_offset(run, part.axis, often, "clarke")
    turns = np.zeros(len(motions))
    for i in np.flatnonzero(f_max_hz > 0).tolist():
        start, stop, hz = motions[i]
        vector = read_current(run, part.axis, start, stop, "clarke") - offset
        turns[i] = turning_parts(vector, hz, run.sampling_rate_hz)[1].sum()
    return turns
