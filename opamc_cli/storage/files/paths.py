"""Files named by patterns: a quoted ``'logs/*.csv'`` is what the shell would have made of it."""

import glob
from collections.abc import Sequence
from pathlib import Path

from opamc_cli.errors import InputError

MARKS = frozenset("*?[")


def expand_patterns(paths: Sequence[Path]) -> list[Path]:
    """Return paths with every pattern (``*``, ``?``, ``[…]``, ``**``) replaced by what it matches.

    A path that exists is taken as it is, whatever its name.

    Raises
    ------
    InputError
        If a pattern matches nothing.
    """
    found: list[Path] = []
    for path in paths:
        if path.exists() or not MARKS & set(str(path)):
            found.append(path)
            continue
        matches = sorted(glob.glob(str(path), recursive=True))  # noqa: PTH207 - absolute ones too
        if not matches:
            msg = f"{path}: nothing matches this pattern; check the path"
            raise InputError(msg)
        found += [Path(match) for match in matches]
    return found
