"""Templates of pages, and where their compiled code is kept."""

import functools
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import jinja2
from jinja2.bccache import Bucket


@functools.cache
def environment(read: Callable[[str], str]) -> jinja2.Environment:
    """Return the templates that a function reads by name; what they say is escaped.

    Whatever a template is called: names of runs and robots are not ours. To compile a report's
    takes as long as to judge two joints, so its code is kept where Python keeps this file's.
    """
    kept = Path(__file__).parent / "__pycache__"
    keep = os.access(kept, os.W_OK) and not sys.dont_write_bytecode
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(read),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        bytecode_cache=_Kept(str(kept)) if keep else None,
    )


class _Kept(jinja2.FileSystemBytecodeCache):
    """Code that is kept if it can be."""

    def dump_bytecode(self, bucket: Bucket) -> None:
        with suppress(OSError):  # such as on a full disk
            super().dump_bytecode(bucket)
