"""Stage `identify`: segments in, cycles and motions out (thesis 3.3 and 4.1.1)."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from opamc_cli.config import Config
from opamc_cli.config.models import IdentifyConfig
from opamc_cli.errors import InputError, NotEnoughDataError, OpamcError
from opamc_cli.signal.align import align
from opamc_cli.signal.cycles.alignment import small
from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import (
    UNIDENTIFIED,
    Identification,
    fits_shifted,
    identify,
    identify_anywhere,
    with_cut_cycles,
)
from opamc_cli.signal.cycles.reference import MOSTLY, find_reference
from opamc_cli.signal.motion.reported import fluctuation_frequency, unwrapped
from opamc_cli.signal.motion.rotation import turning_parts
from opamc_cli.signal.offset import TURNS_AT_TOP_SPEED
from opamc_cli.stages.chain.compared.speeds import (
    OTHER_SPEEDS,
    TWO_SPEEDS,
    odd_cycles,
    odd_speeds,
)
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.processes.parallel import Watch, map_items, unwatched
from opamc_cli.stages.recordings.envelope import (
    EnvelopeKind,
    current_offset,
    read_course,
    read_current,
    read_envelope,
)
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.channels import same_clock
from opamc_cli.storage.schemas.tables import MOTIONS, SEGMENTS
from opamc_cli.storage.sources import RunSource, read_sources, sources_record
from opamc_cli.storage.tables import read_table, record_at, table_input, write_table

MIN_CORRELATION = 0.5
"""Below this the correlation peak says nothing of time, and the segment's own start is kept."""

REPEATS = 0.75
"""Share of a recording's motions that a cycle has to find again to be one: noise may hide some."""

MOST_HELD = 16
"""Recordings that a cycle is looked for in."""

AT_PLACES = 0.5
"""Of the segments that are told wherever they lead, which have to lead to their places: of a long
cycle, such as a pallet's, both ends of a recording hold a part. Else the program goes elsewhere
each time, as one does that a camera guides."""

APART = 5.0
"""Times what nine in ten of a motion's turns deviate from its middle by, by which motions that are
told as one have to differ: noise alone makes that 0.6 to 5.7 in groups of two (1.9 in the middle of
300 made-up recordings), a pallet 12 to 30."""

SAME_DURATION = 0.1
"""Relative difference of the durations of motions at the edges of recordings that begin and end
with the program; where they cut it anywhere, a motion is as often half as whole."""


@dataclass(frozen=True)
class IdentifyOutcome:
    """What `run` did."""

    path: Path
    """The table that was written."""
    table: pa.Table
    """Its rows."""
    errors: tuple[OpamcError, ...]
    """One for each axis of a run that could not be read."""
    notes: tuple[str, ...]
    """One for each axis of which only the motion told the cycles, or that moves elsewhere."""
    other_speeds: Mapping[str, float]
    """What `odd_speeds` found: runs that are left out for their speed."""

    def cycles(self) -> dict[tuple[str, int], tuple[int, int]]:
        """Return the numbers of cycles and of unidentified segments by (run, axis)."""
        counts: dict[tuple[str, int], tuple[int, int]] = {}
        for row in self.table.select(["run", "axis", "cycle"]).to_pylist():
            key = (row["run"], row["axis"])
            cycles, unidentified = counts.get(key, (0, 0))
            counts[key] = (
                max(cycles, row["cycle"] + 1),
                unidentified + (row["cycle"] == UNIDENTIFIED),
            )
        return counts


@dataclass(frozen=True)
class _Axis:
    """The segments of one axis of one run."""

    source: RunSource
    axis: int
    rows: pa.Table
    features: SegmentFeatures


@dataclass(frozen=True)
class _Reference:
    """The reference cycle of one axis: where its segments are and what they are like.

    `carrier_hz` is what delays are taken from, and `edges` tells whether recordings begin and end
    with the cycle, so that a motion at their edge is whole.
    """

    source: RunSource
    features: SegmentFeatures
    spans: tuple[tuple[int, int], ...]
    carrier_hz: npt.NDArray[np.float64]
    edges: bool


