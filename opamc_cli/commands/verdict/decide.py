"""`opamc decide`: the verdict once more, from tables, with other limits."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import ExitCode


def decide(
    baseline: Annotated[
        Path | None,
        typer.Option(
            "--baseline",
            metavar="FILE",
            help="Pattern table of the baseline; default: that of the diagnosis in --out.",
        ),
    ] = None,
    target: Annotated[
        Path | None,
        typer.Option(
            "--target",
            metavar="FILE",
            help="Pattern table of the target; default: that of the diagnosis in --out.",
        ),
    ] = None,
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    exit_zero: options.ExitZero = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
    verbose: options.Verbose = False,
) -> None:
    """Decide again from patterns, spectra and profiles, without the runs; writes verdict.json.

    Such as with --set score.false_alarm_rate=0.001. Causes are those that a diagnosis found.
    """
    from opamc_cli.commands.terminal.tables import doubtful, verdict_lines, verdict_table
    from opamc_cli.config import load_config
    from opamc_cli.stages.verdict import decide as stage
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.result import result

    output = Output(as_json, quiet)
    effective = load_config(config, overrides or ())
    own, other = stage.default_tables(out)
    with output_lock(out), result(out, *stage.FILES) as staged:
        outcome = stage.run(baseline or own, target or other, effective, out, staged)
    errors = list(map(str, outcome.errors))
    output.notes([note for note in outcome.verdict["notes"] if note not in errors], verbose)
    path = out / stage.FILES[0]
    output.result(
        {**outcome.verdict, "verdict": str(path)},
        *([verdict_table(outcome.verdict)] if verbose else verdict_lines(outcome.verdict)),
        f"verdict: {path}",
        urgent=outcome.exit_code is not ExitCode.DONE or bool(doubtful(outcome.verdict)),
    )
    for error in errors:
        output.failure(error)
    excused = exit_zero and outcome.exit_code is ExitCode.UNHEALTHY
    raise typer.Exit(ExitCode.DONE if excused else outcome.exit_code)
