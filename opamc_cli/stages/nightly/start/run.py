"""Reads a cell's recordings, does the robots' nights that are new, and settles what follows.

Order of the writing, so that a kill at any instant costs work and nothing else: a night's folder
is renamed into its place, then the night is recorded in the history; what follows from the history
(alarms, pages, metrics) is made from it anew, and only then is anybody told.
"""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from opamc_cli import __version__
from opamc_cli.config.cell import CellConfig
from opamc_cli.errors import UsageError
from opamc_cli.stages.nightly.inputs.recordings import (
    CellRecordings,
    Recording,
    find_recordings,
    said_of_strays,
    some,
)
from opamc_cli.stages.nightly.inputs.strangers import (
    said_of_baselines,
    several_named,
    without_strangers,
)
from opamc_cli.stages.nightly.plan import PlannedNight, RobotPlan, Situation, plan_robot
from opamc_cli.stages.nightly.settle import OF_NIGHT, settle_cell
from opamc_cli.stages.nightly.summary import Summary
from opamc_cli.stages.nightly.workers import cluster
from opamc_cli.stages.nightly.workers.night import (
    COMPUTE,
    Input,
    NightJob,
    ProgramJob,
    ProgramResult,
)
from opamc_cli.stages.nightly.workers.workers import Broken, run_all
from opamc_cli.stages.processes.parallel import Steps, unshown
from opamc_cli.storage.files.folders import remove_folder, replace_folder
from opamc_cli.storage.history import (
    UNJUDGED,
    Event,
    History,
    MeasureRow,
    NightRow,
    VerdictRow,
    as_notes,
    begun_anew,
)
from opamc_cli.storage.logs import copy_name
from opamc_cli.storage.schemas import files

WORK, KEPT, COPIES = ".opamc-work", ".kept", ".copies"
"""Folders below `out` that nobody needs to look into."""

MOST_REASONS = 3
"""Files of a night that are named when they cannot be used."""


@dataclass(frozen=True)
class Wanted:
    """Which nights are asked for; None: all."""

    night: str | None = None
    since: str | None = None
    """YYYY-MM-DD, as `night`."""
    robots: tuple[str, ...] | None = None
    """Names."""

    def has(self, night: str) -> bool:
        """Whether a night is asked for."""
        return self.night in (None, night) and (self.since is None or night >= self.since)


@dataclass
class CellOutcome:
    """What a start did."""

    planned: dict[tuple[str, str], PlannedNight] = field(default_factory=dict)
    """Every night that was looked at by robot and night, with why it was to be done."""
    done: list[tuple[str, str]] = field(default_factory=list)
    """Robot and night of those that were judged or taken into a baseline."""
    failed: list[tuple[str, str, str]] = field(default_factory=list)
    """Robot, night and why; of nights that were judged in part as well."""
    unjudged: set[tuple[str, str]] = field(default_factory=set)
    """Robot and night of those with a joint that could not be judged."""
    absent: list[str] = field(default_factory=list)
    """Sentences that say of what was asked for that there is no recording of it."""
    thinned: list[Event] = field(default_factory=list)
    """Baselines that have lost recordings."""
    gathering: dict[str, list[Event]] = field(default_factory=dict)
    """Conditions of which no night is judged yet, by robot."""
    strays: list[Event] = field(default_factory=list)
    """Recordings that lie in the place of a night and are called otherwise."""
    ended: str = ""
    """Why the start came to an end before all was done; empty if it did not."""
    robots: tuple[str, ...] = ()
    """Those that were looked at."""
    summary: Summary = field(default_factory=lambda: Summary(()))
    """How all robots of the cell stand now."""

    def plan(self, night: PlannedNight) -> None:
        """Note that a night is looked at, perhaps again in the light of others."""
        place = (night.robot, night.night)
        if place in self.planned:
            if not night.why:
                return
            self.done = [one for one in self.done if one != place]
            self.failed = [one for one in self.failed if one[:2] != place]
        self.planned[place] = night


