"""The reference cycle of an axis: found in the segments, or taken from a motion table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.config.models import IdentifyConfig
from opamc_cli.errors import InputError, NotEnoughDataError
from opamc_cli.signal.cycles.alignment import small
from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import UNIDENTIFIED, identify, identify_anywhere
from opamc_cli.signal.cycles.reference import MOSTLY, find_reference
from opamc_cli.signal.motion.reported import fluctuation_frequency
from opamc_cli.stages.chain.cycles.axis import Axis, axes_of, span_at, usable_segments, values_of
from opamc_cli.stages.chain.cycles.leads import with_leads
from opamc_cli.stages.chain.segments.rows import EDGE_S
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.recordings.envelope import read_envelope
from opamc_cli.storage.schemas.tables import MOTIONS
from opamc_cli.storage.sources import RunSource, read_sources
from opamc_cli.storage.tables import read_table

REPEATS = 0.75
"""Share of a recording's motions that a cycle has to find again to be one: noise may hide some."""

MOST_HELD = 16
"""Recordings that a cycle is looked for in."""

SAME_DURATION = 0.1
"""Relative difference of the durations of motions at the edges of recordings that begin and end
with the program; where they cut it anywhere, a motion is as often half as whole."""


@dataclass(frozen=True)
class Reference:
    """The reference cycle of one axis: where its segments are and what they are like.

    `carrier_hz` is what delays are taken from, and `edges` tells whether recordings begin and end
    with the cycle, so that a motion at their edge is whole.
    """

    source: RunSource
    features: SegmentFeatures
    spans: tuple[tuple[int, int], ...]
    carrier_hz: npt.NDArray[np.float64]
    edges: bool


def given_references(
    path: Path, moved_to: Sequence[Path], jobs: int, kept: KeptResults | None
) -> dict[int, Reference]:
    """Take the reference cycles of a motion table.

    Raises
    ------
    NotEnoughDataError
        If it holds none.
    """
    table = read_table(path, "identify", MOTIONS)
    sources = {source.name: source for source in read_sources(path, moved_to)}
    rows = table.filter(table.column("reference"))
    if rows.num_rows == 0:
        msg = f"{path}: holds no reference cycle: {why_untold(table)}"
        raise NotEnoughDataError(msg)
    held = set(zip(rows["run"].to_pylist(), rows["axis"].to_pylist(), strict=True))
    own = [part for part in axes_of(table, sources) if (part.source.name, part.axis) in held]
    references = {}
    for part in with_leads(own, jobs, kept):
        which = np.flatnonzero(values_of(part.rows, "reference"))
        features = part.features.take(which)
        motion = values_of(part.rows, "motion")
        told = motion > UNIDENTIFIED
        same = part.features.take(np.flatnonzero(told)).lead_as(features)
        if np.mean(same[np.arange(len(same)), motion[told]]) < MOSTLY:
            features = features.anywhere()
        references[part.axis] = Reference(
            part.source,
            features,
            tuple(span_at(part.rows, i) for i in which.tolist()),
            values_of(part.rows, "reference_f_max_hz")[which],
            bool(values_of(part.rows, "edge")[which].any()),
        )
    return references


def why_untold(motions: pa.Table) -> str:
    """Say why no motion of a motion table is told, and what to do."""
    if not motions.num_rows:
        return "no motion was found; see `opamc segment`"
    edge, start, stop, rate = (
        np.asarray(motions[name]) for name in ("edge", "start", "stop", "sampling_rate_hz")
    )
    if not edge.all():
        return (
            "no motion repeats; record at least two cycles of the baseline, or set "
            "identify.segments_per_cycle"
        )
    lasting = (stop - start) / rate
    least, most = float(lasting.min()), float(lasting.max())
    unlike = (
        f", and they last {least:.2g} to {most:.2g} s" if most > least * (1 + SAME_DURATION) else ""
    )
    return (
        f"no motion repeats: each begins or ends within {EDGE_S:g} s of its recording's edge, "
        f"which may have cut it{unlike}; record at least two cycles, or more rest before and after"
        + (", or leave out those of another speed or load" if unlike else "")
    )


