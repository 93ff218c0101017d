"""From a planned night to what a worker needs to judge it, and where it may work."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.inputs.recordings import Recording
from opamc_cli.stages.nightly.plan.planned import PlannedNight
from opamc_cli.stages.nightly.workers.night import Input, NightJob, ProgramJob
from opamc_cli.storage.logs import copy_name

WORK, KEPT, COPIES = ".opamc-work", ".kept", ".copies"
"""Folders below `out` that nobody needs to look into."""


def night_job(cell: CellConfig, source: str, night: PlannedNight) -> NightJob:
    """Return all that a worker needs of a night; `source`: the cell's file, for errors."""
    return NightJob(
        robot=night.robot,
        night=night.night,
        programs=tuple(
            ProgramJob(
                program=one.program,
                condition=one.condition,
                baseline_name=one.baseline_name,
                missing=one.missing,
                targets=_inputs(one.targets),
                baseline=_inputs(one.baseline),
                speed_percent=one.targets[0].facts.speed_percent,
                payload_kg=one.targets[0].facts.payload_kg,
            )
            for one in night.comparisons
            if one.baseline or one.missing
        ),
        config=cell.diagnosis_of(night.robot, source),
        axes=cell.axes_of(night.robot),
        kept=(cell.out / KEPT).absolute(),
        copies=(cell.out / COPIES).absolute(),
        scratch=(cell.out / WORK).absolute(),
    )


def _inputs(recordings: Sequence[Recording]) -> tuple[Input, ...]:
    taken: set[str] = set()
    inputs = []
    for one in sorted(recordings, key=lambda one: (one.name, one.log.path)):
        name = one.name
        while name in taken:  # two folders of one night may hold files of one name
            name += "'"
        taken.add(name)
        here = one.log.path if one.log.remote else str(Path(one.log.path).absolute())
        inputs.append(Input(name, replace(one.log, path=here), one.sha256))
    return tuple(inputs)


def drop_copies(cell: CellConfig, planned: Sequence[PlannedNight]) -> None:
    """Keep copies of baselines only: every night needs them, and a target is not read again."""
    copies = cell.out / COPIES
    if not copies.is_dir():
        return
    baselines = (one for night in planned for each in night.comparisons for one in each.baseline)
    keep = {copy_name(one.log) for one in baselines if one.log.remote}
    for copy in copies.iterdir():
        if copy.name not in keep:
            copy.unlink(missing_ok=True)
