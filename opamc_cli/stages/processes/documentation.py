"""What libraries load that nobody asks for: documentation, and tools for makers of libraries."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

UNUSED = ("f2py", "testing")
"""Parts of numpy that it loads only when they are asked for, and scipy asks for all."""


def forgo_documentation() -> None:
    """Have scipy loaded without its functions' documentation, in a process that is ours.

    From 1.16 on it reads all of it, adds what kinds of array each function takes, and writes it
    anew: a third of what it takes to load, and a twentieth of a lone night. Nobody reads it here.
    Of what numpy has, it copies all: a sixth of the rest is parts that nobody uses here.
    """
    if "scipy._lib._array_api" in sys.modules:
        return
    with suppress(ImportError, AttributeError):  # private; left alone if absent
        from scipy._lib import _docscrape

        reader: Any = _docscrape
        reader.FunctionDoc = partial(reader.FunctionDoc, doc="")
        with _unseen(UNUSED):
            import scipy._lib.array_api_compat.numpy  # noqa: F401 - who loads it first, fills it


@contextmanager
def _unseen(names: tuple[str, ...]) -> Iterator[None]:
    """Have parts of numpy that are not loaded yet stand for nothing."""
    import numpy as np

    absent = [name for name in names if f"numpy.{name}" not in sys.modules]
    for name in absent:
        setattr(np, name, None)
    try:
        yield
    finally:
        for name in absent:
            delattr(np, name)
