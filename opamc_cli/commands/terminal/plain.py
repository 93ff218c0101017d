"""Subcommands whose help says ``RUN...``, and whose wrong options are JSON where JSON is asked for.

Typer's own help shows Python's types, as in ``RUN... <list[Path]>``, which tell a user nothing.
"""

import re
from typing import Any

from typer.core import TyperCommand

from opamc_cli.errors import UsageError

_TYPE = re.compile(r" <([^<>]*)>$")


class PlainCommand(TyperCommand):
    """A subcommand without types in its help."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the parts of the usage line: ``RUN...``, not ``{RUN...}...``."""
        pieces = super().collect_usage_pieces(ctx)
        plain = [re.sub(r"[{}]", "", piece).replace("......", "...") for piece in pieces]
        return [re.sub(r"\[\[(.*)\]\]", r"[\1]", piece) for piece in plain]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments and options, names without types."""
        write = formatter.write_dl

        def without_types(rows: Any, *args: Any, **options: Any) -> None:
            write([(_plain(name), text) for name, text in rows], *args, **options)

        formatter.write_dl = without_types
        super().format_options(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments; with ``--json`` a wrong one becomes an error like any other."""
        as_json = "--json" in args
        try:
            return super().parse_args(ctx, args)
        except Exception as error:
            told = getattr(error, "format_message", None)
            if not as_json or told is None:
                raise
            raise UsageError(str(told())) from error


def _plain(name: str) -> str:
    """Return a help entry's name without its type: an option keeps what stands for its value."""
    found = _TYPE.search(name)
    if found is None:
        return name
    kind = found[1].removeprefix("list[").split()[0].rstrip("]")
    value = {"int": " N", "float": " X"}.get(kind, " TEXT") if name.startswith("-") else ""
    return name[: found.start()] + value
