"""What libraries load that nobody asks for: documentation, makers' tools, and a compiler."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from typing import Any

UNUSED = ("f2py", "testing")
"""Parts of numpy that it loads only when they are asked for, and scipy asks for all."""

OURS = "opamc_cli."


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


def forgo_compiler() -> None:
    """Have our compiled loops read from where they are kept without all that could compile them.

    numba makes its compiler ready before it looks, which takes a quarter of a second, an eighth of
    a healthy lone night; who has to compile makes it ready then. Loops of a user's may call what
    that alone would load: theirs are left alone. To be called once numba is loaded.
    """
    caching: Any = sys.modules.get("numba.core.caching")
    if caching is None:
        return
    with suppress(ImportError, AttributeError):  # private; left alone if absent
        from numba.core.runtime.nrt import rtsys

        loaded, initialize = caching.Cache.load_overload, rtsys.initialize
        if loaded.__module__ == __name__:
            return

        def load_overload(self: Any, sig: Any, target_context: Any) -> Any:
            ours = self._py_func.__module__.startswith(OURS)
            with _ready(target_context, initialize) if ours else nullcontext():
                return loaded(self, sig, target_context)

        caching.Cache.load_overload = load_overload


@contextmanager
def _ready(context: Any, initialize: Callable[[Any], None]) -> Iterator[None]:
    """Have a numba context made ready to run what is compiled, no more; under numba's own lock."""
    context.refresh = partial(initialize, context)
    try:
        yield
    finally:
        del context.refresh  # what lay over the method


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
