"""Records what became of a night: its folder first, then its rows of the history."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from opamc_cli import __version__
from opamc_cli.config.cell import CellConfig
from opamc_cli.errors import UsageError
from opamc_cli.stages.nightly.alarms.together import together
from opamc_cli.stages.nightly.inputs.strangers import several_named
from opamc_cli.stages.nightly.plan.planned import PlannedNight
from opamc_cli.stages.nightly.settle import OF_NIGHT
from opamc_cli.stages.nightly.start.outcome import CellOutcome
from opamc_cli.stages.nightly.workers.night import AxisResult, NightJob, ProgramJob, ProgramResult
from opamc_cli.stages.nightly.workers.workers import Broken
from opamc_cli.storage.files.folders import remove_folder, replace_folder
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import (
    Event,
    MeasureRow,
    NightRow,
    VerdictRow,
    as_notes,
    told_by,
)
from opamc_cli.storage.schemas import files

MOST_REASONS = 3
"""Reasons why files of a night cannot be used that are told."""


def record_unjudged(
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
    outcome.note(row)


def record_judged(
    cell: CellConfig,
    history: History,
    night: PlannedNight,
    job: NightJob,
    answer: tuple[ProgramResult, ...] | Broken,
    attempts: int,
    outcome: CellOutcome,
) -> None:
    """Record what a worker answered.

    Parameters
    ----------
    cell, history
        Where.
    night, job
        What the worker was given.
    answer
        One result for each program, the worst first; or that the worker broke.
    attempts
        Starts in which it broke before.
    outcome
        Takes what became of the night.

    Raises
    ------
    UsageError
        If the worker could not write.
    """
    if isinstance(answer, Broken):
        if answer.kind == "refused":
            # not the recordings' fault: the disk is full, or a folder cannot be written
            raise UsageError(answer.text)
        remove_folder(cell.out / night.robot / night.night, of=OF_NIGHT)
        row = NightRow(night.robot, night.night, night.key, "broken", attempts + 1, answer.text)
        history.record_night(row)
        outcome.note(row)
        return
    judged = [result for result in answer if result.files and result.axes]
    places = _places(Path(night.robot) / night.night, judged)
    _replace_results(cell.out, night, judged, places)
    row = _night_row(night, answer, judged)
    programs = {one.program: one for one in job.programs}
    # of the recordings that are lost nobody knows which joints they were of
    whole = bool(night.broken) or any(any(one.lacking) for one in night.comparisons)
    rows = [
        (
            _verdict(night, programs[result.program], axis, place, job.config.digest()),
            _measure(night, programs[result.program], axis, whole),
        )
        for result, place in zip(judged, places, strict=True)
        for axis in result.axes
    ]
    verdicts = [verdict for verdict, _ in rows]
    if any(one.state == "insufficient-data" for one in verdicts):
        outcome.unjudged.add((night.robot, night.night))
    news = [*_other_verdicts(history, night, verdicts), *_of_baselines(night, judged)]
    history.record_night(row, verdicts, [measure for _, measure in rows], news)
    outcome.note(row)


def _places(folder: Path, judged: Sequence[ProgramResult]) -> list[Path]:
    """Return where each program's results go: the worst one's on top, where scripts look."""
    places = [folder] * len(judged)
    # by name, so that a night's folders are called the same whichever program is the worst
    taken = set(OF_NIGHT)
    for index, result in sorted(enumerate(judged), key=lambda one: one[1].program):
        name = _safe(result.program)
        while name in taken:  # "lift/a" beside "lift_a"
            name += "_"
        taken.add(name)
        if index:
            places[index] = folder / name
    return places


def _replace_results(
    out: Path, night: PlannedNight, judged: Sequence[ProgramResult], places: Sequence[Path]
) -> None:
    folder = Path(night.robot) / night.night
    contents: dict[str, bytes] = {}
    for result, place in zip(judged, places, strict=True):
        below = place.relative_to(folder)
        contents |= {(below / name).as_posix(): data for name, data in result.files.items()}
    if judged:
        replace_folder(out / folder, contents, of=OF_NIGHT)
    else:  # what an earlier start found must not pass for this night
        remove_folder(out / folder, of=OF_NIGHT)


def _night_row(
    night: PlannedNight, answer: Sequence[ProgramResult], judged: Sequence[ProgramResult]
) -> NightRow:
    why = list(_first([one.facts.error for one in night.broken]))
    if not why:
        why = list(dict.fromkeys(said for one in night.comparisons for said in one.lacking))
    why += together([sentence for result in answer for sentence in result.failures])
    notes = [*night.notes, *(note for result in answer for note in result.notes)]
    status = "failed" if not judged else "partial" if why else "done"
    return NightRow(night.robot, night.night, night.key, status, 0, "; ".join(why), as_notes(notes))


def _verdict(
    night: PlannedNight, program: ProgramJob, axis: AxisResult, place: Path, config_hash: str
) -> VerdictRow:
    return VerdictRow(
        robot=night.robot,
        program=program.program,
        axis=axis.axis,
        night=night.night,
        state=axis.state,
        health_index=axis.health_index,
        p_value=axis.p_value,
        cause=axis.cause,
        alarm=0,
        temperature_c=axis.temperature_c,
        payload_kg=program.payload_kg,
        speed_percent=program.speed_percent,
        n_runs=len(program.targets),
        report=(place / files.REPORT).as_posix(),
        config_hash=config_hash,
        version=__version__,
    )


def _measure(night: PlannedNight, program: ProgramJob, axis: AxisResult, whole: bool) -> MeasureRow:
    in_part = (whole or axis.in_part) and axis.state != "insufficient-data"
    return MeasureRow(
        robot=night.robot,
        program=program.program,
        axis=axis.axis,
        night=night.night,
        baseline=program.baseline_name,
        distance=axis.log_distance,
        common=axis.log_common,
        effect=axis.effect,
        harmless=int(axis.harmless),
        reason=told_by(axis.reason)._replace(in_part=in_part).as_reason(),
    )


def _other_verdicts(
    history: History, night: PlannedNight, verdicts: Sequence[VerdictRow]
) -> Iterator[Event]:
    """Say which joints have another state than when the night was judged before."""
    known: Mapping[tuple[str, int], str] = {
        (one["program"], one["axis"]): one["state"]
        for one in history.rows(
            "SELECT program, axis, state FROM verdict WHERE robot = ? AND night = ?",
            (night.robot, night.night),
        )
    }
    for one in verdicts:
        was = known.get((one.program, one.axis), one.state)
        if was != one.state:
            of = f" in program {one.program}" if len({v.program for v in verdicts}) > 1 else ""
            text = f"{one.night} axis {one.axis}{of} {one.state}, was {was} ({night.why})"
            yield Event(one.night, one.robot, one.axis, "judged-anew", text)


def _of_baselines(night: PlannedNight, judged: Sequence[ProgramResult]) -> Iterator[Event]:
    """Say what is wrong with the recordings that a night was held against."""
    for result in judged:
        held = next(one for one in night.comparisons if one.program == result.program)
        wrong = [*result.of_baseline, *several_named(held.baseline)]
        if wrong:
            # dated by the baseline: the same of all nights that are held against it
            last = max(one.night for one in held.baseline)
            text = f"its baseline: {'; '.join(_first(wrong))}"
            yield Event(last, night.robot, None, "lacking", text)


def _first(reasons: Sequence[str]) -> Iterator[str]:
    """Yield some of the reasons, each once: hundreds of broken files are one line."""
    found = together(reasons)
    yield from found[-MOST_REASONS:]  # paths go with the nights
    if len(found) > MOST_REASONS:
        yield f"and {len(found) - MOST_REASONS} more reasons"


def _safe(program: str) -> str:
    """Return a program's name as the name of a folder."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in program).lstrip(".") or "_"