@dataclass(frozen=True)
class _Job:
    """One axis of one run with the reference that it is identified by."""

    part: _Axis
    reference: _Reference | None
    config: IdentifyConfig
    envelope: EnvelopeKind
    judged: bool
    """Whether the reference is of other runs, so that the current may be a faulty joint's."""


def run(
    segments: Path,
    config: Config,
    out: Path,
    *,
    reference: Path | None = None,
    reference_run: str | None = None,
    moved_to: Sequence[Path] = (),
    without: Collection[tuple[str, int]] = (),
    jobs: int = 1,
    watch: Watch = unwatched,
    kept: KeptResults | None = None,
) -> IdentifyOutcome:
    """Identify the cycles and motions of a segment table.

    Parameters
    ----------
    segments
        Table of stage `segment`.
    config
        Sections `identify` and `patterns.envelope` are used.
    out
        Folder of the motion table.
    reference
        Motion table whose reference cycles are taken; None: found in these segments.
    reference_run
        Name of the run in which the reference cycle is looked for; None: of the runs with the
        most repetitions the one whose cycle most runs hold.
    moved_to
        Folders of the runs, if they were moved.
    without
        Run and axis of segments that are left out.
    jobs, watch, kept
        As of `segment.run`.

    Raises
    ------
    InputError
        If a table or run cannot be used.
    """
    table = read_table(segments, "segment", SEGMENTS)
    sources = {source.name: source for source in read_sources(segments, moved_to)}
    rule = match_rule(config.identify)
    parts = [p for p in _parts(table, sources) if (p.source.name, p.axis) not in without]
    parts = _with_leads(parts, jobs, kept)
    if reference is not None:
        references = _given_references(reference, moved_to, jobs, kept)
    else:

        def found_in(axes: Sequence[_Axis]) -> dict[int, _Reference]:
            return _own_references(segments, axes, rule, config.identify, reference_run)

        references = {
            axis: _with_carrier(found, axis, config)
            for axis, found in _references_of_places(parts, found_in, rule).items()
        }
    work = [
        _Job(
            part,
            references.get(part.axis),
            config.identify,
            config.patterns.envelope,
            judged=reference is not None,
        )
        for part in parts
    ]
    for source in {part.source for part in parts} | {r.source for r in references.values()}:
        source.verify()
    outcome = map_items(remembered(_identify_part, kept), work, jobs, watch)
    if outcome.errors and not outcome.results:
        raise outcome.errors[0]
    motions = pa.concat_tables([MOTIONS.empty_table(), *outcome.results]).combine_chunks()
    known = motions if reference is None else read_table(reference, "identify", MOTIONS)
    other_speeds = odd_speeds(motions, known, config.identify.speed_tolerance)
    slower = pa.array(sorted(other_speeds), pa.string())
    motions = _without_cycles(motions, pc.is_in(motions["run"], slower))
    midway = odd_cycles(motions)
    motions = _without_cycles(motions, _of_cycles(motions, midway))
    errors = (*outcome.errors, *_of_two_speeds(midway, sources))
    inputs = [table_input(segments)] + ([table_input(reference)] if reference else [])
    path = out / files.MOTIONS
    write_table(
        path,
        motions,
        stage="identify",
        config={
            **config.canonical("identify"),
            "patterns": {"envelope": config.patterns.envelope},
            "reference_run": reference_run,
            "segment": record_at(segments)["config"].get("segment", {}),
        },
        inputs=inputs,
        extra=sources_record(list(sources.values()), out)
        | {OTHER_SPEEDS: other_speeds, TWO_SPEEDS: sorted({run for run, _ in midway})},
    )
    notes = (*_unlike(motions, rule), *_elsewhere(motions, parts, references))
    return IdentifyOutcome(path, motions, errors, notes, other_speeds)


def _of_cycles(motions: pa.Table, odd: Mapping[tuple[str, int], Mapping[int, float]]) -> pa.Array:
    """Tell which rows are of some cycles, by run and axis."""
    rows = motions.select(["run", "axis", "cycle"]).to_pylist()
    return pa.array([r["cycle"] in odd.get((r["run"], r["axis"]), ()) for r in rows], pa.bool_())


