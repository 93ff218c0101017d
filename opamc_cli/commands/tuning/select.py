"""`opamc select`: the order and γ that healthy data themselves call for."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.storage.schemas import files


def select(
    motions: Annotated[
        Path | None,
        typer.Argument(metavar="[MOTIONS]", help="The baseline's motions; default: in --out."),
    ] = None,
    orders: Annotated[
        list[int] | None,
        typer.Option("--order", min=3, max=7, help="An order to rate; default 3, 4, 5, 6."),
    ] = None,
    gammas: Annotated[
        list[float] | None,
        typer.Option("--gamma", min=0.01, help="A scale factor to rate; default 0.5, 1, 2, 4."),
    ] = None,
    runs: options.MovedRuns = None,
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Choose order and γ on the baseline alone; writes selection.parquet.

    Rated is how much better healthy segments fit their own motion than another one.
    """
    from opamc_cli.config import load_config
    from opamc_cli.stages.tuning import select as stage
    from opamc_cli.storage.files.lock import output_lock

    output = Output(as_json, quiet)
    with output_lock(out), output.steps() as steps:
        outcome = stage.run(
            motions or out / files.MOTIONS,
            load_config(config, overrides or ()),
            out,
            orders=orders or (3, 4, 5, 6),
            gammas=gammas or (0.5, 1.0, 2.0, 4.0),
            moved_to=runs or (),
            jobs=jobs,
            watch=steps("select"),
        )
    for warning in outcome.warnings:
        output.note(warning)
    rows = outcome.table.to_pylist()
    output.result(
        {
            "written": str(outcome.path),
            "order": outcome.order,
            "gamma": outcome.gamma,
            "rated": rows,
            "warnings": list(outcome.warnings),
        },
        *(
            f"axis {row['axis']} order {row['order']} gamma {row['gamma']:g}: "
            f"{row['self_consistency']:.3g}"
            for row in rows
            if row["self_consistency"] is not None
        ),
        f"best over all axes: order {outcome.order}, gamma {outcome.gamma:g}; use it with",
        f"  --set patterns.orders=[{outcome.order}] --set patterns.gamma={outcome.gamma:g}",
        str(outcome.path),
    )
    raise typer.Exit(output.failures([str(error) for error in outcome.errors], len(rows)))
