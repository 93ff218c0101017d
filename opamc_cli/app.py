"""The `opamc` command: its subcommands, and the one place where errors become exit codes.

Nothing here or in the command files imports numpy or what needs it at module level, so that
`opamc --help` answers at once.
"""

import json
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer

from opamc_cli import __version__
from opamc_cli.commands import COMMANDS, GROUPS
from opamc_cli.commands.plain import PlainCommand
from opamc_cli.errors import ExitCode, OpamcError

app = typer.Typer(
    name="opamc",
    help="Tell from motor current which joint of a robot arm is healthy, which is not, and why.",
    epilog="Exit codes: 0 done and healthy, 1 a joint has changed or is at fault, 2 usage or "
    "config error, 3 an input cannot be used, 4 some runs failed, 5 not enough data for a "
    "verdict, 6 another run holds the lock, 70 a bug.",
    no_args_is_help=True,
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
    app.command(_name, cls=PlainCommand)(_command)
for _name, _group in GROUPS.items():
    for _info in _group.registered_commands:
        _info.cls = PlainCommand
    app.add_typer(_group, name=_name)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `opamc` and exit with one of `ExitCode`."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        app(args=given, prog_name="opamc")
    except OpamcError as error:
        _tell(str(error), error.exit_code, given)
        sys.exit(error.exit_code)
    except Exception as error:  # noqa: BLE001 - the last resort; everything known is above
        if os.environ.get("OPAMC_DEBUG"):
            traceback.print_exc()
        told = f"a bug: {type(error).__name__}: {error} (set OPAMC_DEBUG=1 for the traceback)"
        _tell(told, ExitCode.BUG, given)
        sys.exit(ExitCode.BUG)


def _tell(message: str, code: ExitCode, given: Sequence[str]) -> None:
    """Print an error on stderr, and as JSON on stdout where the result would have been JSON."""
    print(f"opamc: {message}", file=sys.stderr)
    if "--json" in given:
        print(json.dumps({"error": {"message": message, "exit_code": int(code)}}, indent=2))


if __name__ == "__main__":
    main()
