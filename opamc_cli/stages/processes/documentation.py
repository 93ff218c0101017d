"""What libraries write of themselves as they are loaded."""

import sys
from contextlib import suppress
from functools import partial
from typing import Any


def forgo_documentation() -> None:
    """Have scipy loaded without its functions' documentation, in a process that is ours.

    From 1.16 on it reads all of it, adds what kinds of array each function takes, and writes it
    anew: a third of what it takes to load, and a twentieth of a lone night. Nobody reads it here.
    """
    if "scipy._lib._array_api" in sys.modules:
        return
    with suppress(ImportError, AttributeError):  # private; left alone if absent
        from scipy._lib import _docscrape

        reader: Any = _docscrape
        reader.FunctionDoc = partial(reader.FunctionDoc, doc="")
