"""Effects from a user's file: what they give is checked, and a mistake told by file and line."""

import importlib.util
import inspect
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from importlib.machinery import SourceFileLoader
from math import isfinite
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np

from opamc_cli.errors import ConfigError, Interrupted, OpamcError
from opamc_cli.joint.effects.base import Effect


def _columns(given: Any, track: Any) -> str | None:
    if not isinstance(given, np.ndarray) or given.ndim != 2 or given.shape[0] != track.size:
        is_array = isinstance(given, np.ndarray)
        what = f"an array of shape {given.shape}" if is_array else type(given).__name__
        return f"{what}; ({track.size}, m) is needed, a column for each regressor (see `stack`)"
    if given.shape[1] == 0 or given.dtype.kind not in "fiu":
        return f"{given.shape[1]} columns of {given.dtype}; at least one of float64 is needed"
    return None if np.isfinite(given).all() else "numbers that are not finite"


def _guesses(given: Any, track: Any) -> str | None:
    return (
        None
        if isinstance(given, list) and given and all(map(_is_parameters, given))
        else f"{given!r:.60}; a list of mappings from parameter to number is needed, such as [{{}}]"
    )


def _limits(given: Any, track: Any) -> str | None:
    pairs = list(given.values()) if isinstance(given, dict) else [None]
    if all(isinstance(pair, tuple) and len(pair) == 2 and pair[0] < pair[1] for pair in pairs):
        return None
    return f"{given!r:.60}; a mapping from parameter to (lowest, highest) is needed"


def _sentence(given: Any, track: Any) -> str | None:
    return None if isinstance(given, str) else f"{given!r:.60}; a text is needed"


def _reason(given: Any, track: Any) -> str | None:
    return None if given is None or isinstance(given, str) else f"{given!r:.60}; a text or None"


def _is_parameters(given: Any) -> bool:
    return isinstance(given, dict) and all(
        isinstance(name, str) and isinstance(value, int | float) and isfinite(value)
        for name, value in given.items()
    )


CHECKS: dict[str, Callable[[Any, Any], str | None]] = {
    "columns": _columns,
    "guesses": _guesses,
    "limits": _limits,
    "interpretation": _sentence,
    "untestable": _reason,
}
"""By method: what is wrong with what it returns on a track, if anything."""

PACKAGE = Path(__file__).parents[3]

TEXTS = ("needs", "searches", "forms")


class _FromSource(SourceFileLoader):
    """Reads a user's file each time, and leaves no bytecode beside it.

    Bytecode counts as the file's while size and second of the last change are the same: a number
    that was corrected within the second stayed as it was.
    """

    def get_code(self, fullname: str) -> CodeType:
        code: CodeType = self.source_to_code(self.get_data(self.path), self.path)
        return code


def load_user_effects(path: Path) -> list[Effect]:
    """Effects that a user's Python file defines.

    Raises
    ------
    ConfigError
        If the file is missing, does not run, or defines no effect with a name and a domain.
    """
    name = f"opamc_user_{path.stem}"
    loader = _FromSource(name, str(path))
    spec = importlib.util.spec_from_file_location(name, path, loader=loader)
    if spec is None or path.suffix != ".py" or not path.is_file():
        msg = f"Effect file {path} cannot be read; name a Python file"
        raise ConfigError(msg)
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
        found = [
            member()
            for _, member in inspect.getmembers(module, inspect.isclass)
            if issubclass(member, Effect) and member.__module__ == module.__name__ and member.name
        ]
        named = [isinstance(e.name, str) and isinstance(e.domain, str) and e.domain for e in found]
    except Interrupted:
        raise
    except (Exception, SystemExit) as error:  # of a user's own code
        msg = f"Effect file {path} does not run: {type(error).__name__}: {error}"
        raise ConfigError(msg) from error
    if not found or not all(named):
        msg = f"Effect file {path} defines no class of Effect with a name and a domain"
        raise ConfigError(msg)
    return [_all_checked(effect, path) for effect in found]


def _all_checked(effect: Effect, path: Path) -> Effect:
    """Have every answer of a user's effect checked, and say where the method is that gave it.

    Raises
    ------
    ConfigError
        If a name or a list of names is none; later, from the methods, if they answer otherwise
        than the loop needs.
    """
    kind = type(effect)
    for name in TEXTS:
        given = getattr(effect, name)
        if not isinstance(given, tuple) or not all(isinstance(each, str) for each in given):
            msg = (
                f"{path}: {name} of effect {effect.name!r} is {given!r:.60}; write a tuple of texts"
            )
            raise ConfigError(msg)
    for name, wrong in CHECKS.items():
        method = getattr(kind, name)
        if method is not getattr(Effect, name) and inspect.isfunction(method):
            setattr(effect, name, _checked(effect, name, wrong, f"{path}:{_line(method)}"))
    return effect


def _checked(
    effect: Effect, name: str, wrong: Callable[[Any, Any], str | None], where: str
) -> Callable[..., Any]:
    method = getattr(effect, name)

    @wraps(method)
    def call(*arguments: Any, **named: Any) -> Any:
        given = method(*arguments, **named)
        tracks = [value for value in (*arguments, *named.values()) if hasattr(value, "rate_hz")]
        why = wrong(given, tracks[0]) if tracks else None
        if why is not None:
            msg = f"{where}: {name} of effect {effect.name!r} returns {why}; correct it"
            raise ConfigError(msg)
        return given

    return call


def _line(method: Callable[..., Any]) -> int:
    return method.__code__.co_firstlineno


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