def plan(cell: CellConfig, source: str, history: History, wanted: Wanted) -> CellOutcome:
    """Say what would be done, without doing it."""
    recordings = find_recordings(cell, history, wanted.robots, cell.out / COPIES)
    outcome = CellOutcome(strays=_strays(recordings))
    past = _Past(cell, history)
    recordings = _own(recordings, past)
    for robot in recordings.by_robot:
        planned = _robot_plan(cell, source, past, recordings, robot, wanted, None)
        for night in planned.nights:
            if wanted.has(night.night):
                outcome.plan(night)
    _look_for_absent(cell, recordings, past, wanted, outcome)
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
    outcome = CellOutcome()
    progress("looking for recordings")
    recordings = find_recordings(cell, history, wanted.robots, cell.out / COPIES)
    outcome.strays = _strays(recordings)
    past = _Past(cell, history)
    recordings = _own(recordings, past)
    outcome.thinned += [
        Event(
            one.night,
            robot,
            None,
            "lacking",
            f"its baseline: {one.log.path} has the same bytes as {other.log.path} of "
            f"{other.log.robot}",
        )
        for robot, one, other in said_of_baselines(
            recordings.baseline_by_robot, recordings.by_robot
        )
    ]
    outcome.robots = tuple(sorted(recordings.by_robot))
    whole = wanted == Wanted()
    _look_for_absent(cell, recordings, past, wanted, outcome)
    tried: set[tuple[str, str, str]] = set()
    robots, n_before = outcome.robots, -1
    while True:
        # a round that found nothing to do has nothing to wait for
        known = {key[:2] for key in tried} if len(tried) > n_before else None
        n_before = len(tried)
        jobs_of: dict[tuple[str, str], PlannedNight] = {}
        waiting, several = set(), set()
        for robot in robots:
            planned = _robot_plan(cell, source, past, recordings, robot, wanted, known)
            if planned.waiting:
                waiting.add(robot)
            if planned.several_conditions:
                several.add(robot)
            _keep_baselines(history, past, recordings.by_robot[robot], robot, planned, outcome)
            for night in planned.nights:
                place = (robot, night.night, night.key)
                if not wanted.has(night.night) or place in tried:
                    continue
                outcome.plan(night)
                if not night.why:
                    continue
                tried.add(place)
                if any(one.baseline for one in night.comparisons):
                    jobs_of[robot, night.night] = night
                else:
                    _record_unjudged(cell, history, night, outcome)
        # the newest night first: it is what the morning asks for
        todo = sorted(jobs_of.values(), key=lambda night: (night.night, night.robot), reverse=True)
        if todo:
            works = [_job(cell, source, night) for night in todo]
            watch = progress("nights")
            watch(0, len(works))
            for n_done, (job, answer) in enumerate(
                _answers(cell, works, jobs, scheduler, outcome), start=1
            ):
                night = jobs_of[job.robot, job.night]
                last = past.recorded.get(job.robot, {}).get(job.night)
                attempts = last.attempts if last and last.key == night.key else 0
                _record(cell, history, night, job, answer, attempts, outcome)
                watch(n_done, len(works))
        progress("alarms and pages")
        outcome.summary = settle_cell(cell, source, history, outcome.robots, whole=whole)
        alarms = history.spans()
        # an alarm that nights of one condition have raised or cleared may move another's baseline
        waiting |= {one for one in several if alarms.get(one) != past.alarms.get(one)}
        if not waiting or outcome.ended:
            break
        robots = tuple(sorted(waiting))
        past = _Past(cell, history)
    shutil.rmtree(cell.out / WORK, ignore_errors=True)
    _drop_copies(cell.out / COPIES, [*outcome.planned.values()])
    return outcome


def _keep_baselines(
    history: History,
    past: "_Past",
    own: Sequence[Recording],
    robot: str,
    planned: RobotPlan,
    outcome: CellOutcome,
) -> None:
    """Remember the baselines that are complete, and forget what there is nothing of any more."""
    for key, members in planned.complete.items():
        if past.pinned.get(robot, {}).get(key) != list(members):
            history.pin_baseline((robot, *key), members)
    if not planned.waiting:
        _forget(history, past, robot, own, planned)
    said = [Event(night, robot, None, "thinned", text) for night, text in planned.thinned]
    outcome.thinned += [one for one in said if one not in outcome.thinned]
    outcome.gathering[robot] = [
        Event(night, robot, None, "gathering", text) for night, text in planned.gathering
    ]


def open_history(cell: CellConfig, *, read_only: bool = False) -> History:
    """Open a cell's history."""
    return History(cell.out / files.HISTORY, read_only=read_only)


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


class _Past:
    """What the history knows, by robot."""

    def __init__(self, cell: CellConfig, history: History) -> None:
        self.recorded: dict[str, dict[str, NightRow]] = {}
        for (robot, night), row in history.nights().items():
            self.recorded.setdefault(robot, {})[night] = row
        self.pinned: dict[str, dict[tuple[str, str, str], list[str]]] = {}
        for (robot, *key), nights in history.baselines().items():
            self.pinned.setdefault(robot, {})[key[0], key[1], key[2]] = nights
        self.begun: dict[str, list[str]] = {}
        for robot, night in begun_anew(history.declared()):
            self.begun.setdefault(robot, []).append(night)
        self.alarms = history.spans()
        self.removed: dict[str, list[str]] = {}
        for robot, reports in history.reports().items():
            # those of before are pruned, by a start that may have been killed at it
            for night in list(reports)[-cell.keep.reports :]:
                places = [cell.out / report for report in reports[night]]
                files_of = [p for at in places for p in (at, at.with_name(files.VERDICT))]
                if not all(map(Path.is_file, files_of)):
                    self.removed.setdefault(robot, []).append(night)


