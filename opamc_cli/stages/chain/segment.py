"""Stage `segment`: runs in, motions and the largest frequency of their carrier out (3.1, 3.2)."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.errors import InputError, OpamcError
from opamc_cli.stages.chain.segments.carrier import carrier_segments
from opamc_cli.stages.chain.segments.joint import joint_segments
from opamc_cli.stages.chain.segments.rows import AxisSegments, without_odd_warmth
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.processes.parallel import Watch, map_items, unwatched
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import SEGMENTS
from opamc_cli.storage.sources import RunSource, sources_record
from opamc_cli.storage.tables import write_table

SAMPLES_PER_SHORTEST = 10
"""Samples that the shortest motion, or the period of the slowest carrier, has to have."""

SLOWEST_LOG_HZ = 10.0
"""Of a reported current: slower, and a motion of ten samples takes longer than robots move."""


@dataclass(frozen=True)
class SegmentOutcome:
    """What `run` did."""

    path: Path
    """The table that was written."""
    table: pa.Table
    """Its rows."""
    notes: tuple[str, ...]
    """One sentence for each channel that is doubtful but was used, or axis that stands still."""
    errors: tuple[OpamcError, ...]
    """One for each run, or axis of a run, that could not be used."""
    missing: Mapping[tuple[str, int], int] = field(default_factory=dict)
    """Samples of a current, position or speed that are lost, by run and axis."""

    def by_axis(self) -> list[dict[str, Any]]:
        """Return segments, time in motion and largest frequency by run, axis and kind."""
        found: dict[tuple[str, int, str], dict[str, Any]] = {}
        for row in self.table.to_pylist():
            entry = found.setdefault(
                (row["run"], row["axis"], row["kind"]),
                {"segments": 0, "in_motion_s": 0.0, "f_max_hz": 0.0},
            )
            entry["segments"] += 1
            entry["in_motion_s"] += (row["stop"] - row["start"]) / row["sampling_rate_hz"]
            entry["f_max_hz"] = max(entry["f_max_hz"], row["f_max_hz"])
        return [
            {"run": run, "axis": axis, "kind": kind, **entry}
            for (run, axis, kind), entry in found.items()
        ]


@dataclass(frozen=True)
class _Job:
    """One axis of one run."""

    name: str
    path: Path
    axis: int
    config: Config


def run(
    paths: Sequence[Path],
    config: Config,
    out: Path,
    *,
    without: Collection[Path] = (),
    jobs: int = 1,
    watch: Watch = unwatched,
    kept: KeptResults | None = None,
) -> SegmentOutcome:
    """Cut runs into motions, axis by axis.

    Parameters
    ----------
    paths
        Run files and folders of them.
    config
        Sections `segment` and `joint` are used.
    out
        Folder of the segment table.
    without
        Runs that are left out.
    jobs
        Worker processes; the result is the same for any number.
    watch
        Called as the work gets done.
    kept
        Where results of the same work may lie.

    Raises
    ------
    InputError
        If no run can be used.
    """
    sources: list[RunSource] = []
    work: list[_Job] = []
    errors: list[OpamcError] = []
    for name, path in find_runs(paths):
        if path in without:
            continue
        try:
            with Run(path, name) as recording:
                _check_rate(recording, config)
                recording.check_time()
                sources.append(RunSource.of(recording))
                work += [_Job(name, path, axis, config) for axis in recording.axes]
        except OpamcError as error:
            errors.append(error)
    outcome = map_items(remembered(_segment_axis, kept), work, jobs, watch)
    results = [AxisSegments(*each) for each in outcome.results]  # a kept one is a tuple
    errors += outcome.errors
    notes = [note for result in results for note in result.notes]
    strange = config.joint.axes_named - {job.axis for job in work}
    if strange:
        numbers = ", ".join(map(str, sorted(strange)))
        notes.append(f"joint.gear_ratio or joint.pole_pairs name axis {numbers}, which no run has")
    errors += _runs_without_motion(sources, results, outcome.errors)
    path_of = {source.name: source.path for source in sources}
    errors += [
        InputError(f"{path_of[each.run]}: {each.lost}", axes={row["axis"] for row in each.rows})
        for each in results
        if each.lost
    ]
    table = pa.Table.from_pylist(
        [row for result in results for row in result.rows], schema=SEGMENTS
    )
    if not table.num_rows:
        raise _nothing_usable(errors)
    moved = set(table.column("run").to_pylist())
    sources = [source for source in sources if source.name in moved]
    path = out / files.SEGMENTS
    write_table(
        path,
        table,
        stage="segment",
        config=config.canonical("segment", "joint"),
        inputs=[(source.path, source.sha256) for source in sources],
        extra=sources_record(sources, out),
    )
    missing = {(each.run, each.rows[0]["axis"]): each.n_missing for each in results if each.rows}
    return SegmentOutcome(path, table, tuple(notes), tuple(errors), missing)


def _segment_axis(job: _Job) -> AxisSegments:
    try:
        with Run(job.path, job.name) as recording:
            channels = recording.channels(job.axis)
            if channels.phases:
                found = carrier_segments(recording, channels, job.config.segment)
            else:
                found = joint_segments(recording, channels, job.config.segment, job.config.joint)
            return without_odd_warmth(recording, channels, found)
    except OpamcError as error:
        error.axes = (job.axis,)
        raise


def _check_rate(recording: Run, config: Config) -> None:
    segment = config.segment
    phases = any(recording.channels(axis).phases for axis in recording.axes)
    if phases:
        least_hz = SAMPLES_PER_SHORTEST * max(1 / segment.min_motion_s, segment.f_min_hz)
        why = "the motions and their carrier", ", and 2.5 times the fastest carrier"
    else:
        least_hz, why = SLOWEST_LOG_HZ, ("a reported current", "")
    if recording.sampling_rate_hz < least_hz:
        msg = (
            f"{recording.path}: sampling_rate_hz is {recording.sampling_rate_hz:g}, too low for "
            f"{why[0]}: at least {least_hz:g} Hz is needed{why[1]}; record faster"
        )
        raise InputError(msg)


def _runs_without_motion(
    sources: Sequence[RunSource],
    results: Sequence[AxisSegments],
    errors: Sequence[OpamcError],
) -> list[OpamcError]:
    without: list[OpamcError] = []
    for source in sources:
        own = [result for result in results if result.run == source.name]
        # A run that failed on some axis has been reported already.
        failed = any(str(error).startswith(f"{source.path}:") for error in errors)
        if not any(result.rows for result in own) and not failed:
            why = "; ".join(result.stands for result in own if result.stands)
            msg = f"{source.path}: no motion was found ({why}); record at least one cycle"
            without.append(InputError(msg))
    return without


def _nothing_usable(errors: Sequence[OpamcError]) -> OpamcError:
    if len(errors) == 1:
        return errors[0]
    return InputError(f"none of the runs can be used, {len(errors)} errors; the first: {errors[0]}")