def _of_two_speeds(
    odd: Mapping[tuple[str, int], Mapping[int, float]],
    sources: Mapping[str, RunSource],
) -> list[OpamcError]:
    """Say of which recordings the speed was changed midway."""
    return [
        InputError(
            f"{sources[run].path}: {len(cycles)} cycle{'s' * (len(cycles) > 1)} of axis {axis} "
            f"last{'s' * (len(cycles) == 1)} {median(cycles.values()):.2f} times as long as the "
            "others and are not compared: was the speed changed midway?"
        )
        for (run, axis), cycles in odd.items()
    ]


def _without_cycles(motions: pa.Table, left: pa.ChunkedArray | pa.Array) -> pa.Table:
    """Take cycles and motions off some rows' segments."""
    for name in ("cycle", "motion"):
        kept = pc.if_else(left, pa.scalar(UNIDENTIFIED, MOTIONS.field(name).type), motions[name])
        motions = motions.set_column(motions.schema.get_field_index(name), name, kept)
    return motions.cast(MOTIONS)


def _unlike(motions: pa.Table, rule: MatchRule) -> list[str]:
    """Say of which axes the current is so odd that only the motion told the cycles."""
    least: dict[int, float] = {}
    for row in motions.select(["axis", "cycle", "similarity"]).to_pylist():
        if row["cycle"] != UNIDENTIFIED and row["similarity"] < rule.min_similarity:
            least[row["axis"]] = min(row["similarity"], least.get(row["axis"], 1.0))
    return [
        f"axis {axis}: its currents are like the reference cycle's by {similarity:.2g} only "
        f"({rule.min_similarity:.2g} asked); the motions were told by duration, speed and direction"
        for axis, similarity in sorted(least.items())
    ]


def _elsewhere(
    motions: pa.Table, parts: Sequence[_Axis], references: Mapping[int, _Reference]
) -> Iterator[str]:
    """Say of which recordings the motions lead elsewhere than those of the reference cycle."""
    runs, axes, numbers = (np.asarray(motions[name]) for name in ("run", "axis", "motion"))
    for part in parts:
        reference = references.get(part.axis)
        if reference is None or reference.features.places_rad is None:
            continue
        motion = numbers[(runs == part.source.name) & (axes == part.axis)]
        told = np.flatnonzero(motion > UNIDENTIFIED)
        same = part.features.take(told).lead_as(reference.features)
        if told.size and np.mean(same[np.arange(told.size), motion[told]]) < MOSTLY:
            yield (
                f"{part.source.path}: the motions of axis {part.axis} lead elsewhere than the "
                "reference's and were told by duration, speed and direction: was the program "
                "edited, or the position's zero set anew?"
            )


def match_rule(config: IdentifyConfig) -> MatchRule:
    """Return the rule that the configuration states."""
    return MatchRule(
        min_similarity=config.min_similarity,
        duration_tolerance=config.duration_tolerance,
        f_max_tolerance=config.f_max_tolerance,
        use_direction=config.use_direction,
    )


def _parts(table: pa.Table, sources: dict[str, RunSource]) -> Iterator[_Axis]:
    """Cut a segment table into the series of each axis of each run, in the table's order."""
    names = table.column("run").to_pylist()
    axes = table.column("axis").to_pylist()
    keys = list(zip(names, axes, strict=True))
    for key in dict.fromkeys(keys):
        rows = table.take([i for i, other in enumerate(keys) if other == key])
        yield _Axis(sources[key[0]], key[1], rows, segment_features(rows))


def segment_features(rows: pa.Table) -> SegmentFeatures:
    """Return what segments of one axis of one run are identified by, in the table's order."""
    start = _column(rows, "start")
    stop = _column(rows, "stop")
    rate = _column(rows, "sampling_rate_hz")
    pause = np.full(len(start), np.nan)
    pause[1:] = (start[1:] - stop[:-1]) / rate[1:]
    return SegmentFeatures(
        variance=_column(rows, "variance").astype(np.float64),
        duration_s=(stop - start) / rate,
        f_max_hz=_column(rows, "f_max_hz"),
        direction=_column(rows, "direction").astype(np.int64),
        pause_s=pause,
    )


