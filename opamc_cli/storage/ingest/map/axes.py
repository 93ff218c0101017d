"""One line of a map for all axes: ``axis{n}_current: {source: actual_current_{n-1}}``.

`{n}` counts from 1; `{n-1}`, `{n+2}` are counted from it. In YAML braces mean a mapping, so the
placeholders are taken out of the text before it is read: quotes are not needed.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from opamc_cli.errors import ConfigError

MOST_AXES = 32
"""An arm with external axes has fewer; a file that has more would not end."""

_WRITTEN = re.compile(r"\{\s*n\s*([+-]\s*[0-9]+)?\s*\}")
_READ = re.compile(r"«n([+-][0-9]+)?»")


def protect(text: str) -> str:
    """Return a map's text with placeholders that YAML does not take for mappings.

    Examples
    --------
    >>> protect("axis{n}_a: {source: i_{n - 1}}")
    'axis«n»_a: {source: i_«n-1»}'
    """
    return _WRITTEN.sub(lambda m: f"«n{(m[1] or '').replace(' ', '')}»", text)


def shown(text: str) -> str:
    """Return protected text as its user wrote it, for a message."""
    return _READ.sub(lambda m: f"{{n{m[1] or ''}}}", text)


@contextmanager
def as_written() -> Iterator[None]:
    """Name protected text in errors as its user wrote it.

    Raises
    ------
    ConfigError
        Any that is raised within.
    """
    try:
        yield
    except ConfigError as error:
        raise ConfigError(shown(str(error))) from error


def has_placeholder(value: object) -> bool:
    """Return whether a value stands for one per axis."""
    return isinstance(value, str) and _READ.search(value) is not None


def filled(value: object, axis: int) -> object:
    """Return a value for one axis; a number alone becomes one.

    Examples
    --------
    >>> filled("q_«n-1»", 3), filled("«n-1»", 3), filled("q", 3)
    ('q_2', 2, 'q')
    """
    if not isinstance(value, str):
        return value
    text = _READ.sub(lambda m: str(axis + int(m[1] or 0)), value)
    return int(text) if _READ.fullmatch(value) else text


def at_zero(value: object) -> str | None:
    """Return the channel that a line which counts from 1 would have for an axis 0.

    None for all others: `{n-1}` counts from 0, and `{n+3}` says that there are others below.

    Examples
    --------
    >>> at_zero("cur_«n»"), at_zero("cur_«n-1»"), at_zero("«n»")
    ('cur_0', None, None)
    """
    first = filled(value, 0)
    return first if isinstance(first, str) and "«n»" in str(value) else None


def expand(
    columns: Mapping[str, Mapping[str, Any]], axes: int | None, exists: Callable[[Any], bool]
) -> dict[str, dict[str, Any]]:
    """Return a map's columns with one entry per axis instead of every placeholder.

    Parameters
    ----------
    columns
        Entries by the run column's name, protected.
    axes
        Number of axes; None: every one that the file has a channel for, which may begin above 1
        and have a gap: a joint keeps its number.
    exists
        Whether the file has the channel of a filled entry.
    """
    result: dict[str, dict[str, Any]] = {}
    for name, entry in columns.items():
        if not has_placeholder(name):
            result[name] = dict(entry)
    templates = {name: entry for name, entry in columns.items() if has_placeholder(name)}
    by_axis = [
        {
            str(filled(name, axis)): {key: filled(value, axis) for key, value in entry.items()}
            for name, entry in templates.items()
        }
        for axis in range(1, (axes or MOST_AXES) + 1)
    ]
    there = [own for own in by_axis if axes or any(map(exists, own.values()))]
    for own in there or by_axis[:1]:  # what is missing is told of axis 1
        for name, entry in own.items():
            result.setdefault(name, entry)  # a line for one axis goes before that for all
    return result
