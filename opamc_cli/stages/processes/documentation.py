"""What libraries load that nobody asks for: documentation, makers' tools, and a compiler."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from types import ModuleType
from typing import Any

UNUSED = ("char", "ctypeslib", "f2py", "ma", "rec", "testing")
"""Parts of numpy that it loads only when they are asked for, and scipy asks for all: those that no
one else asks for, and masked arrays, of which only figures are drawn."""

OURS = "opamc_cli."


class _Unread(dict[str, list[Any]]):
    """A function's documentation for who parses it, adds to it and writes it anew: no parts."""

    def __init__(self, *_: object) -> None:
        super().__init__()

    def __missing__(self, part: str) -> list[Any]:
        return self.setdefault(part, [])

    def __str__(self) -> str:
        return "\n"


def forgo_documentation() -> None:
    """Have scipy and pyarrow loaded without their functions' documentation, in a process of ours.

    From 1.16 on scipy reads all of it, adds what kinds of array each function takes, and writes it
    anew: a third of what it takes to load, and a twentieth of a lone night. pyarrow reads that of
    its functions' options: a third of what its functions take. Nobody reads it here. Of what numpy
    has, scipy copies all: a sixth of the rest is parts that nobody uses here.
    """
    if "pyarrow.compute" not in sys.modules:
        with suppress(ImportError):  # private; left alone if absent
            from pyarrow.vendored import docscrape

            docscrape.NumpyDocString = _Unread
    if "scipy._lib._array_api" in sys.modules:
        return
    with suppress(ImportError, AttributeError):  # private; left alone if absent
        from scipy._lib import _docscrape

        reader: Any = _docscrape
        reader.FunctionDoc = _Unread
        with _unseen(UNUSED):
            import scipy._lib.array_api_compat.numpy  # noqa: F401 - who loads it first, fills it


def forgo_compiler() -> None:
    """Have our compiled loops read from where they are kept without all that could compile them.

    numba makes its compiler ready before it looks, which takes a quarter of a second, an eighth of
    a healthy lone night, and loads the sources of all functions of its own that a loop calls, 60 to
    90 ms; who has to compile loads them then. Loops of a user's may call what that alone would
    load: theirs are left alone. To be called once numba is loaded.
    """
    caching: Any = sys.modules.get("numba.core.caching")
    if caching is None:
        return
    with suppress(ImportError, AttributeError):  # private; left alone if absent
        from numba.core import environment
        from numba.core.runtime.nrt import rtsys

        loaded, initialize = caching.Cache.load_overload, rtsys.initialize
        if loaded.__module__ == __name__:
            return

        def load_overload(self: Any, sig: Any, target_context: Any) -> Any:
            ours = self._py_func.__module__.startswith(OURS)
            if not ours:
                return loaded(self, sig, target_context)
            with _ready(target_context, initialize), _without_sources(environment):
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
def _without_sources(environment: Any) -> Iterator[None]:
    """Have what numba keeps beside each compiled function made without the module it comes from.

    Of its names only code that is not compiled asks.
    """
    rebuilt = environment._rebuild_env

    def rebuild(name: str, *kept: Any) -> Any:
        if name in sys.modules or not name.startswith("numba."):
            return rebuilt(name, *kept)
        sys.modules[name] = ModuleType(name)
        try:
            return rebuilt(name, *kept)
        finally:
            del sys.modules[name]

    environment._rebuild_env = rebuild
    try:
        yield
    finally:
        environment._rebuild_env = rebuilt


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
