"""Subcommands: options in, stage called, result printed."""

from collections.abc import Callable

import typer

from opamc_cli.commands import config, identify, patterns

COMMANDS: dict[str, Callable[..., None]] = {
    "identify": identify.identify,
    "patterns": patterns.patterns,
}
"""Subcommands by name, in the order of the chain."""

GROUPS: dict[str, typer.Typer] = {"config": config.app}
"""Subcommands that have subcommands."""