def _strays(recordings: CellRecordings) -> list[Event]:
    return [
        Event(path, robot, None, "stray", said_of_strays([path]))
        for robot, path in recordings.strays
    ]


def _forget(
    history: History, past: _Past, robot: str, own: Sequence[Recording], planned: RobotPlan
) -> None:
    """Forget what became of nights that there is nothing of, and reports that are gone for good."""
    there = {one.night for one in own}
    # older ones are cleared away by age, and their logs may be out of reach all together
    last = max(there, default="9999")
    lost = [
        night
        for night, row in past.recorded.get(robot, {}).items()
        if night not in there and (not night or (night > last and row.status in UNJUDGED))
    ]
    if lost:
        history.forget_nights(robot, lost)
    to_do = {night.night for night in planned.nights if night.why}
    gone = [night for night in past.removed.get(robot, ()) if night not in to_do]
    if gone:
        text = f"the results of {some(gone)} are gone, and not all that they were made from is left"
        history.forget_reports(robot, gone, [Event(gone[-1], robot, None, "lacking", text)])


def _own(recordings: CellRecordings, past: _Past) -> CellRecordings:
    own = without_strangers(
        recordings.by_robot, recordings.baseline_by_robot, recordings.beside, past.recorded
    )
    return replace(recordings, by_robot=own)


def _robot_plan(
    cell: CellConfig,
    source: str,
    past: _Past,
    recordings: CellRecordings,
    robot: str,
    wanted: Wanted,
    tried: set[tuple[str, str]] | None,
) -> RobotPlan:
    """Say what is to be done of a robot; `tried`: its nights that were, None: wait for none."""
    config = cell.diagnosis_of(robot, source)
    axes = cell.axes_of(robot)
    situation = Situation(
        baseline=cell.baseline,
        fixed=recordings.baseline_by_robot[robot],
        gone=recordings.gone_by_robot[robot],
        gone_fixed=recordings.gone_of_baseline[robot],
        begun=past.begun.get(robot, ()),
        pinned=past.pinned.get(robot, {}),
        recorded=past.recorded.get(robot, {}),
        removed=past.removed.get(robot, ()),
        config_hash=config.digest() + ("" if axes is None else f" axes {axes}"),
        alarms=past.alarms.get(robot, ()),
        is_to_come=lambda night: (
            tried is not None and wanted.has(night) and (robot, night) not in tried
        ),
    )
    return plan_robot(robot, recordings.by_robot[robot], situation)


def _look_for_absent(
    cell: CellConfig,
    recordings: CellRecordings,
    past: _Past,
    wanted: Wanted,
    outcome: CellOutcome,
) -> None:
    """Say where there is nothing of what was asked for: it may be mistyped, or out of reach."""
    if not any(recordings.by_robot.values()):
        named = wanted.robots or (None if cell.robots == "auto" else tuple(cell.robots))
        names = "" if named is None else f" of {some(named)}"
        outcome.absent.append(
            f"{cell.runs}: no file{names} fits this pattern any more; is its folder there?"
        )
        return
    if wanted.night is None and wanted.since is None:
        return
    what = f"of {wanted.night}" if wanted.night else f"since {wanted.since}"
    without = [
        robot
        for robot, own in recordings.by_robot.items()
        if not any(map(wanted.has, {*(one.night for one in own), *past.recorded.get(robot, ())}))
    ]
    # robots that rest are no news to who asks for all nights since one
    if without and (wanted.night or len(without) == len(recordings.by_robot)):
        outcome.absent.append(f"no recording {what} of {some(without)}")
        night = wanted.night or wanted.since or ""
        outcome.failed += [(robot, night, f"no recording {what}") for robot in without]


def _job(cell: CellConfig, source: str, night: PlannedNight) -> NightJob:
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


def _drop_copies(copies: Path, planned: Sequence[PlannedNight]) -> None:
    """Keep copies of baselines only: every night needs them, and a target is not read again."""
    baselines = (one for night in planned for each in night.comparisons for one in each.baseline)
    keep = {copy_name(one.log) for one in baselines if one.log.remote}
    for copy in copies.iterdir() if copies.is_dir() else ():
        if copy.name not in keep:
            copy.unlink(missing_ok=True)


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


