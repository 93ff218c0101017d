"""Loads what figures are drawn with."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def undocumented() -> Iterator[None]:
    """Have matplotlib loaded without the lists of properties that it writes of its classes.

    They are a seventh of what it takes to load what figures need, and nobody reads them where
    figures are written only (`MPLBACKEND=agg`, as the command sets it). In a notebook they stay.
    """
    if os.environ.get("MPLBACKEND") != "agg" or "matplotlib.artist" in sys.modules:
        yield
        return
    from matplotlib import artist

    untyped: Any = artist
    written = untyped.kwdoc
    untyped.kwdoc = lambda _: ""
    try:
        yield
    finally:
        untyped.kwdoc = written
