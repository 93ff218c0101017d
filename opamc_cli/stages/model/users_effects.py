"""A mistake in a user's own effect, told by its file and line."""

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from opamc_cli.errors import ConfigError, OpamcError

PACKAGE = Path(__file__).parents[2]


class UserEffectError(ConfigError):
    """A mistake in a user's own effect, with its file and line."""


@contextmanager
def users_effects_named() -> Iterator[None]:
    """Make a sentence, with file and line, of an error that arises in a user's own effect."""
    try:
        yield
    except OpamcError:
        raise
    except Exception as error:
        where = _in_a_users_effect(error)
        if where is None:
            raise
        what = f"{type(error).__name__}: {error}".rstrip(": ")
        msg = f"{where}: this effect cannot be used ({what}); correct it"
        raise UserEffectError(msg) from error


def _in_a_users_effect(error: BaseException) -> str | None:
    """Return file and line where an error arose in a user's effect, None where in none."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        own = frame.filename.endswith(".py") and Path(frame.filename).is_relative_to(PACKAGE)
        installed = "site-packages" in frame.filename or "/lib/python" in frame.filename
        if not own and not installed and Path(frame.filename).is_file():
            return f"{frame.filename}:{frame.lineno}"
    return None