def _column(rows: pa.Table, name: str) -> npt.NDArray[Any]:
    return np.asarray(rows.column(name).to_numpy())


def _whole(part: _Axis) -> npt.NDArray[np.int64]:
    """Return the indices of the segments that no edge of the recording has cut."""
    return np.flatnonzero(~_column(part.rows, "edge").astype(bool))


def _references_of_places(
    parts: Sequence[_Axis],
    found_in: Callable[[Sequence[_Axis]], dict[int, _Reference]],
    rule: MatchRule,
) -> dict[int, _Reference]:
    """Find reference cycles whose motions lead to their places, but where the program's do not."""
    anywhere = [replace(part, features=part.features.anywhere()) for part in parts]
    loose = found_in(anywhere)
    if not any(part.features.leads_by for part in parts):
        return loose
    strict = found_in(parts)
    for axis, reference in loose.items():
        of_axis = [pair for pair in zip(anywhere, parts, strict=True) if pair[1].axis == axis]
        told = [_told(bare, reference, rule) for bare, _ in of_axis]
        led = [_told(part, strict[axis], rule) for _, part in of_axis]
        known, kept = (sum(int(np.count_nonzero(t >= 0)) for t in each) for each in (told, led))
        if kept < AT_PLACES * known:
            continue
        if strict[axis].features.leads_by == "turns":
            whole = [_whole(part) for _, part in of_axis]
            turns = [part.features.turns for _, part in of_axis]
            if not _mixes(*(_joined(each, whole) for each in (turns, told, led))):
                continue
        loose[axis] = strict[axis]
    return loose


def _joined(
    values: Sequence[npt.NDArray[Any] | None], which: Sequence[npt.NDArray[np.int64]]
) -> npt.NDArray[Any]:
    return np.concatenate([np.asarray(of)[i] for of, i in zip(values, which, strict=True)])


def _mixes(
    turns: npt.NDArray[np.float64], told: npt.NDArray[np.int64], led: npt.NDArray[np.int64]
) -> bool:
    """Tell whether segments are told as one motion that turn by other amounts, each time again.

    Turns, unlike places, scatter where noise hides the current: by others than a motion's own
    repetitions do, or it is no other motion.

    Parameters
    ----------
    turns
        Of each segment.
    told, led
        Which motion it is of a cycle that was found without its turns, and with them.
    """
    both = (told > UNIDENTIFIED) & (led > UNIDENTIFIED)
    turns, told, led = turns[both], told[both], led[both]
    motions, of, count = np.unique(led, return_inverse=True, return_counts=True)
    middle = np.array([np.median(turns[led == motion]) for motion in motions])
    again = count[of] > 1
    if not again.any():
        return False
    own = float(np.quantile(np.abs(turns - middle[of])[again], MOSTLY))
    apart = max(float(np.ptp(middle[np.unique(of[told == one])])) for one in np.unique(told))
    return apart > APART * own


def _told(part: _Axis, reference: _Reference, rule: MatchRule) -> npt.NDArray[np.int64]:
    """Return which motion of a reference each segment of an axis is."""
    told, usable = np.full(len(part.features), UNIDENTIFIED), _usable(part, reference)
    own = part.features.take(usable)
    told[usable] = identify_anywhere(reference.features, own, rule).motion
    return told


