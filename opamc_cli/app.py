"""The `opamc` command: its subcommands, and the one place where errors become exit codes.

Nothing here or in the command files imports numpy or what needs it at module level, so that
`opamc --help` answers at once.
"""

import os
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from opamc_cli import __version__
from opamc_cli.commands import COMMANDS, GROUPS
from opamc_cli.errors import ExitCode, OpamcError

app = typer.Typer(
    name="opamc",
    help="Tell from motor current which joint of a robot arm is healthy, which is not, and why.",
    epilog="Exit codes: 0 done and healthy, 1 a joint has changed or is at fault, 2 usage or "
    "config error, 3 an input cannot be used, 4 some runs failed, 5 not enough data for a "
    "verdict, 6 another run holds the lock, 70 a bug.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"opamc {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None: ...


for _name, _command in COMMANDS.items():
    app.command(_name)(_command)
for _name, _group in GROUPS.items():
    app.add_typer(_group, name=_name)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `opamc` and exit with one of `ExitCode`."""
    try:
        app(args=None if arguments is None else list(arguments), prog_name="opamc")
    except OpamcError as error:
        print(f"opamc: {error}", file=sys.stderr)
        sys.exit(error.exit_code)
    except Exception as error:  # noqa: BLE001 - the last resort; everything known is above
        if os.environ.get("OPAMC_DEBUG"):
            traceback.print_exc()
        print(
            f"opamc: a bug: {type(error).__name__}: {error} (set OPAMC_DEBUG=1 for the traceback)",
            file=sys.stderr,
        )
        sys.exit(ExitCode.BUG)


if __name__ == "__main__":
    main()
