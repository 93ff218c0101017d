"""The `opamc` command, and the one place where errors become exit codes.

Nothing but the interpreter's own is imported before the signals are in hand: an interruption in
the first millisecond ends as one in the last.
"""

if __name__ == "__main__":
    import opamc_cli.entry  # noqa: F401 - takes SIGINT in hand

import os
import sys
from collections.abc import Sequence

from opamc_cli.commands.terminal.streams import complain, finish, open_streams, say
from opamc_cli.errors import ExitCode, Interrupted, OpamcError, UsageError
from opamc_cli.stages.processes.garbage import look_for_garbage_seldom
from opamc_cli.stages.processes.interruption import interruptible

MOST_DIGITS = 11
"""Of seconds since 1970: to the year 5138."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run `opamc` and exit with one of `ExitCode`, or 128 and the number of a signal."""
    with interruptible() as came:
        open_streams()
        given = sys.argv[1:] if arguments is None else list(arguments)
        try:
            _run(given)
        except Interrupted as error:
            _tell(str(error), error.code, given)
            raise
        except Exception as error:  # noqa: BLE001 - whatever is not one of ours is a bug
            if came:
                ended = Interrupted(came[0])
                _tell(str(ended), ended.code, given)
                raise ended from None
            message, code = _told(error)
            _tell(message, code, given)
            sys.exit(code)
        finally:
            finish()


def _told(error: Exception) -> tuple[str, ExitCode]:
    """Return what is said of an error, and the exit code it ends with."""
    if isinstance(error, OpamcError):
        return str(error), error.exit_code
    if isinstance(error, MemoryError):
        message = "out of memory; use fewer --jobs, shorter recordings, or another machine"
        return message, ExitCode.USAGE
    if isinstance(error, OSError):
        # what the system refuses is no bug of ours: no space, no permission, too many files
        where = f"{error.filename}: " if error.filename is not None else ""
        message = f"{where}{error.strerror or error}; check space, permissions and limits"
        return message, ExitCode.USAGE
    if os.environ.get("OPAMC_DEBUG"):
        import traceback

        traceback.print_exception(error)
    message = f"a bug: {type(error).__name__}: {error} (set OPAMC_DEBUG=1 for the traceback)"
    return message, ExitCode.BUG


def _run(given: list[str]) -> None:
    for argument in given:
        if not argument.isprintable() and any("\ud800" <= c <= "\udfff" for c in argument):
            msg = f"{argument!r}: is not UTF-8; rename the file or write the option in UTF-8"
            raise UsageError(msg)
    if "" in given:
        msg = "an argument is empty, as of a variable that is not set; name a file or leave it out"
        raise UsageError(msg)
    _prepare_environment()
    from opamc_cli.commands.command_line import run

    sys.exit(run(given))


def _prepare_environment() -> None:
    """Refuse or replace what libraries stumble over as they are imported."""
    if fixed := os.environ.get("SOURCE_DATE_EPOCH"):
        if not (fixed.isascii() and fixed.isdecimal() and len(fixed) <= MOST_DIGITS):
            msg = f"SOURCE_DATE_EPOCH is {fixed[:40]!r}; it takes whole seconds since 1970"
            raise UsageError(msg)
    else:
        os.environ.pop("SOURCE_DATE_EPOCH", None)
    os.environ["MPLBACKEND"] = "agg"  # figures are written, never shown
    # else the metadata of everything that is installed are read, for plug-ins that none of ours has
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")
    _have_caches()
    look_for_garbage_seldom()


def _have_caches() -> None:
    """Give the compiled loops and the fonts a place of this process where they have none to stay.

    A service without a home, whose installation is not its own, cannot keep them: numba then
    refuses to load.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")  # noqa: PTH111
    while not os.path.lexists(home) and home != os.path.dirname(home):  # noqa: PTH120
        home = os.path.dirname(home)  # noqa: PTH120
    if os.access(home, os.W_OK):
        return
    wanted = {"NUMBA_CACHE_DIR": os.path.dirname(__file__), "MPLCONFIGDIR": home}  # noqa: PTH120
    missing = [
        name
        for name, own in wanted.items()
        if name not in os.environ and not os.access(own, os.W_OK)
    ]
    if not missing:
        return
    import atexit
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="opamc-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ.update(dict.fromkeys(missing, folder))


def _tell(message: str, code: int, given: Sequence[str]) -> None:
    """Print an error on stderr, and as JSON on stdout where the result would have been JSON."""
    complain(message)
    if "--json" in given:
        import json

        values = {"error": {"message": message, "exit_code": int(code)}}
        say(json.dumps(values, indent=2) + "\n", sys.stdout)


def __getattr__(name: str) -> object:
    """Hand out the subcommands without importing them before they are asked for."""
    if name == "app":
        from opamc_cli.commands.command_line import app

        return app
    raise AttributeError(name)


if __name__ == "__main__":
    main()