def _own_references(
    path: Path,
    parts: Sequence[_Axis],
    rule: MatchRule,
    config: IdentifyConfig,
    reference_run: str | None,
) -> dict[int, _Reference]:
    """Find the reference cycle of each axis: most runs hold it, and its own repeats it most.

    What most runs hold comes first: one recording of another program or robot that repeats more
    often would leave all others without a motion.
    """
    if reference_run is not None and all(p.source.name != reference_run for p in parts):
        names = ", ".join(sorted({p.source.name for p in parts}))
        msg = f"{path}: has no run {reference_run!r} to take the reference from; it has {names}"
        raise InputError(msg)
    executions = {
        axis: _executions([part for part in parts if part.axis == axis], rule)
        for axis in {part.axis for part in parts}
    }
    best: dict[int, tuple[tuple[bool, int, int], _Reference]] = {}
    for part in parts:
        if reference_run not in (None, part.source.name):
            continue
        edges = executions[part.axis]
        usable = np.arange(part.rows.num_rows) if edges else _whole(part)
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
            spans = tuple(_span(part.rows, i) for i in usable[start:stop].tolist())
            best[part.axis] = (
                worth,
                _Reference(part.source, cycle, spans, cycle.f_max_hz, edges),
            )
    return {
        axis: _without_chance(reference, [part for part in parts if part.axis == axis], rule)
        for axis, (_, reference) in best.items()
    }


def _without_chance(reference: _Reference, parts: Sequence[_Axis], rule: MatchRule) -> _Reference:
    """Leave out small segments that are not in every cycle: they would be compared by chance."""
    cycle = reference.features
    doubtful = small(cycle, cycle)
    if not doubtful.any():
        return reference
    always = np.ones(len(cycle), dtype=bool)
    for part in parts:
        found = identify_anywhere(cycle, part.features.take(_usable(part, reference)), rule)
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
    usable = _usable(own, reference)
    motion = identify_anywhere(rest.features, own.features.take(usable), rule).motion
    places = [_span(own.rows, i) for i in usable.tolist()]
    found_again = [m == motion[places.index(span)] for m, span in enumerate(rest.spans)]
    return rest if all(found_again) else reference


def _usable(part: _Axis, reference: _Reference) -> npt.NDArray[np.int64]:
    """Return the indices of segments that are whole: at an edge if those of the reference are."""
    return np.arange(part.rows.num_rows) if reference.edges else _whole(part)


def _holds(part: _Axis, cycle: SegmentFeatures, rule: MatchRule) -> bool:
    own = part.features.take(_whole(part))
    return bool((identify_anywhere(cycle, own, rule).cycle > UNIDENTIFIED).any())


def _executions(parts: Sequence[_Axis], rule: MatchRule) -> bool:
    """Tell whether every recording holds the same motions from its beginning to its end.

    Then each is one execution of the program or several whole ones, and what touches its edge has
    not been cut by it.
    """
    if len(parts) < 2 or parts[0].rows.column("kind")[0].as_py() == "window":
        return False
    first = parts[0].features
    at_edge = _column(parts[0].rows, "edge").astype(bool)
    # at an edge a small segment is the beginning of a motion that is cut
    asked = ~small(first, first) | at_edge
    for part in parts[1:]:
        own = part.features
        found = identify(first, own, rule)
        told = found.motion > UNIDENTIFIED
        there = np.zeros(len(first), dtype=bool)
        there[found.motion[told]] = True
        known = told | (small(own, first) & ~_column(part.rows, "edge").astype(bool))
        if found.cycle.max() > 0 or not known.all() or not there[asked].all():
            return False
        of_edge = told & at_edge[found.motion]
        ratio = own.duration_s[of_edge] / first.duration_s[found.motion[of_edge]]
        if (np.abs(ratio - 1) > SAME_DURATION).any():
            return False
    return True


def _with_carrier(reference: _Reference, axis: int, config: Config) -> _Reference:
    """Let the current's own fluctuations tell the delay where nothing else does."""
    with reference.source.open() as run:
        if run.channels(axis).phases or config.joint.gear_ratio is not None:
            return reference
        wanted = config.patterns.envelope
        found = [
            fluctuation_frequency(read_envelope(run, axis, *span, wanted), run.sampling_rate_hz)
            for span in reference.spans
        ]
    # one delay for all motions: of short ones the fluctuations are known badly
    return replace(reference, carrier_hz=np.full(len(found), float(np.median(found))))


