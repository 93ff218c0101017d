"""`opamc segment`: when each joint moves, and how fast its carrier gets."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output


def segment(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN...", help="Run files, folders of them, quoted patterns."),
    ],
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Cut runs into motions, axis by axis; writes segments.parquet."""
    from opamc_cli.config import load_config
    from opamc_cli.stages.chain import segment as stage
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas

    forgo_pandas()
    output = Output(as_json, quiet)
    settings = load_config(config, overrides or ())
    with output_lock(out), output.steps() as steps:
        outcome = stage.run(runs, settings, out, jobs=jobs, watch=steps("segment"))
    output.passed_over(runs)
    found = outcome.by_axis()
    for note in outcome.notes:
        output.note(note)
    output.result(
        {"written": str(outcome.path), "axes": found, "notes": list(outcome.notes)},
        *(
            f"{f['run']} axis {f['axis']}: {f['segments']} {f['kind']}"
            f"{'s' * (f['segments'] != 1)}, {f['in_motion_s']:.1f} s, up to {f['f_max_hz']:.1f} Hz"
            for f in found
        ),
        str(outcome.path),
    )
    raise typer.Exit(output.failures([str(error) for error in outcome.errors], len(found)))
