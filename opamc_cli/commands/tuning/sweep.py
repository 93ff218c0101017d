"""`opamc sweep`: which delay and order separate two sets of runs."""

import re
from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal import options
from opamc_cli.commands.terminal.output import Output
from opamc_cli.errors import UsageError
from opamc_cli.storage.schemas import files


def sweep(
    baseline: Annotated[
        list[Path],
        typer.Option(
            "--baseline", metavar="RUNS", help="Runs of the healthy state; may be repeated."
        ),
    ],
    target: Annotated[
        list[Path] | None,
        typer.Option("--target", metavar="RUNS", help="Runs to set against them; may be repeated."),
    ] = None,
    tau: Annotated[str, typer.Option(metavar="FIRST:LAST", help="Delays, in samples.")] = "1:25",
    order: Annotated[str, typer.Option(metavar="FIRST:LAST", help="Orders, 3..7.")] = "4:5",
    out: options.Out = options.DEFAULT_OUT,
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    jobs: options.Jobs = options.ALL_CORES,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Compute divergences over delays and orders; writes sweep.parquet and sweep.png."""
    taus, orders = _span("--tau", tau, 1, 10_000), _span("--order", order, 3, 7)

    from opamc_cli.config import load_config
    from opamc_cli.stages.chain.to_patterns import FILES, run_chain
    from opamc_cli.stages.tuning import sweep as stage
    from opamc_cli.stages.tuning.sweep_figure import write_figure
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.result import published, published_text, result

    output = Output(as_json, quiet)
    effective = load_config(config, overrides or ())
    chain = [f"{role}/{name}" for role in ("baseline", "target") for name in FILES]
    with (
        output_lock(out),
        result(out, files.SWEEP, files.SWEEP_FIGURE, *chain) as staged,
        output.steps() as steps,
    ):
        normal = run_chain(baseline, effective, staged / "baseline", jobs=jobs, progress=steps)
        errors, done = list(normal.errors), list(normal.runs_done)
        motions = None
        if target:
            other = run_chain(
                target,
                effective,
                staged / "target",
                reference=normal.motions,
                jobs=jobs,
                progress=steps,
            )
            motions = other.motions
            errors += other.errors
            done += other.runs_done
        outcome = stage.run(
            normal.motions,
            effective,
            staged,
            taus=taus,
            orders=orders,
            target=motions,
            jobs=jobs,
            watch=steps("sweep"),
        )
        write_figure(outcome.table, staged / files.SWEEP_FIGURE)
    output.passed_over([*baseline, *(target or ())])
    errors += outcome.errors
    best = outcome.best()
    output.result(
        {"written": str(published(outcome.path)), "best": best, "base": effective.score.base},
        *(
            f"axis {b['axis']} order {b['order']}: separates best at tau {b['tau']} "
            f"(JSD {b['jsd_baseline']:.3f} against {b['jsd_target']:.3f}, KS {b['ks']:.2f}); "
            f"(4-2) gives {', '.join(map(str, b['tau_opt']))}"
            for b in best
        ),
        str(published(outcome.path)),
        str(out / files.SWEEP_FIGURE),
    )
    raise typer.Exit(output.failures([published_text(str(error)) for error in errors], len(done)))


def _span(option: str, text: str, smallest: int, largest: int) -> list[int]:
    """Read FIRST:LAST, both included, or one number."""
    wanted = f"{option} {text}: write it as FIRST:LAST within {smallest}..{largest}, such as"
    first, separator, last = text.partition(":")
    try:
        start, stop = int(first), int(last if separator else first)
    except ValueError as error:
        parts = [int(part) for part in re.findall("[0-9]+", text)[:2]]
        meant = sorted(parts) if len(parts) == 2 else [smallest, min(largest, 25)]
        msg = f"{wanted} {option} {meant[0]}:{meant[-1]}"
        raise UsageError(msg) from error
    if not smallest <= start <= stop <= largest:
        msg = f"{option} {text}: must rise within {smallest}..{largest}, as FIRST:LAST"
        raise UsageError(msg)
    return list(range(start, stop + 1))
