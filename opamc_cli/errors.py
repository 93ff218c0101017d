"""Every error that a user can cause, and the exit code it ends with.

Messages name the file, the column, the value and the limit, and say what to do.
"""

from collections.abc import Iterable
from enum import IntEnum


class ExitCode(IntEnum):
    """Exit codes of every subcommand."""

    DONE = 0
    UNHEALTHY = 1
    USAGE = 2
    BAD_INPUT = 3
    PARTIAL = 4
    NOT_ENOUGH_DATA = 5
    LOCKED = 6
    BUG = 70


class OpamcError(Exception):
    """Root of the errors that end in one sentence and an exit code.

    Parameters
    ----------
    *args
        The sentence, and what a subclass keeps beside it.
    axes
        Joints that it is about; empty: all of a recording, or of none.
    """

    exit_code: ExitCode = ExitCode.BUG

    def __init__(self, *args: object, axes: Iterable[int] = ()) -> None:
        super().__init__(*args)
        self.axes = tuple(axes)


class UsageError(OpamcError):
    """An option, argument or output location that cannot be used."""

    exit_code = ExitCode.USAGE


class ConfigError(UsageError):
    """A configuration file or key that cannot be used."""


class InputError(OpamcError):
    """A recording or stage table that cannot be used."""

    exit_code = ExitCode.BAD_INPUT


class NotEnoughDataError(OpamcError):
    """The data are usable but too few for what was asked."""

    exit_code = ExitCode.NOT_ENOUGH_DATA


class LockedError(OpamcError):
    """Another process is writing to the same output directory."""

    exit_code = ExitCode.LOCKED


class Interrupted(SystemExit):
    """A signal that ends the command, with the exit code 128 and its number."""

    code: int

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        from signal import Signals  # which takes milliseconds; who raises this has it

        self._name = Signals(number).name

    def __str__(self) -> str:
        """Say what happened."""
        return f"ended by {self._name}; what was not finished is as it was before"
