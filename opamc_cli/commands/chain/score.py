"""`opamc score`: divergences and features of a target against a baseline."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal.options import DEFAULT_OUT, ConfigFile, Json, Out, Overrides, Quiet
from opamc_cli.commands.terminal.output import Output


def score(
    baseline: Annotated[
        Path, typer.Option("--baseline", metavar="FILE", help="Pattern table of the baseline.")
    ],
    target: Annotated[
        Path, typer.Option("--target", metavar="FILE", help="Pattern table of the target.")
    ],
    model: Annotated[
        Path | None,
        typer.Option("--lda", metavar="FILE", help="Trained discriminant, from --learn."),
    ] = None,
    learn: Annotated[
        Path | None,
        typer.Option(
            "--learn",
            metavar="FILE",
            help="Add these features as labelled rows to a discriminant, and train it again.",
        ),
    ] = None,
    fault_axes: Annotated[
        list[int] | None,
        typer.Option(
            "--fault-axis", metavar="N", help="With --learn: an axis known to be at fault."
        ),
    ] = None,
    out: Out = DEFAULT_OUT,
    config: ConfigFile = None,
    overrides: Overrides = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Compare a target's patterns with a baseline's; writes scores.parquet and features.parquet."""
    from opamc_cli.config import load_config
    from opamc_cli.errors import UsageError
    from opamc_cli.stages.chain import score as stage
    from opamc_cli.stages.chain.compared import discriminants
    from opamc_cli.storage.files.lock import output_lock
    from opamc_cli.storage.files.parquet import forgo_pandas
    from opamc_cli.storage.files.result import published, result

    if fault_axes and learn is None:
        msg = "--fault-axis labels rows for training; name the model's file with --learn"
        raise UsageError(msg)
    forgo_pandas()
    output = Output(as_json, quiet)
    with output_lock(out), result(out, *stage.FILES) as staged:
        outcome = stage.run(
            baseline,
            target,
            load_config(config, overrides or ()),
            staged,
            models=discriminants.read_models(model) if model else None,
        )
        if learn is not None:
            trained = discriminants.learn(
                learn, outcome.features, fault_axes or (), (baseline, target)
            )
            trained.write()
            output.note(trained.summary())
    for note in outcome.notes:
        output.note(note)
    for doubt in outcome.doubts:
        output.failure(doubt)
    pooled = [row for row in outcome.features.to_pylist() if row["motion"] == stage.ALL_MOTIONS]
    output.result(
        {
            "written": [str(published(outcome.scores_path)), str(published(outcome.features_path))],
            "features": pooled,
        },
        *(_line(row) for row in pooled),
        str(published(outcome.scores_path)),
        str(published(outcome.features_path)),
    )


def _line(row: dict[str, float | None]) -> str:
    numbers = ", ".join(
        f"{name} {value:.3g}"
        for name in ("delta_mu", "delta_var", "ks", "lda")
        if (value := row[name]) is not None
    )
    return f"axis {row['axis']} order {row['order']}: {numbers}"