def _given_references(
    path: Path, moved_to: Sequence[Path], jobs: int, kept: KeptResults | None
) -> dict[int, _Reference]:
    """Take the reference cycles of a motion table."""
    table = read_table(path, "identify", MOTIONS)
    sources = {source.name: source for source in read_sources(path, moved_to)}
    rows = table.filter(table.column("reference"))
    if rows.num_rows == 0:
        msg = (
            f"{path}: holds no reference cycle: no motion repeats; record at least two cycles of "
            "the baseline, or set identify.segments_per_cycle"
        )
        raise NotEnoughDataError(msg)
    held = set(zip(rows["run"].to_pylist(), rows["axis"].to_pylist(), strict=True))
    own = [part for part in _parts(table, sources) if (part.source.name, part.axis) in held]
    references = {}
    for part in _with_leads(own, jobs, kept):
        which = np.flatnonzero(_column(part.rows, "reference"))
        features = part.features.take(which)
        motion = _column(part.rows, "motion")
        told = motion > UNIDENTIFIED
        same = part.features.take(np.flatnonzero(told)).lead_as(features)
        if np.mean(same[np.arange(len(same)), motion[told]]) < MOSTLY:
            features = features.anywhere()
        references[part.axis] = _Reference(
            part.source,
            features,
            tuple(_span(part.rows, i) for i in which.tolist()),
            _column(part.rows, "reference_f_max_hz")[which],
            bool(_column(part.rows, "edge")[which].any()),
        )
    return references


def _with_leads(parts: Sequence[_Axis], jobs: int, kept: KeptResults | None) -> list[_Axis]:
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


def _leads(part: _Axis) -> dict[str, npt.NDArray[np.float64]]:
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


def _places(run: Run, part: _Axis, column: str) -> npt.NDArray[np.float64]:
    """Read where an axis is at each segment's start and stop, (n, 2), rad."""
    asked = np.column_stack([_column(part.rows, "start"), _column(part.rows, "stop") - 1])
    places = np.full(asked.shape, np.nan)
    for start, block in run.blocks([column]):
        values = block[column]
        here = (asked >= start) & (asked < start + values.size)
        places[here] = values[asked[here] - start]
    return places


def _turns(run: Run, part: _Axis) -> npt.NDArray[np.float64]:
    """Read how far the current vector of an axis turns in each segment, (n,)."""
    f_max_hz = part.features.f_max_hz
    motions = [(*_span(part.rows, i), hz) for i, hz in enumerate(f_max_hz.tolist())]
    often = [motions[i] for i in np.flatnonzero(part.features.way >= TURNS_AT_TOP_SPEED)]
    offset = current_offset(run, part.axis, often, "clarke")
    turns = np.zeros(len(motions))
    for i in np.flatnonzero(f_max_hz > 0).tolist():
        start, stop, hz = motions[i]
        vector = read_current(run, part.axis, start, stop, "clarke") - offset
        turns[i] = turning_parts(vector, hz, run.sampling_rate_hz)[1].sum()
    return turns


def _span(rows: pa.Table, index: int) -> tuple[int, int]:
    return rows.column("start")[index].as_py(), rows.column("stop")[index].as_py()


def _identified(
    reference: SegmentFeatures, own: SegmentFeatures, rule: MatchRule
) -> Identification:
    """Identify segments, by turns only of a cycle that would else be taken for itself shifted."""
    if own.leads_by == reference.leads_by == "turns":
        if not fits_shifted(reference, rule):
            return identify_anywhere(reference, own.anywhere(), rule)
        found = identify_anywhere(reference, own, rule)
        return with_cut_cycles(reference, own, found, rule)
    return identify_anywhere(reference, own, rule)


