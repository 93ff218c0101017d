"""Stage `identify`: segments in, cycles and motions out (thesis 3.3 and 4.1.1)."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from opamc_cli.config import Config
from opamc_cli.config.models import IdentifyConfig
from opamc_cli.errors import InputError, OpamcError
from opamc_cli.signal.cycles.features import MatchRule, SegmentFeatures
from opamc_cli.signal.cycles.identification import (
    UNIDENTIFIED,
    Identification,
    fits_shifted,
    identify,
    identify_anywhere,
    with_cut_cycles,
)
from opamc_cli.stages.chain.compared.speeds import (
    OTHER_SPEEDS,
    TWO_SPEEDS,
    odd_cycles,
    odd_speeds,
)
from opamc_cli.stages.chain.cycles.axis import (
    Axis,
    axes_of,
    match_rule,
    span_at,
    usable_segments,
    values_of,
)
from opamc_cli.stages.chain.cycles.lags import lags_to
from opamc_cli.stages.chain.cycles.leads import with_leads
from opamc_cli.stages.chain.cycles.places import AT_PLACES, references_of_places
from opamc_cli.stages.chain.cycles.reference import (
    Reference,
    given_references,
    own_references,
    with_carrier,
)
from opamc_cli.stages.chain.cycles.taught import PLACES, displacements
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.processes.parallel import Watch, map_items, unwatched
from opamc_cli.stages.recordings.envelope import (
    EnvelopeKind,
)
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.channels import same_clock
from opamc_cli.storage.schemas.tables import MOTIONS, SEGMENTS
from opamc_cli.storage.sources import RunSource, read_sources, sources_record
from opamc_cli.storage.tables import read_table, record_at, table_input, write_table


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
class _Job:
    """One axis of one run with the reference that it is identified by."""

    part: Axis
    reference: Reference | None
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
    parts = [p for p in axes_of(table, sources) if (p.source.name, p.axis) not in without]
    parts = with_leads(parts, jobs, kept)
    if reference is not None:
        references = given_references(reference, moved_to, jobs, kept)
    else:

        def found_in(axes: Sequence[Axis]) -> dict[int, Reference]:
            return own_references(segments, axes, rule, config.identify, reference_run)

        references = {
            axis: with_carrier(found, axis, config)
            for axis, found in references_of_places(parts, found_in, rule).items()
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
    left, led, elsewhere = _leading_elsewhere(motions, parts, references)
    motions = _without_cycles(motions, left)
    late = _ending_late(motions, known, sources, rule) if reference is not None else ()
    errors = (*outcome.errors, *_of_two_speeds(midway, sources), *led, *late)
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
        | {OTHER_SPEEDS: other_speeds, TWO_SPEEDS: sorted({run for run, _ in midway})}
        | {PLACES: displacements(motions, parts, references)},
    )
    notes = (*_unlike(motions, rule), *elsewhere)
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
            "others and are not compared: was the speed changed midway?",
            axes=[axis],
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


def _ending_late(
    motions: pa.Table, known: pa.Table, sources: Mapping[str, RunSource], rule: MatchRule
) -> Iterator[OpamcError]:
    """Say which joints creep to a place as they do in no recording of the baseline."""
    usual = {axis for _, axis in _late(known, rule)}
    for (run, axis), times in _late(motions, rule).items():
        if axis not in usual:
            yield InputError(
                f"{sources[run].path}: {len(times)} motion{'s' * (len(times) > 1)} of axis {axis} "
                f"end{'s' * (len(times) == 1)} late, {max(times):.2f} times as long as usual at "
                "most, and what is behind the usual end is not compared: a cold joint that creeps "
                "to its place, a brake that drags?",
                axes=[axis],
            )


def _late(motions: pa.Table, rule: MatchRule) -> dict[tuple[str, int], list[float]]:
    """Return, by run and axis, how many times as long as usual its motions last that end late."""
    found: dict[tuple[str, int], list[float]] = {}
    names = ["run", "axis", "motion", "start", "stop", "reference_samples"]
    for row in motions.select(names).to_pylist():
        length, usual = row["stop"] - row["start"], row["reference_samples"]
        if row["motion"] != UNIDENTIFIED and length > (1 + rule.duration_tolerance) * usual:
            found.setdefault((row["run"], row["axis"]), []).append(length / usual)
    return found


def _leading_elsewhere(
    motions: pa.Table, parts: Sequence[Axis], references: Mapping[int, Reference]
) -> tuple[pa.Array, list[OpamcError], list[str]]:
    """Find motions that lead elsewhere than the reference's, whatever the position's zero.

    Where half lead as they should, the others are no motions of the program: their rows, and an
    error for each axis of a run. Else all are told all the same, with a note. Another zero of the
    position is an error, too: a joint that has slipped is not as it was.
    """
    runs, axes, numbers = (np.asarray(motions[name]) for name in ("run", "axis", "motion"))
    left = np.zeros(motions.num_rows, dtype=bool)
    errors: list[OpamcError] = []
    notes = []
    for part in parts:
        known = references[part.axis].features if part.axis in references else None
        rows = np.flatnonzero((runs == part.source.name) & (axes == part.axis))
        told = np.flatnonzero(numbers[rows] > UNIDENTIFIED)
        places = part.features.places_rad
        if known is None or known.places_rad is None or places is None or not told.size:
            continue
        motion = numbers[rows[told]]
        own, row = part.features.take(told), np.arange(told.size)
        zero = np.nanmedian(places[told] - known.places_rad[motion])
        same = replace(own, places_rad=places[told] - zero).lead_as(known)[row, motion]
        if np.mean(same) < AT_PLACES:
            notes.append(
                f"{part.source.path}: the motions of axis {part.axis} lead elsewhere than the "
                "reference's and were told by duration, speed and direction: was the program "
                "edited?"
            )
            continue
        if not own.lead_as(known)[row, motion].any():
            errors.append(
                InputError(
                    f"{part.source.path}: the position of axis {part.axis} has another zero than "
                    "the reference's: was it set anew, or has the joint or its encoder slipped?",
                    axes=[part.axis],
                )
            )
        if not same.all():
            left[rows[told[~same]]] = True
            errors.append(
                InputError(
                    f"{part.source.path}: {np.sum(~same)} of {told.size} motions of axis "
                    f"{part.axis} lead elsewhere than the reference's and are not compared: was "
                    "the program edited?",
                    axes=[part.axis],
                )
            )
    return pa.array(left), errors, notes


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
    whole = usable_segments(part, reference is not None and reference.edges)
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
        slower = _identified(reference.features, own, rule.lingering())
        if slower.cycle.max() > found.cycle.max():  # some of its motions end late, in the cold say
            found = slower
        for look, features, within in others if job.judged else ():
            if found.cycle.max() == UNIDENTIFIED:
                found = look(reference.features, features, within)
        cycle[whole], motion[whole] = found.cycle, found.motion
        similarity[whole] = found.similarity
        for i in np.flatnonzero(motion >= 0).tolist():
            span = reference.spans[motion[i]]
            f_max_hz[i] = reference.carrier_hz[motion[i]]
            samples[i] = span[1] - span[0]
            place = span_at(part.rows, i)
            is_reference[i] = part.source == reference.source and place == span
        # windows of a steady signal have no beginning that could be synchronised
        moving = values_of(part.rows, "kind") == "motion"
        spans = [span_at(part.rows, i) for i in np.flatnonzero(moving).tolist()]
        of_moving = reference, part, motion[moving], spans
        lag[moving] = lags_to(*of_moving, job.config.max_lag_s, job.envelope)
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
