"""`opamc diagnose`: which joint has changed against a baseline, how sure, and why."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import ExitCode

IN_PART = "in part: what was not used, or not compared, is said on standard error"
"""Said below a verdict that may read as if it were of all that was recorded."""


def diagnose(
    baseline: Annotated[
        list[Path],
        typer.Option(
            "--baseline",
            metavar="RUNS",
            help="Runs of the healthy state: files, folders, quoted patterns; may be repeated.",
        ),
    ],
    target: Annotated[
        list[Path],
        typer.Option("--target", metavar="RUNS", help="Runs to be judged; may be repeated."),
    ],
    model: Annotated[
        Path | None,
        typer.Option("--lda", metavar="FILE", help="Trained discriminant, from `score --learn`."),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    jobs: options.Jobs = options.ALL_CORES,
    exit_zero: options.ExitZero = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
) -> None:
    """Run all stages on two sets of runs; writes verdict.json, report.html and every table."""
    from opamc_cli.stages.processes.documentation import forgo_compiler, forgo_documentation

    forgo_documentation()
    from opamc_cli.commands.terminal.tables import doubtful, verdict_lines, verdict_table
    from opamc_cli.config import load_config
    from opamc_cli.stages import diagnose as stage
    from opamc_cli.stages.chain.compared import discriminants
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas

    forgo_compiler()
    forgo_pandas()
    output = Output(as_json, quiet)
    effective = load_config(config, overrides or ())
    with output_lock(out), output.steps() as progress:
        outcome = stage.run(
            baseline,
            target,
            effective,
            out,
            models=discriminants.read_models(model) if model else None,
            jobs=jobs,
            progress=progress,
        )
    output.passed_over([*baseline, *target])
    for warning in outcome.warnings:
        output.failure(warning)
    output.notes([note for note in outcome.notes if note not in outcome.warnings], verbose)
    output.result(
        {
            **outcome.verdict,
            "verdict": str(outcome.verdict_path),
            "report": str(outcome.report_path),
        },
        *([verdict_table(outcome.verdict)] if verbose else verdict_lines(outcome.verdict)),
        *([IN_PART] if outcome.errors else []),
        f"report: {outcome.report_path}",
        urgent=outcome.exit_code is not ExitCode.DONE or bool(doubtful(outcome.verdict)),
    )
    failed = output.failures([str(error) for error in outcome.errors], outcome.n_runs)
    if exit_zero and outcome.exit_code is ExitCode.UNHEALTHY:
        raise typer.Exit(ExitCode.DONE)
    # what could not be judged weighs more than a run that failed: the verdict is incomplete
    raise typer.Exit(outcome.exit_code or failed)
