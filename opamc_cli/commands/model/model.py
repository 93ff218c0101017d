"""`opamc model`: fit a declared joint model, trace what it lacks, close the loop."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from opamc_cli.commands.model.arm import arm
from opamc_cli.commands.model.effects import effects
from opamc_cli.commands.model.shown import (
    fields_table,
    headline,
    loop_tables,
    parameters,
    untestable,
)
from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import ConfigError, ExitCode

if TYPE_CHECKING:
    from rich.console import RenderableType

    from opamc_cli.stages.model.axes import Outcome

app = typer.Typer(
    help="Fit a joint's declared model to runs, trace what it lacks, close the loop.",
    no_args_is_help=True,
)

Runs = Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run files or folders.")]
ModelFile = Annotated[
    Path,
    typer.Option(
        "--model",
        "--config",
        metavar="FILE",
        help="What is declared; default: the shipped `model`, see configs/model.yaml.",
    ),
]
DECLARED = Path("model")
"""Inertia, gravity and friction, gear unknown."""

Axis = Annotated[
    list[int] | None,
    typer.Option("--axis", min=1, help="Axis, counted from 1; may be repeated. Default: all."),
]

app.command()(effects)
app.command()(arm)


MOST_COEFFICIENTS = 4
"""Shown on a terminal; a drive's answer has dozens, all are in fit.parquet."""
MOSTLY = 0.5
"""Share of a motion on which a model was closed, below which its error says little."""

ANOTHER = 2.0
"""Times the error that a model left of its own sealed data, above which a joint is another one:
where it hardly moves, a right one predicts no better than the current's mean."""


