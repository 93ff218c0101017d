"""All stages in a row: from two sets of runs to a verdict and a report."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from opamc_cli.config import Config
from opamc_cli.errors import ExitCode, InputError, NotEnoughDataError, OpamcError
from opamc_cli.stages.chain import score, to_patterns
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.stages.chain.cycles.taught import taught_anew
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.processes.parallel import Steps, unshown
from opamc_cli.stages.verdict import findings, verdict
from opamc_cli.stages.verdict.agreement.compare import Agreement
from opamc_cli.stages.verdict.agreement.duplicates import repeated
from opamc_cli.stages.verdict.agreement.unjudged import refuse_all
from opamc_cli.stages.verdict.decision import Decided, decide
from opamc_cli.stages.verdict.state import DRY
from opamc_cli.stages.verdict.wording.causes import of_taught_points, taught_points
from opamc_cli.stages.verdict.wording.reasons import explains_little, is_excused
from opamc_cli.storage.files.result import published_text, result
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import SEGMENTS
from opamc_cli.storage.sources import (
    RunSource,
    check_comparable,
    other_conditions,
    other_robot,
)
from opamc_cli.storage.tables import read_table

if TYPE_CHECKING:
    from opamc_cli.stages.chain.compared.discriminants import LatentModels

FILES = (
    files.VERDICT,
    files.REPORT,
    *score.FILES,
    files.FINDINGS,
    *(f"{role}/{name}" for role in ("baseline", "target") for name in to_patterns.FILES),
)
"""What a diagnosis leaves in its folder; the verdict vouches for the others."""

LEAST_SHARE = 0.05
"""Of the change: causes that explain less together are not named, they would lead to the wrong
part. A fault that explains less beside cold grease is: it is named first, however little it is."""


@dataclass(frozen=True)
class DiagnoseOutcome:
    """What `run` did."""

    verdict: dict[str, Any]
    """Content of verdict.json."""
    verdict_path: Path
    report_path: Path
    """With `verdict_path`: the files that were written."""
    exit_code: ExitCode
    """What the verdict ends with."""
    n_runs: int
    """Runs that went through."""
    errors: tuple[OpamcError, ...]
    """One for each run, or axis of a run, that could not be used."""
    notes: tuple[str, ...]
    """What is worth knowing besides."""
    n_of_baseline: int = 0
    """How many of the errors, the first ones, are the baseline's."""
    in_part: frozenset[int] = frozenset()
    """Axes of which not all of the target's recordings could be used."""
    warnings: tuple[str, ...] = ()
    """Those of the notes that nobody may miss: what differs between the recordings of both sides,
    and which faults would not be told."""


def run(
    baseline: Sequence[Path],
    target: Sequence[Path],
    config: Config,
    out: Path,
    *,
    models: "LatentModels | None" = None,
    jobs: int = 1,
    progress: Steps = unshown,
    kept: KeptResults | None = None,
    figures_of_healthy: bool = True,
    worded: Callable[[str], str] = str,
    nights_in_folders: bool = False,
) -> DiagnoseOutcome:
    """Compare target runs with baseline runs, joint by joint.

    Parameters
    ----------
    baseline, target
        Run files and folders of them.
    config
        All options.
    out
        Folder of all tables, verdict.json and report.html.
    models
        Trained discriminants, for the latent axis.
    jobs
        Worker processes.
    progress
        Called with the name of each step as it begins.
    kept
        Where results of the same work on the baseline may lie.
    figures_of_healthy
        Whether joints that are healthy have their part in the report's figures, which take longer
        than the diagnosis of a short recording.
    worded
        How a note is put where recordings lie elsewhere than their user knows.
    nights_in_folders
        Whether a folder whose name is a date is a night, whatever `started_at` says.

    Raises
    ------
    OpamcError
        If the runs cannot be compared, or no run of one side can be used.
    """
    with result(out, *FILES) as staged:
        outcome = _diagnose(
            *(baseline, target, config, staged, models, jobs, progress, kept),
            *(figures_of_healthy, worded, nights_in_folders),
        )
    return replace(
        outcome,
        verdict_path=out / files.VERDICT,
        report_path=out / files.REPORT,
        errors=tuple(type(error)(published_text(str(error))) for error in outcome.errors),
    )


