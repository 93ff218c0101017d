"""The subcommands of `opamc`.

Nothing here or in the command files imports numpy or what needs it at module level, so that
`opamc --help` answers at once.
"""

from collections.abc import Callable
from typing import Annotated

import typer

from opamc_cli import __version__
from opamc_cli.commands import config
from opamc_cli.commands.chain import identify, patterns, score, segment
from opamc_cli.commands.model import model
from opamc_cli.commands.nightly import history, nightly
from opamc_cli.commands.recordings import example, ingest, simulate
from opamc_cli.commands.terminal.plain import PlainCommand
from opamc_cli.commands.tuning import select, sweep
from opamc_cli.commands.verdict import decide, diagnose, report
from opamc_cli.errors import ExitCode, Interrupted

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


_WrongUsage: type[Exception] = typer.BadParameter.__mro__[2]
"""What typer raises for arguments that it cannot read, whichever click it carries."""


def run(arguments: list[str]) -> int:
    """Run a subcommand and return its exit code.

    Raises
    ------
    OpamcError
        If it cannot do what it was asked for.
    """
    try:
        code = app(args=arguments, prog_name="opamc", standalone_mode=False)
    except _WrongUsage as error:
        message = getattr(error, "message", "")
        if "unexpected extra argument" in message and {"--baseline", "--target"} & {*arguments}:
            # the shell has made several files of a pattern, of which an option takes one
            hint = "put a pattern in quotes, as in --baseline 'runs/*.parquet', or name a folder"
            setattr(error, "message", f"{message}; {hint}")  # noqa: B010 - as below
        getattr(error, "show")()  # noqa: B009 - of a class that typer does not name
        return int(ExitCode.USAGE)
    except Interrupted:
        raise
    except SystemExit:
        return int(ExitCode.DONE)  # whoever read our help has seen enough of it
    return code if isinstance(code, int) else int(ExitCode.DONE)
