"""Synchronise identified segments with those of the reference cycle."""

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from opamc_cli.signal.align import align
from opamc_cli.signal.cycles.identification import UNIDENTIFIED
from opamc_cli.signal.motion.reported import unwrapped
from opamc_cli.signal.motion.rotation import turned
from opamc_cli.stages.chain.cycles.axis import Axis
from opamc_cli.stages.chain.cycles.reference import Reference
from opamc_cli.stages.recordings.envelope import (
    EnvelopeKind,
    read_course,
    read_current,
)
from opamc_cli.storage.runs.run import Run

MIN_CORRELATION = 0.5
"""Below this the correlation peak says nothing of time, and the segment's own start is kept."""


def lags_to(
    reference: Reference,
    part: Axis,
    motion: npt.NDArray[np.int64],
    spans: Sequence[tuple[int, int]],
    max_lag_s: float,
    envelope: EnvelopeKind,
) -> npt.NDArray[np.int64]:
    """Synchronise identified segments of an axis with the reference segments of their motions.

    Parameters
    ----------
    motion, spans
        Of each segment: its motion, and its first sample and the one behind its last.
    max_lag_s
        Most that it is moved by.
    envelope
        What is synchronised where neither a log nor a turning current vector tells the motion.

    Returns
    -------
    numpy.ndarray
        Samples, (n,); 0 where the courses are not alike.
    """
    lags = np.zeros(len(spans), dtype=np.int64)
    with part.source.open() as run, reference.source.open() as reference_run:
        max_lag = round(max_lag_s * run.sampling_rate_hz)
        read = _reader(part, envelope, reference_run, run)
        carriers = reference.carrier_hz.tolist()
        courses = [
            read(reference_run, *span, hz)
            for span, hz in zip(reference.spans, carriers, strict=True)
        ]
        for i, (m, span) in enumerate(zip(motion.tolist(), spans, strict=True)):
            own = part.source == reference.source and span == reference.spans[m]
            if m == UNIDENTIFIED or own:
                continue
            found = align(courses[m], read(run, *span, carriers[m]), max_lag)
            if found.correlation >= MIN_CORRELATION:
                lags[i] = found.lag
    return lags


def _reader(
    part: Axis, envelope: EnvelopeKind, *runs: Run
) -> Callable[[Run, int, int, float], npt.NDArray[np.floating]]:
    """Say what segments are synchronised by: read from first to last sample, of a carrier in Hz.

    Where the joint's motion told the segments it does: friction and play move the course of a
    current in time, by more the further a night is from the others (15 degrees warmer, a joint's
    phases by 0.16 s). Phases tell it by how far their vector has turned.
    """
    axis = part.axis
    signals = part.rows["signal"].unique().to_pylist()
    if "reported" in signals:
        for kind in ("position", "velocity"):
            columns = {getattr(run.channels(axis), kind) for run in runs}
            if len(columns) == 1 and None not in columns:
                [column] = columns
                as_moved = unwrapped if kind == "position" else np.asarray
                return lambda run, start, stop, _: as_moved(run.read([column], start, stop)[column])
    if signals == ["phases"] and all(len(run.channels(axis).phases) == 3 for run in runs):
        return lambda run, start, stop, hz: turned(
            read_current(run, axis, start, stop, "clarke"), hz, run.sampling_rate_hz
        )
    return lambda run, start, stop, _: read_course(run, axis, start, stop, envelope)