def _diagnose(
    baseline: Sequence[Path],
    target: Sequence[Path],
    config: Config,
    out: Path,
    models: "LatentModels | None",
    jobs: int,
    progress: Steps,
    kept: KeptResults | None,
    figures_of_healthy: bool,
    worded: Callable[[str], str],
    nights_in_folders: bool,
) -> DiagnoseOutcome:
    _check_before(baseline, target)
    if config.joint.library:
        _cause().library_of(config.joint)  # a mistake in it is better told now than at the end
    repeats = repeated(baseline, target, kept)
    agreement = Agreement(config.identify)
    normal = run_chain(
        baseline,
        config,
        out / "baseline",
        without=repeats.baseline,
        check=partial(agreement.check, "baseline", kept=kept),
        jobs=jobs,
        kept=kept,
        progress=lambda stage: progress(f"baseline: {stage}"),
    )
    other = run_chain(
        target,
        config,
        out / "target",
        reference=normal.motions,
        without=repeats.target,
        check=partial(agreement.check, "target", motions=normal.motions),
        jobs=jobs,
        progress=lambda stage: progress(f"target: {stage}"),
    )
    unjudged = agreement.unjudged(normal.motions, other.motions)
    progress("score")
    starts_at = None if nights_in_folders else config.score.day_starts_at
    sides = Sides(read_side(normal.patterns), read_side(other.patterns), starts_at, kept)
    if {key[0] for key in sides.rows[0]} <= unjudged.axes.keys():
        unlike = other_conditions(sides.baseline.sources, sides.target.sources)
        refuse_all(unjudged.axes, unlike)
    scored = score.compare_sides(sides, config, out, models=models)
    decided = decide(sides, config)
    segments = (normal.segments, other.segments)
    causes, in_vain = _causes(decided, segments, config, kept, progress)
    taught = taught_anew(normal.motions, other.motions)
    for axis, cause in causes.items():
        # the path that a model of the joint follows is the logged one, wherever that leads
        resists = cause.get("effect") in DRY and not explains_little(cause)
        if axis in taught and not resists:
            causes[axis] = of_taught_points(taught[axis])
    blind = decided.blind(config.score)
    of_both = (
        repeats.notes,
        normal.notes,
        other.notes,
        scored.notes,
        decided.notes(),
        [taught_points(taught)] if taught else [],
        in_vain,
        blind,
    )
    # what both sides give alike is said once
    every_note = tuple(dict.fromkeys(worded(note) for said in of_both for note in said))
    sources = (*sides.baseline.sources, *sides.target.sources)
    stranger = other_robot(sides.baseline.sources, sides.target.sources)
    tables = [name for name in FILES if name.endswith(".parquet")]
    of_baseline = (
        *(*normal.errors, *unjudged.of_baseline),
        *(*unjudged.sessions_without(sides), *decided.odd_ones()),
    )
    of_target = (
        *(*repeats.errors, *other.errors, *unjudged.errors),
        *unjudged.sessions_at_rest(sides),
        *([InputError(stranger)] if stranger else []),
    )
    in_part = frozenset(axis for error in of_target for axis in error.axes or decided.judgements)
    friction = _friction(decided, config, kept)
    found = findings.Findings(causes, unjudged.axes, unjudged.foreign, friction)
    findings.write_findings(out, found)
    head = verdict.header(sources, every_note, out, tables)
    written = verdict.write(decided, scored, config, out, found, head)
    progress("report")
    from opamc_cli.stages.report import assemble as report  # a mistake is told sooner without it

    title = config.report.title
    page = report.run(out, title=title, figures_of_healthy=figures_of_healthy, kept=kept)
    return DiagnoseOutcome(
        verdict=written.verdict,
        verdict_path=written.path,
        report_path=page.path,
        exit_code=written.exit_code or (ExitCode.NOT_ENOUGH_DATA if stranger else ExitCode.DONE),
        n_runs=len(normal.runs_done) + len(other.runs_done),
        errors=(*of_baseline, *of_target),
        n_of_baseline=len(of_baseline),
        in_part=in_part,
        warnings=(*check_comparable(sides.baseline.sources, sides.target.sources), *blind),
        notes=every_note,
    )


def _causes(
    decided: Decided,
    segments: Sequence[Path],
    config: Config,
    kept: KeptResults | None,
    progress: Steps,
) -> tuple[dict[int, dict[str, Any]], list[str]]:
    """Seek what has changed in each axis that differs.

    Returns
    -------
    dict of int to dict
        By axis; empty where a cause was sought in vain.
    list of str
        Which could not be sought, and why.
    """
    differing = decided.differing() if config.joint.explain else []
    causes: dict[int, dict[str, Any]] = {}
    notes: list[str] = []
    if not differing:
        return causes, notes
    watch, cause, sides = progress("cause"), _cause(), decided.sides
    moving = [cause.moving_samples(side.patterns) for side in (sides.baseline, sides.target)]
    strokes = [cause.strokes_of(read_table(path, "segment", SEGMENTS)) for path in segments]
    for done, axis in enumerate(differing):
        watch(done, len(differing))
        try:
            named = cause.explain(
                axis,
                decided.baseline_sources(axis),
                decided.target_sources(axis),
                config.joint,
                {**moving[0].get(axis, {}), **moving[1].get(axis, {})},
                kept,
                [moves.get(axis, {}) for moves in strokes],
            )
        except (ArithmeticError, LookupError, ValueError, InputError, NotEnoughDataError) as error:
            # a verdict must not be lost because its explanation failed on odd recordings
            notes.append(f"axis {axis}: no cause could be sought ({error})")
            continue
        causes[axis] = named if named.get("explained", 0.0) >= LEAST_SHARE else {}
    return causes, notes


def _friction(decided: Decided, config: Config, kept: KeptResults | None) -> dict[int, float]:
    """Tell by how much the joints' friction differs where some are excused by the others."""
    judged = decided.judgements
    if not config.joint.explain or len(judged) <= 2:
        return {}
    if not any(is_excused(one, config.score) for one in judged.values()):
        return {}
    cause, sides, found = _cause(), decided.sides, {}
    moving = [cause.moving_samples(side.patterns) for side in (sides.baseline, sides.target)]
    for axis in judged:
        sources = (decided.baseline_sources(axis), decided.target_sources(axis))
        spans = {**moving[0].get(axis, {}), **moving[1].get(axis, {})}
        try:
            differs = cause.friction(axis, *sources, config.joint, spans, kept)
        except (ArithmeticError, LookupError, ValueError, InputError, NotEnoughDataError):
            continue  # the others tell without it
        if differs is not None:
            found[axis] = differs
    return found


def _cause() -> ModuleType:
    """Return what models a joint; to load it costs more than to judge a short recording."""
    from opamc_cli.stages.verdict import cause

    return cause


def _check_before(baseline: Sequence[Path], target: Sequence[Path]) -> None:
    """Refuse what cannot be compared before hours are spent on it."""
    sides = []
    for paths in (baseline, target):
        sources = []
        for name, path in find_runs(paths):
            try:
                with Run(path, name) as opened:
                    sources.append(RunSource(name, path, "", opened.n_samples, opened.info))
            except OpamcError:
                continue  # reported with its reason when its turn comes
        sides.append(sources)
    check_comparable(*sides)
