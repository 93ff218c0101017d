"""The first three stages in a row: from runs to ordinal patterns."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from opamc_cli.config import Config
from opamc_cli.errors import OpamcError
from opamc_cli.stages.chain import identify, patterns, segment
from opamc_cli.stages.chain.kept import KeptResults
from opamc_cli.stages.processes.parallel import Steps, unshown
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
    identified = identify.run(
        segmented.path,
        config,
        out,
        reference=reference,
        without=left_out,
        jobs=jobs,
        kept=kept,
        watch=progress("identify"),
    )
    counted = patterns.run(
        identified.path, config, out, jobs=jobs, kept=kept, watch=progress("patterns")
    )
    names = dict.fromkeys(segmented.table.column("run").to_pylist())
    return ChainOutcome(
        segments=segmented.path,
        motions=identified.path,
        patterns=counted.path,
        runs_done=tuple(names),
        errors=(*segmented.errors, *identified.errors, *counted.errors),
        notes=(
            *segmented.notes,
            *counted.notes,
            *_unidentified(identified),
            *identified.notes,
        ),
    )


def _unidentified(identified: identify.IdentifyOutcome) -> list[str]:
    """Say, axis by axis, how many segments fit no motion of the reference."""
    missed: dict[int, list[int]] = {}
    for (_, axis), (_, unidentified) in identified.cycles().items():
        if unidentified:
            missed.setdefault(axis, []).append(unidentified)
    return [
        f"axis {axis}: {sum(counts)} segments of {len(counts)} runs fit no motion of the "
        "reference cycle"
        for axis, counts in sorted(missed.items())
    ]
