"""Loads what figures are drawn with."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

SIGNING = "_update_set_signature_and_docstring"
"""What matplotlib calls for each of its classes that is made; private, and left alone if absent."""


@contextmanager
def undocumented() -> Iterator[None]:
    """Have matplotlib loaded without the lists of properties that it writes of its classes.

    They and the signatures made of them are a fifth of what it takes to load what figures need, and
    nobody reads them where figures are written only (`MPLBACKEND=agg`, as the command sets it). In
    a notebook they stay.
    """
    if os.environ.get("MPLBACKEND") != "agg" or "matplotlib.artist" in sys.modules:
        yield
        return
    from matplotlib import artist

    untyped: Any = artist
    written, signed = untyped.kwdoc, vars(untyped.Artist).get(SIGNING)
    untyped.kwdoc = lambda _: ""
    if signed is not None:
        setattr(untyped.Artist, SIGNING, classmethod(lambda _: None))
    try:
        yield
    finally:
        untyped.kwdoc = written
        if signed is not None:
            setattr(untyped.Artist, SIGNING, signed)
