"""`opamc patterns`: ordinal patterns of the envelope of every identified segment."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import ExitCode
from opamc_cli.storage.schemas import files


def patterns(
    motions: Annotated[
        Path | None,
        typer.Argument(metavar="[MOTIONS]", help="Motion table; default: that in --out."),
    ] = None,
    runs: options.MovedRuns = None,
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Count ordinal patterns of identified segments; writes patterns.parquet, spectra.parquet."""
    from opamc_cli.config import load_config
    from opamc_cli.stages.chain import patterns as stage
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas
    from opamc_cli.storage.files.result import published, result

    forgo_pandas()
    output = Output(as_json, quiet)
    with output_lock(out), result(out, *stage.FILES) as staged, output.steps() as steps:
        outcome = stage.run(
            motions or out / files.MOTIONS,
            load_config(config, overrides or ()),
            staged,
            moved_to=runs or (),
            jobs=jobs,
            watch=steps("patterns"),
        )
    counted = outcome.by_motion()
    output.result(
        {
            "written": str(published(outcome.path)),
            "spectra": str(published(outcome.path).with_name(files.SPECTRA)),
            "profiles": str(published(outcome.path).with_name(files.PROFILES)),
            "motions": counted,
        },
        *(
            f"axis {c['axis']} motion {c['motion']} order {c['order']}: tau {c['tau']}, "
            f"{c['n_patterns']} patterns in {c['segments']} segments"
            for c in counted
        ),
        str(published(outcome.path)),
    )
    if not counted and not outcome.errors:
        where = motions or out / files.MOTIONS
        output.failure(f"{where}: no motion is told, so there is nothing to count")
        raise typer.Exit(ExitCode.NOT_ENOUGH_DATA)
    raise typer.Exit(output.failures([str(error) for error in outcome.errors], len(counted)))
