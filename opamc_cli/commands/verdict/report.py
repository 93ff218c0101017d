"""`opamc report`: one page of an output folder, and the same in the terminal."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal.options import DEFAULT_OUT, ConfigFile, Json, Out, Overrides, Quiet
from opamc_cli.commands.terminal.output import Output


def report(
    out: Out = DEFAULT_OUT,
    baseline: Annotated[
        list[Path] | None,
        typer.Option(
            "--baseline",
            metavar="RUNS",
            help="Where the baseline's runs are, if they were moved; may be repeated.",
        ),
    ] = None,
    target: Annotated[
        list[Path] | None,
        typer.Option(
            "--target",
            metavar="RUNS",
            help="Where the target's runs are, if they were moved; may be repeated.",
        ),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write report.html from what a diagnosis, or score and model close, left in --out."""
    from rich.text import Text

    from opamc_cli.commands.model.shown import headline
    from opamc_cli.commands.terminal.tables import feature_table, verdict_table
    from opamc_cli.config import load_config
    from opamc_cli.errors import InputError
    from opamc_cli.stages.report import assemble as stage
    from opamc_cli.storage.files.lock import output_lock

    settings = load_config(config, overrides or ())
    if not out.is_dir():
        msg = f"{out}: no such folder; name the output folder of `opamc diagnose` with --out"
        raise InputError(msg)
    with output_lock(out):
        outcome = stage.run(
            out, title=settings.report.title, baseline=baseline or (), target=target or ()
        )
    inputs = outcome.inputs
    shown = [
        *([verdict_table(inputs.verdict)] if inputs.verdict is not None else []),
        *([feature_table(inputs)] if inputs.verdict is None and inputs.axes else []),
        *(Text(headline(entry)) for entry in (inputs.loop or {}).get("axes", ())),
    ]
    output = Output(as_json=as_json, quiet=quiet)
    for line in outcome.omitted:
        output.note(f"left out: {line}")
    output.result(
        {
            "report": str(outcome.path),
            "verdict": inputs.verdict,
            "loop": inputs.loop,
            "omitted": list(outcome.omitted),
        },
        *shown,
        Text(f"report: {outcome.path}"),
    )
