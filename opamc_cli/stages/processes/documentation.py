"""What libraries write of themselves as they are loaded."""

import sys
from contextlib import suppress
from functools import partial
from typing import Any

UNUSED = ("f2py", "testing")


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
        numpy: Any = sys.modules["numpy"]
        if unused := [name for name in UNUSED if f"numpy.{name}" not in sys.modules]:
            for name in unused:
                setattr(numpy, name, None)
            try:
                import scipy._lib.array_api_compat.numpy  # copies all that numpy has
            finally:
                for name in unused:
                    delattr(numpy, name)