def own_references(
    path: Path,
    parts: Sequence[Axis],
    rule: MatchRule,
    config: IdentifyConfig,
    reference_run: str | None,
) -> dict[int, Reference]:
    """Find the reference cycle of each axis: most runs hold it, and its own repeats it most.

    What most runs hold comes first: one recording of another program or robot that repeats more
    often would leave all others without a motion.

    Raises
    ------
    InputError
        If there is no run of the name that was asked for.
    """
    if reference_run is not None and all(p.source.name != reference_run for p in parts):
        names = ", ".join(sorted({p.source.name for p in parts}))
        msg = f"{path}: has no run {reference_run!r} to take the reference from; it has {names}"
        raise InputError(msg)
    executions = {
        axis: _executions([part for part in parts if part.axis == axis], rule)
        for axis in {part.axis for part in parts}
    }
    best: dict[int, tuple[tuple[bool, int, int], Reference]] = {}
    for part in parts:
        if reference_run not in (None, part.source.name):
            continue
        edges = executions[part.axis]
        usable = usable_segments(part, edges)
        usable = usable[np.isfinite(part.features.duration_s[usable])]
        if usable.size == 0:
            continue
        features = part.features.take(usable)
        if part.rows.column("kind")[0].as_py() == "window":
            start, stop = 0, 1
        else:
            start, stop = find_reference(features, rule, config.segments_per_cycle)
        cycle = features.part(start, stop)
        found = identify(cycle, features, rule).cycle
        count = int(found.max(initial=-1)) + 1
        repeats = count > 1 and np.mean(found[~small(features, cycle)] >= 0) >= REPEATS
        if edges and not repeats and config.segments_per_cycle is None:
            start, stop, cycle, count = 0, len(features), features, 1
        # one recording may be odd, or show nothing twice: others tell whether it is the program
        others = [p for p in parts if p.axis == part.axis][:MOST_HELD]
        if part.axis in best and (True, count, len(others)) <= best[part.axis][0]:
            continue
        holders = sum(_holds(other, cycle, rule) for other in others)
        worth = 2 * holders > len(others), count, holders
        if part.axis not in best or worth > best[part.axis][0]:
            spans = tuple(span_at(part.rows, i) for i in usable[start:stop].tolist())
            best[part.axis] = (
                worth,
                Reference(part.source, cycle, spans, cycle.f_max_hz, edges),
            )
    return {
        axis: _without_chance(reference, [part for part in parts if part.axis == axis], rule)
        for axis, (_, reference) in best.items()
    }


def _without_chance(reference: Reference, parts: Sequence[Axis], rule: MatchRule) -> Reference:
    """Leave out small segments that are not in every cycle: they would be compared by chance."""
    cycle = reference.features
    doubtful = small(cycle, cycle)
    if not doubtful.any():
        return reference
    always = np.ones(len(cycle), dtype=bool)
    for part in parts:
        found = identify_anywhere(
            cycle, part.features.take(usable_segments(part, reference.edges)), rule
        )
        n_cycles = found.cycle.max(initial=UNIDENTIFIED) + 1
        always &= np.bincount(found.motion + 1, minlength=len(cycle) + 1)[1:] >= n_cycles
    kept = np.flatnonzero(always | ~doubtful)
    rest = replace(
        reference,
        features=cycle.take(kept),
        spans=tuple(reference.spans[i] for i in kept),
        carrier_hz=reference.carrier_hz[kept],
    )
    # where both halves of a program are alike, only what is small may tell them apart
    [own] = [part for part in parts if part.source == reference.source]
    usable = usable_segments(own, reference.edges)
    motion = identify_anywhere(rest.features, own.features.take(usable), rule).motion
    places = [span_at(own.rows, i) for i in usable.tolist()]
    found_again = [m == motion[places.index(span)] for m, span in enumerate(rest.spans)]
    return rest if all(found_again) else reference


def _holds(part: Axis, cycle: SegmentFeatures, rule: MatchRule) -> bool:
    own = part.features.take(usable_segments(part, False))
    return bool((identify_anywhere(cycle, own, rule).cycle > UNIDENTIFIED).any())


def _executions(parts: Sequence[Axis], rule: MatchRule) -> bool:
    """Tell whether every recording holds the same motions from its beginning to its end.

    Then each is one execution of the program or several whole ones, and what touches its edge has
    not been cut by it.
    """
    if len(parts) < 2 or parts[0].rows.column("kind")[0].as_py() == "window":
        return False
    first = parts[0].features
    at_edge = values_of(parts[0].rows, "edge").astype(bool)
    # at an edge a small segment is the beginning of a motion that is cut
    asked = ~small(first, first) | at_edge
    for part in parts[1:]:
        own = part.features
        found = identify(first, own, rule)
        told = found.motion > UNIDENTIFIED
        there = np.zeros(len(first), dtype=bool)
        there[found.motion[told]] = True
        known = told | (small(own, first) & ~values_of(part.rows, "edge").astype(bool))
        if found.cycle.max() > 0 or not known.all() or not there[asked].all():
            return False
        of_edge = told & at_edge[found.motion]
        ratio = own.duration_s[of_edge] / first.duration_s[found.motion[of_edge]]
        if (np.abs(ratio - 1) > SAME_DURATION).any():
            return False
    return True


def with_carrier(reference: Reference, axis: int, config: Config) -> Reference:
    """Let the current's own fluctuations tell the delay where nothing else does."""
    with reference.source.open() as run:
        if run.channels(axis).phases or config.joint.ratio_of(axis) is not None:
            return reference
        wanted = config.patterns.envelope
        found = [
            fluctuation_frequency(read_envelope(run, axis, *span, wanted), run.sampling_rate_hz)
            for span in reference.spans
        ]
    # one delay for all motions: of short ones the fluctuations are known badly
    return replace(reference, carrier_hz=np.full(len(found), float(np.median(found))))
