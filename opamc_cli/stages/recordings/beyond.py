"""Channels whose numbers no robot's joint has are refused, those that few have are doubtful."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from opamc_cli.errors import InputError
from opamc_cli.signal.plausible.quality import Limit, Size


def limited(path: Path, column: str, values: npt.NDArray[np.floating], limit: Limit) -> str | None:
    """Return what is odd about the size of a channel's numbers; see `sized`."""
    size = Size(limit)
    size.add(values)
    return sized(path, column, size)


def sized(path: Path, column: str, size: Size) -> str | None:
    """Return what is odd about the size of a channel's numbers.

    Raises
    ------
    InputError
        If no joint has such.
    """
    doubt = size.doubt()
    text = f"{path}: column {column} {doubt}"
    if size.is_impossible:
        msg = f"{text} Correct the unit where the run is made"
        raise InputError(msg)
    return text if doubt else None
