"""The first three stages in a row: from runs to ordinal patterns."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.errors import OpamcError
from opamc_cli.stages.chain import identify, patterns, segment
from opamc_cli.stages.processes.kept import UNKNOWN, KeptResults
from opamc_cli.stages.processes.parallel import Steps, unshown
from opamc_cli.storage.files.atomic import atomic_path
from opamc_cli.storage.schemas import files

FILES = (files.SEGMENTS, files.MOTIONS, *patterns.FILES)
"""What the chain leaves in its folder."""


@dataclass(frozen=True)
class ChainOutcome:
    """Tables that the chain wrote, and what could not be used."""

    segments: Path
    motions: Path
    patterns: Path
    """With `segments`, `motions`: paths of the tables; those of the witnesses lie beside the
    patterns."""
    runs_done: tuple[str, ...]
    """Names of the runs that went through."""
    errors: tuple[OpamcError, ...]
    """One for each run, or axis of a run, that could not be used."""
    notes: tuple[str, ...]
    """What is worth knowing besides: doubtful channels, segments that fit no motion of the
    reference."""


def run_chain(
    paths: Sequence[Path],
    config: Config,
    out: Path,
    *,
    reference: Path | None = None,
    without: Collection[Path] = (),
    check: Callable[[segment.SegmentOutcome], Collection[tuple[str, int]]] = lambda _: (),
    jobs: int = 1,
    kept: KeptResults | None = None,
    progress: Steps = unshown,
) -> ChainOutcome:
    """Run segment, identify and patterns over runs, each stage from the file before it.

    Parameters
    ----------
    paths
        Run files and folders of them.
    config
        All options.
    out
        Folder of the tables.
    reference
        Motion table whose reference cycles are taken; None: found in these runs.
    without
        Runs that are left out.
    check
        Told the segments, it returns run and axis of those that go no further.
    jobs
        Worker processes.
    kept
        Where results of the same work may lie.
    progress
        Called with the name of each stage as it begins.

    Raises
    ------
    OpamcError
        If no run can be used.
    """
    segmented = segment.run(
        paths, config, out, without=without, jobs=jobs, kept=kept, watch=progress("segment")
    )
    left_out = check(segmented)
    segments = _Segments(segmented.path, config, tuple(sorted(left_out)))
    # of a baseline all is kept at once as well: to put it together file by file takes ten times as
    # long as to copy it
    whole = kept if reference is None else None
    found: Any = UNKNOWN if whole is None else whole.find(_identify_and_count, segments)
    if found is UNKNOWN:
        done = _identify_and_count(segments, out, reference, jobs, kept, progress)
        if whole is not None and not done.errors:
            whole.keep(_identify_and_count, segments, (_content(out), done.notes))
    else:
        tables, notes = found
        _put_down(tables, out)
        done = _Done((), notes)
    names = dict.fromkeys(segmented.table.column("run").to_pylist())
    return ChainOutcome(
        segments=segmented.path,
        motions=out / files.MOTIONS,
        patterns=out / files.PATTERNS,
        runs_done=tuple(names),
        errors=(*segmented.errors, *done.errors),
        notes=(*segmented.notes, *done.notes),
    )


@dataclass(frozen=True)
class _Segments:
    """All that motions and patterns of a baseline depend on."""

    path: Path
    config: Config
    left_out: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class _Done:
    """What `_identify_and_count` has to say beside its tables."""

    errors: tuple[OpamcError, ...]
    notes: tuple[str, ...]


def _identify_and_count(
    segments: _Segments,
    out: Path,
    reference: Path | None,
    jobs: int,
    kept: KeptResults | None,
    progress: Steps,
) -> _Done:
    identified = identify.run(
        segments.path,
        segments.config,
        out,
        reference=reference,
        without=segments.left_out,
        jobs=jobs,
        kept=kept,
        watch=progress("identify"),
    )
    counted = patterns.run(
        identified.path, segments.config, out, jobs=jobs, kept=kept, watch=progress("patterns")
    )
    return _Done(
        (*identified.errors, *counted.errors),
        (
            *_of_other_speeds(identified),
            *counted.notes,
            *_unidentified(identified),
            *identified.notes,
        ),
    )


def _content(out: Path) -> pa.Table:
    """Return the tables that follow on the segments, byte by byte."""
    names = FILES[1:]
    return pa.table({"name": names, "content": [(out / name).read_bytes() for name in names]})


def _put_down(tables: pa.Table, out: Path) -> None:
    for row in tables.to_pylist():
        with atomic_path(out / row["name"]) as path:
            path.write_bytes(row["content"])


def _of_other_speeds(identified: identify.IdentifyOutcome) -> list[str]:
    """Say which runs are left out for their speed, which a page about what is left would not."""
    runs = list(identified.other_speeds)
    if not runs:
        return []
    named = ", ".join(runs[:3]) + (f" and {len(runs) - 3} more" if len(runs) > 3 else "")
    return [f"of another speed, or a clock or lost samples, and left out: {named}"]


def _unidentified(identified: identify.IdentifyOutcome) -> list[str]:
    """Say, axis by axis, how many segments fit no motion of the reference."""
    missed: dict[int, list[int]] = {}
    for (_, axis), (_, unidentified) in identified.cycles().items():
        if unidentified:
            missed.setdefault(axis, []).append(unidentified)
    return [
        f"axis {axis}: outside the reference cycle, in {_counted(len(counts), 'run')}: "
        f"{_counted(sum(counts), 'segment')}"
        for axis, counts in sorted(missed.items())
    ]


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
