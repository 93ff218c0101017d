"""Reads a cell's recordings, does the robots' nights that are new, and settles what follows.

Order of the writing, so that a kill at any instant costs work and nothing else: a night's folder
is renamed into its place, then the night is recorded in the history; what follows from the history
(alarms, pages, metrics) is made from it anew, and only then is anybody told.
"""

import shutil
from collections.abc import Iterator, Sequence

from opamc_cli.config.cell import CellConfig
from opamc_cli.stages.nightly.plan.planned import PlannedNight
from opamc_cli.stages.nightly.settle import settle_cell
from opamc_cli.stages.nightly.start.jobs import WORK, drop_copies, night_job
from opamc_cli.stages.nightly.start.look import Look, Scene, arrive, look_at, plan_of
from opamc_cli.stages.nightly.start.outcome import CellOutcome, Wanted
from opamc_cli.stages.nightly.start.past import Past
from opamc_cli.stages.nightly.start.record import record_judged, record_unjudged
from opamc_cli.stages.nightly.workers import cluster
from opamc_cli.stages.nightly.workers.night import COMPUTE, NightJob, ProgramResult
from opamc_cli.stages.nightly.workers.workers import Broken, run_all
from opamc_cli.stages.processes.parallel import Steps, unshown
from opamc_cli.storage.history.history import History
from opamc_cli.storage.schemas import files


def open_history(cell: CellConfig, *, read_only: bool = False) -> History:
    """Open a cell's history."""
    return History(cell.out / files.HISTORY, read_only=read_only)


def plan(cell: CellConfig, source: str, history: History, wanted: Wanted) -> CellOutcome:
    """Say what would be done, without doing it."""
    scene, past, outcome = arrive(cell, source, history, wanted)
    for robot in scene.recordings.by_robot:
        for night in plan_of(robot, scene, past, None).nights:
            if wanted.has(night.night):
                outcome.plan(night)
    return outcome


def run(
    cell: CellConfig,
    source: str,
    history: History,
    wanted: Wanted,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Steps = unshown,
) -> CellOutcome:
    """Do the nights that are new and asked for; the caller holds the lock of `cell.out`.

    Parameters
    ----------
    cell
        What to look after.
    source
        Name of its file, for errors.
    history
        Of the cell.
    wanted
        Which nights.
    jobs
        Worker processes; 0: one per core.
    scheduler
        Address of a Dask scheduler that is handed the nights instead.
    progress
        Called with each step as it begins.

    Raises
    ------
    OpamcError
        If the cell's recordings cannot be listed, or nothing can be written.
    """
    # what a killed start left behind; the lock says that nobody is using it
    shutil.rmtree(cell.out / WORK, ignore_errors=True)
    progress("looking for recordings")
    scene, past, outcome = arrive(cell, source, history, wanted)
    robots = outcome.robots
    tried: set[tuple[str, str, str]] = set()
    has_news = True
    while True:
        looked = look_at(robots, scene, past, history, tried, outcome, has_news=has_news)
        has_news = bool(looked.to_judge or looked.unjudged)
        for night in looked.unjudged:
            record_unjudged(cell, history, night, outcome)
        _judge(looked.to_judge, scene, past, history, outcome, jobs, scheduler, progress)
        progress("alarms and pages")
        outcome.summary = settle_cell(
            cell,
            source,
            history,
            outcome.robots,
            whole=wanted == Wanted(),
            may_begin=scene.may_begin,
        )
        robots = _to_look_at_again(looked, past, history)
        if not robots or outcome.ended:
            break
        past = Past(cell, history)
    shutil.rmtree(cell.out / WORK, ignore_errors=True)
    drop_copies(cell, [*outcome.planned.values()])
    return outcome


def _judge(
    nights: Sequence[PlannedNight],
    scene: Scene,
    past: Past,
    history: History,
    outcome: CellOutcome,
    jobs: int,
    scheduler: str | None,
    progress: Steps,
) -> None:
    """Have nights judged by workers, and record each as it is answered."""
    if not nights:
        return
    by_place = {(night.robot, night.night): night for night in nights}
    works = [night_job(scene.cell, scene.source, night) for night in nights]
    watch = progress("nights")
    watch(0, len(works))
    answers = _answers(scene.cell, works, jobs, scheduler, outcome)
    for n_done, (job, answer) in enumerate(answers, start=1):
        night = by_place[job.robot, job.night]
        attempts = past.attempts_at(night)
        record_judged(scene.cell, history, night, job, answer, attempts, outcome)
        watch(n_done, len(works))


def _answers(
    cell: CellConfig,
    works: Sequence[NightJob],
    jobs: int,
    scheduler: str | None,
    outcome: CellOutcome,
) -> Iterator[tuple[NightJob, tuple[ProgramResult, ...] | Broken]]:
    if scheduler is None:
        limits = cell.limits
        yield from run_all(COMPUTE, works, jobs, seconds=limits.seconds, memory_gb=limits.memory_gb)
        return
    try:
        yield from cluster.run_all(COMPUTE, works, scheduler, seconds=cell.limits.seconds)
    except cluster.SchedulerLostError as error:
        outcome.ended = str(error)


def _to_look_at_again(looked: Look, past: Past, history: History) -> tuple[str, ...]:
    """Return the robots of which more is to be done now that these nights are judged."""
    alarms = history.spans()
    # an alarm that nights of one condition have raised or cleared may move another's baseline
    moved = {one for one in looked.several if alarms.get(one) != past.alarms.get(one)}
    return tuple(sorted(looked.waiting | moved))