def _identify_part(job: _Job) -> pa.Table:
    part, reference = job.part, job.reference
    n = part.rows.num_rows
    cycle = np.full(n, UNIDENTIFIED, dtype=np.int64)
    motion = np.full(n, UNIDENTIFIED, dtype=np.int64)
    similarity = np.zeros(n)
    lag = np.zeros(n, dtype=np.int64)
    f_max_hz = np.full(n, np.nan)
    samples = np.zeros(n, dtype=np.int64)
    is_reference = np.zeros(n, dtype=bool)
    whole = _whole(part) if reference is None else _usable(part, reference)
    if reference is not None and whole.size:
        rule, own = match_rule(job.config), part.features.take(whole)
        found = _identified(reference.features, own, rule)
        # what was taught elsewhere, or has another zero since, is told as where none is logged
        others = [
            (identify_anywhere, own.anywhere(), rule),
            (identify, own.anywhere(), rule.by_motion()),
        ]
        if own.leads_by == reference.features.leads_by == "places_rad":
            others.insert(0, (identify_anywhere, own, rule.by_lead()))
        for look, features, within in others if job.judged else ():
            if found.cycle.max() == UNIDENTIFIED:
                found = look(reference.features, features, within)
        cycle[whole], motion[whole] = found.cycle, found.motion
        similarity[whole] = found.similarity
        for i in np.flatnonzero(motion >= 0).tolist():
            span = reference.spans[motion[i]]
            f_max_hz[i] = reference.carrier_hz[motion[i]]
            samples[i] = span[1] - span[0]
            place = _span(part.rows, i)
            is_reference[i] = part.source == reference.source and place == span
        # windows of a steady signal have no beginning that could be synchronised
        moving = _column(part.rows, "kind") == "motion"
        lag[moving] = _lags(job, motion[moving], _spans(part.rows, moving))
    columns = {
        "cycle": cycle,
        "motion": motion,
        "similarity": similarity,
        "lag": lag,
        "reference": is_reference,
        "reference_f_max_hz": f_max_hz,
        "reference_samples": samples,
    }
    rows = part.rows
    if reference is not None:
        rate_hz, own_hz = (of.source.info.sampling_rate_hz for of in (reference, part))
        if same_clock(own_hz, rate_hz):
            # of one clock's drift a delay in samples, which rounds, must not make two
            at = rows.schema.get_field_index("sampling_rate_hz")
            rows = rows.set_column(at, rows.field(at), pa.array(np.full(n, rate_hz)))
    for name, values in columns.items():
        rows = rows.append_column(MOTIONS.field(name), pa.array(values, MOTIONS.field(name).type))
    return rows.select(MOTIONS.names).replace_schema_metadata(None).cast(MOTIONS)


def _spans(rows: pa.Table, which: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    return [_span(rows, i) for i in np.flatnonzero(which).tolist()]


def _lags(
    job: _Job, motion: npt.NDArray[np.int64], spans: Sequence[tuple[int, int]]
) -> npt.NDArray[np.int64]:
    """Synchronise each identified segment with the reference segment of its motion."""
    part, reference = job.part, job.reference
    assert reference is not None
    lags = np.zeros(len(spans), dtype=np.int64)
    with part.source.open() as run, reference.source.open() as reference_run:
        max_lag = round(job.config.max_lag_s * run.sampling_rate_hz)
        read = _reader(job, reference_run, run)
        courses = [read(reference_run, *span) for span in reference.spans]
        for i, (m, span) in enumerate(zip(motion.tolist(), spans, strict=True)):
            own = part.source == reference.source and span == reference.spans[m]
            if m == UNIDENTIFIED or own:
                continue
            found = align(courses[m], read(run, *span), max_lag)
            if found.correlation >= MIN_CORRELATION:
                lags[i] = found.lag
    return lags


def _reader(job: _Job, *runs: Run) -> Callable[[Run, int, int], npt.NDArray[np.floating]]:
    """Say what segments are synchronised by.

    Where the joint's motion told the segments it does: friction and play move the course of a
    current in time, by more the further a night is from the others.
    """
    axis = job.part.axis
    if "reported" in job.part.rows["signal"].unique().to_pylist():
        for kind in ("position", "velocity"):
            columns = {getattr(run.channels(axis), kind) for run in runs}
            if len(columns) == 1 and None not in columns:
                [column] = columns
                as_moved = unwrapped if kind == "position" else np.asarray
                return lambda run, start, stop: as_moved(run.read([column], start, stop)[column])
    return lambda run, start, stop: read_course(run, axis, start, stop, job.envelope)