@app.command()
def fit(
    runs: Runs,
    model: ModelFile = DECLARED,
    overrides: options.Overrides = None,
    axis: Axis = None,
    out: options.Out = options.DEFAULT_OUT,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Fit the declared effects jointly; writes fit.parquet."""
    from opamc_cli.stages.model import model as stage

    given = (runs, model, overrides, axis, out, jobs)
    _on_axes("fit", stage.fit, _fit_tables, *given, Output(as_json, quiet))


@app.command()
def trace(
    runs: Runs,
    model: ModelFile = DECLARED,
    overrides: options.Overrides = None,
    axis: Axis = None,
    out: options.Out = options.DEFAULT_OUT,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Trace the declared model's residual to its causes; writes candidates.parquet."""
    from opamc_cli.stages.model import model as stage

    given = (runs, model, overrides, axis, out, jobs)
    _on_axes("trace", stage.trace, _trace_tables, *given, Output(as_json, quiet))


@app.command()
def close(
    runs: Runs,
    model: ModelFile = DECLARED,
    overrides: options.Overrides = None,
    axis: Axis = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the decoys.")] = 0,
    out: options.Out = options.DEFAULT_OUT,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Find and add what the declared model lacks; writes loop.json and the extended model."""
    from opamc_cli.config.joint_model import load_joint_model
    from opamc_cli.stages.model import model as stage
    from opamc_cli.stages.report.wording.loop import far_from_noise
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas
    from opamc_cli.storage.files.result import published, result
    from opamc_cli.storage.runs.finding import find_runs

    forgo_pandas()
    output = Output(as_json, quiet)
    declared = load_joint_model(model, overrides or ())
    with (
        output_lock(out),
        result(out, *stage.close_files(out)) as staged,
        _naming(model),
        output.steps() as steps,
    ):
        outcome = stage.close(
            declared, find_runs(runs), axis or (), staged, seed, jobs=jobs, watch=steps("close")
        )
    output.passed_over(runs)
    output.result(
        {"axes": list(outcome.results)},
        *(shown for result in outcome.results for shown in loop_tables(result)),
        *(str(published(path)) for path in outcome.written),
    )
    for entry in outcome.results:
        if quiet and (entry["fails"] or entry["unconfirmed"] or far_from_noise(entry)):
            output.failure(headline(entry))
    # What fails on the sealed data tells nothing for certain. Nothing may be missing, or something
    # of which the sealed data, or nothing here, tell nothing.
    nothing = [entry for entry in outcome.results if entry["verdict"] == "nothing-missing"]
    unknown = any(entry["unconfirmed"] or far_from_noise(entry) for entry in nothing)
    unknown |= any(entry["fails"] for entry in outcome.results)
    _end(outcome, output, ExitCode.NOT_ENOUGH_DATA if unknown else ExitCode.DONE)


@app.command()
def evaluate(
    runs: Runs,
    model: Annotated[
        Path,
        typer.Option("--model", "--config", metavar="FILE", help="The model.yaml of a close."),
    ],
    overrides: options.Overrides = None,
    axis: Axis = None,
    out: options.Out = options.DEFAULT_OUT,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Apply a closed model to other runs, coefficients frozen; writes evaluation.json."""
    from opamc_cli.stages.model.evaluate import evaluate as stage

    given = (runs, model, overrides, axis, out, jobs)
    _on_axes("evaluate", stage, _evaluation, *given, Output(as_json, quiet))


def _unjudged(result: dict[str, Any]) -> list[str]:
    """Say what of an evaluation means little, and why."""
    said = [
        f"the current of {run} has the opposite sign of the one that the model was closed on"
        for run in result["opposite_sign"]
    ]
    said += [f"not applied {entry['effect']}: {entry['why']}" for entry in result["not_applied"]]
    own, axis = result["closed"]["axis"], result["axis"]
    known = result["familiar"]
    most = ANOTHER * result["closed"]["rmse_a"]
    another = known is not None and (known["r2"] or 0.0) < 0 and known["rmse_a"] > most
    if own not in (None, axis):
        said.append(f"the model was closed on axis {own}, and says little of another joint")
    elif another and not result["opposite_sign"]:
        said.append(
            "the model predicts no better than the current's mean even on motion that it knows: "
            "the joint, its load or the unit is another one"
            + (", or what is not applied was most of it" if result["not_applied"] else "")
        )
    if known is not None and known["share"] < MOSTLY:
        said.append(
            f"{1 - known['share']:.0%} of the motion lies where the model was not closed, and says "
            "little of the joint: close it on runs of this program, too"
        )
    return said


def _on_axes(
    step: str,
    work: Callable[..., "Outcome"],
    shown: Callable[[dict[str, Any]], Sequence["RenderableType"]],
    runs: list[Path],
    model: Path,
    overrides: list[str] | None,
    axis: list[int] | None,
    out: Path,
    jobs: int,
    output: Output,
) -> None:
    """Do one step on every axis that was asked for, print what came of it, and end."""
    from opamc_cli.config.joint_model import load_joint_model
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.runs.finding import find_runs

    declared = load_joint_model(model, overrides or ())
    with output_lock(out), _naming(model), output.steps() as steps:
        outcome = work(declared, find_runs(runs), axis or (), out, jobs=jobs, watch=steps(step))
    output.passed_over(runs)
    output.result(
        {"axes": list(outcome.results), "written": [str(path) for path in outcome.written]},
        *(line for result in outcome.results for line in shown(result)),
        *(str(path) for path in outcome.written),
    )
    unjudged = [
        f"axis {result['axis']}: {said}"
        for result in outcome.results
        if "not_applied" in result
        for said in _unjudged(result)
    ]
    for said in unjudged if output.quiet else ():
        output.failure(said)
    _end(outcome, output, ExitCode.NOT_ENOUGH_DATA if unjudged else ExitCode.DONE)


def _end(outcome: "Outcome", output: Output, code: ExitCode = ExitCode.DONE) -> None:
    """Say what the recordings lack and what failed, and end, with a code unless something did."""
    in_part = list(dict.fromkeys(text for one in outcome.results for text in one["in_part"]))
    notes = dict.fromkeys(note for one in outcome.results for note in one["notes"])
    output.notes([note for note in notes if note not in in_part])
    doubts = dict.fromkeys(doubt for one in outcome.results for doubt in one["doubts"])
    for doubt in doubts if output.quiet else ():
        output.failure(doubt)
    failures = [*(str(error) for error in outcome.errors), *in_part]
    raise typer.Exit(output.failures(failures, len(outcome.results)) or code)


@contextmanager
def _naming(model: Path) -> Iterator[None]:
    """Name the model's file in what is wrong with it."""
    from opamc_cli.config.joint_model import line_naming
    from opamc_cli.joint.effects.library import UnknownEffectError
    from opamc_cli.stages.model.declared.users_effects import UserEffectError

    try:
        yield
    except UserEffectError:
        raise
    except ConfigError as error:
        named = isinstance(error, UnknownEffectError) and line_naming(model, error.name)
        msg = f"{model}:{named}: {error}" if named else f"{model}: {error}"
        raise ConfigError(msg) from error


def _fit_tables(result: dict[str, Any]) -> Sequence["RenderableType"]:
    table = fields_table(
        f"Axis {result['axis']}: {result['rmse_a']:.4g} {result['unit']} rms left, condition "
        f"number {result['condition_number']:.3g}",
        "effect",
        "coefficients (95 % interval)",
        "parameters",
    )
    for term in result["terms"]:
        ends = zip(term["low"], term["high"], strict=True)
        spans = ["not known" if low is None else f"{low:.3g} .. {high:.3g}" for low, high in ends]
        each = [
            f"{value:.4g} {unit} ({span})".replace("  ", " ")
            for value, unit, span in zip(term["coefficients"], term["units"], spans, strict=True)
        ]
        more = [f"{len(each) - MOST_COEFFICIENTS} more"] if len(each) > MOST_COEFFICIENTS else []
        shown = ", ".join(each[:MOST_COEFFICIENTS] + more)
        table.add_row(term["effect"], shown, parameters(term["parameters"]))
    apart = [f"the data cannot tell apart: {', '.join(names)}" for names in result["inseparable"]]
    return [table, *apart]


def _trace_tables(result: dict[str, Any]) -> Sequence["RenderableType"]:
    explained = result["explained"]
    domains = ", ".join(dict.fromkeys(explained["domains"]))
    first = (
        f"Axis {result['axis']}: {explained['share']:.0%} of the held-out error can be explained "
        f"without a name, by {domains}"
        if domains
        else f"Axis {result['axis']}: nothing can be explained"
    )
    table = fields_table("Candidates", "effect", "parameters", "held-out gain", "p", "why not")
    for entry in result["candidates"][:10]:
        table.add_row(
            entry["effect"],
            parameters(entry["parameters"]),
            f"{entry['gain']:.1%}",
            f"{entry['p_value']:.2g}",
            entry["why_not"] or "passes",
        )
    return [first, *([table] if result["candidates"] else []), *untestable(result)]


def _evaluation(result: dict[str, Any]) -> Sequence["RenderableType"]:
    unit, closed = result["unit"], result["closed"]
    shown: list[RenderableType] = [
        f"Axis {result['axis']}: error {result['rmse_a']:.4g} {unit}, r2 {result['r2']:.4f}; on "
        f"the sealed data of its own recordings {closed['rmse_a']:.4g} {unit}, {closed['r2']:.4f}"
    ]
    if len(result["runs"]) > 1:
        table = fields_table("Runs", "run", f"error ({unit})", "r2")
        for run in result["runs"]:
            table.add_row(run["run"], f"{run['rmse_a']:.4g}", f"{run['r2']:.4f}")
        shown.append(table)
    known = result["familiar"]
    if known is not None and 0 < known["share"] < 1:
        shown.append(
            f"where the model was closed, {known['share']:.0%} of the motion: error "
            f"{known['rmse_a']:.4g} {unit}, r2 {known['r2']:.4f}"
        )
    return [*shown, *_unjudged(result)]