def _record_unjudged(
    cell: CellConfig, history: History, night: PlannedNight, outcome: CellOutcome
) -> None:
    """Record a night that has nothing to be compared with, or no recording that can be used."""
    reasons = [one.facts.error for one in night.broken]
    reasons += [one.missing for one in night.comparisons]
    why = "; ".join(_first(list(dict.fromkeys(filter(None, reasons)))))
    status = "baseline" if night.in_baseline else "failed"
    if night.night:  # else it would be the folder of all nights
        remove_folder(cell.out / night.robot / night.night, of=OF_NIGHT)
    row = NightRow(night.robot, night.night, night.key, status, 0, why, as_notes(night.notes))
    history.record_night(row)
    _note(outcome, row)


def _record(
    cell: CellConfig,
    history: History,
    night: PlannedNight,
    job: NightJob,
    answer: tuple[ProgramResult, ...] | Broken,
    attempts: int,
    outcome: CellOutcome,
) -> None:
    place = (night.robot, night.night, night.key)
    if isinstance(answer, Broken):
        if answer.kind == "refused":
            # not the recordings' fault: the disk is full, or a folder cannot be written
            raise UsageError(answer.text)
        remove_folder(cell.out / night.robot / night.night, of=OF_NIGHT)
        row = NightRow(*place, "broken", attempts + 1, answer.text)
        history.record_night(row)
        _note(outcome, row)
        return
    why = list(_first([one.facts.error for one in night.broken]))
    why += [sentence for result in answer for sentence in result.failures]
    judged = [result for result in answer if result.files and result.axes]
    notes = [*night.notes, *(note for result in answer for note in result.notes)]
    folder = Path(night.robot) / night.night
    if judged:
        contents: dict[str, bytes] = {}
        for index, result in enumerate(judged):
            # the worst program's at the top, where scripts look
            below = "" if index == 0 else f"{_safe(result.program)}/"
            contents |= {below + name: content for name, content in result.files.items()}
        replace_folder(cell.out / folder, contents, of=OF_NIGHT)
    else:  # what an earlier start found must not pass for this night
        remove_folder(cell.out / folder, of=OF_NIGHT)
    status = "failed" if not judged else "partial" if why else "done"
    row = NightRow(*place, status, 0, "; ".join(why), as_notes(notes))
    verdicts, measures = [], []
    programs = {one.program: one for one in job.programs}
    if any(axis.state == "insufficient-data" for result in judged for axis in result.axes):
        outcome.unjudged.add(place[:2])
    for index, result in enumerate(judged):
        wanted = programs[result.program]
        place_of = folder if index == 0 else folder / _safe(result.program)
        for axis in result.axes:
            verdicts.append(
                VerdictRow(
                    night.robot,
                    result.program,
                    axis.axis,
                    night.night,
                    axis.state,
                    axis.health_index,
                    axis.p_value,
                    axis.cause,
                    0,
                    axis.temperature_c,
                    wanted.payload_kg,
                    wanted.speed_percent,
                    len(wanted.targets),
                    (place_of / files.REPORT).as_posix(),
                    job.config.digest(),
                    __version__,
                )
            )
            measures.append(
                MeasureRow(
                    night.robot,
                    result.program,
                    axis.axis,
                    night.night,
                    wanted.baseline_name,
                    axis.log_distance,
                    axis.log_common,
                    axis.effect,
                    int(axis.harmless),
                    axis.reason,
                )
            )
    before = {
        (one["program"], one["axis"]): one["state"]
        for one in history.rows(
            "SELECT program, axis, state FROM verdict WHERE robot = ? AND night = ?", place[:2]
        )
    }
    news = []
    for one in verdicts:
        was = before.get((one.program, one.axis), one.state)
        if was != one.state:
            text = f"{one.night} axis {one.axis} {one.state}, was {was} ({night.why})"
            news.append(Event(one.night, one.robot, one.axis, "judged-anew", text))
    for result in judged:
        held = next(one for one in night.comparisons if one.program == result.program)
        wrong = [*result.of_baseline, *several_named(held.baseline)]
        if wrong:
            # dated by the baseline: the same of all nights that are held against it
            last = max(one.night for one in held.baseline)
            text = f"its baseline: {'; '.join(_first(wrong))}"
            news.append(Event(last, night.robot, None, "lacking", text))
    history.record_night(row, verdicts, measures, news)
    _note(outcome, row)


def _first(reasons: Sequence[str]) -> Iterator[str]:
    """Yield some of the reasons: hundreds of broken files are one line."""
    yield from reasons[-MOST_REASONS:]  # paths go with the nights
    if len(reasons) > MOST_REASONS:
        yield f"and {len(reasons) - MOST_REASONS} more files"


def _note(outcome: CellOutcome, row: NightRow) -> None:
    if row.status not in UNJUDGED:
        outcome.done.append((row.robot, row.night))
    if row.why:
        outcome.failed.append((row.robot, row.night, row.why))


def _safe(program: str) -> str:
    """Return a program's name as the name of a folder."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in program).lstrip(".") or "_"
