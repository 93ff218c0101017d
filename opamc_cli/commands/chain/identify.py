"""`opamc identify`: which segment is which motion of which cycle."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import ExitCode
from opamc_cli.storage.schemas import files


def identify(
    segments: Annotated[
        Path | None,
        typer.Argument(metavar="[SEGMENTS]", help="Segment table; default: that in --out."),
    ] = None,
    reference: Annotated[
        Path | None,
        typer.Option(metavar="MOTIONS", help="Motion table whose reference cycles are taken."),
    ] = None,
    reference_run: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Run in which the reference cycle is looked for."),
    ] = None,
    runs: options.MovedRuns = None,
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Find cycles and motions in a segment table; writes motions.parquet."""
    from opamc_cli.config import load_config
    from opamc_cli.stages.chain import identify as stage
    from opamc_cli.stages.chain.compared.speeds import of_another_speed
    from opamc_cli.stages.chain.cycles.reference import why_untold
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas

    forgo_pandas()
    output = Output(as_json, quiet)
    with output_lock(out), output.steps() as steps:
        outcome = stage.run(
            segments or out / files.SEGMENTS,
            load_config(config, overrides or ()),
            out,
            reference=reference,
            reference_run=reference_run,
            moved_to=runs or (),
            jobs=jobs,
            watch=steps("identify"),
        )
    found = [
        {"run": run, "axis": axis, "cycles": cycles, "unidentified": unidentified}
        for (run, axis), (cycles, unidentified) in outcome.cycles().items()
    ]
    for note in outcome.notes:
        output.note(note)
    output.result(
        {"written": str(outcome.path), "series": found, "notes": list(outcome.notes)},
        *(
            f"{f['run']} axis {f['axis']}: {f['cycles']} cycles, "
            f"{f['unidentified']} segments unidentified"
            for f in found
        ),
        str(outcome.path),
    )
    left_out = [f"{run}: {of_another_speed(r)}" for run, r in outcome.other_speeds.items()]
    failed = [*map(str, outcome.errors), *left_out]
    if failed or any(each["cycles"] for each in found):
        raise typer.Exit(output.failures(failed, len(found)))
    output.failure(f"{outcome.path}: no cycle was told: {why_untold(outcome.table)}")
    raise typer.Exit(ExitCode.NOT_ENOUGH_DATA)
