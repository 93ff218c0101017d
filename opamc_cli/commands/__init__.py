"""Subcommands: options in, stage called, result printed."""

from collections.abc import Callable

import typer

from opamc_cli.commands import (
    config,
    decide,
    diagnose,
    example,
    history,
    identify,
    ingest,
    model,
    nightly,
    patterns,
    report,
    score,
    segment,
    select,
    simulate,
    sweep,
)

COMMANDS: dict[str, Callable[..., None]] = {
    "ingest": ingest.ingest,
    "segment": segment.segment,
    "identify": identify.identify,
    "patterns": patterns.patterns,
    "score": score.score,
    "report": report.report,
    "diagnose": diagnose.diagnose,
    "decide": decide.decide,
    "history": history.history,
    "sweep": sweep.sweep,
    "select": select.select,
    "simulate": simulate.simulate,
    "example": example.example,
}
"""Subcommands by name, in the order of the chain."""

GROUPS: dict[str, typer.Typer] = {
    "nightly": nightly.app,
    "model": model.app,
    "config": config.app,
}
"""Subcommands that have subcommands."""
