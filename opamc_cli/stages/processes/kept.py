"""Results of a stage's work on one file, kept under the hash of everything they depend on.

What a stage computes from one axis of one recording depends on the recording's bytes, the options,
the version and, later in the chain, on the reference: all of it is in the job that the stage hands
to its workers. The job's hash is the name of the kept file, so that a baseline is computed once,
a file that is added costs that file, and nothing has ever to be declared out of date. The folder
is a cache: it may be removed at any time.
"""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import pyarrow as pa

from opamc_cli import __version__
from opamc_cli.config import Config
from opamc_cli.config.models import Section
from opamc_cli.errors import OpamcError
from opamc_cli.storage.files.atomic import atomic_path
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.sources import RunSource

Job = TypeVar("Job")
Result = TypeVar("Result")

DIGEST_BYTES = 32
BEFORE_VERDICT = ("segment", "joint", "identify", "patterns")
"""Sections of the configuration that a recording's tables can depend on."""

SAMPLES = "samples"
"""Column of a table that holds an array."""

UNKNOWN = object()
"""What `KeptResults.find` returns where nothing is kept; None may be a result."""


def remembered(
    function: Callable[[Job], Result], kept: "KeptResults | None"
) -> Callable[[Job], Result]:
    """Return a stage's function for one job, made to look for the job's result first.

    Parameters
    ----------
    function
        A pure function of its job; its errors are not kept.
    kept
        Where results lie; None: the function itself is returned.
    """
    return function if kept is None else partial(_found_or_made, function, kept)


def _found_or_made(function: Callable[[Job], Result], kept: "KeptResults", job: Job) -> Result:
    known = kept.find(function, job)
    if known is not UNKNOWN:
        return cast(Result, known)
    result = function(job)
    kept.keep(function, job, result)
    return result


class KeptResults:
    """A folder of results by the hash of the jobs that they are the results of.

    Parameters
    ----------
    folder
        Made when something is kept.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, function: Callable[..., Any], job: object) -> Any:
        """Return the kept result of `function(job)`, or `UNKNOWN`; a damaged one is not there."""
        try:
            content = self._path(function, job).read_bytes()
        except OSError:
            return UNKNOWN
        digest, rest = content[:DIGEST_BYTES], content[DIGEST_BYTES:]
        if hashlib.sha256(rest).digest() != digest:
            return UNKNOWN
        return _decoded(rest)

    def keep(self, function: Callable[..., Any], job: object, result: object) -> None:
        """Keep a result; a folder that cannot be written costs time later, not the result now."""
        content = _encoded(result)
        with (
            suppress(OpamcError, OSError),
            atomic_path(self._path(function, job)) as path,
            path.open("wb") as file,
        ):
            file.write(hashlib.sha256(content).digest() + content)

    def _path(self, function: Callable[..., Any], job: object) -> Path:
        digest = hashlib.sha256()
        for part in _parts((__version__, f"{function.__module__}.{function.__qualname__}", job)):
            digest.update(part + b"\0")
        name = digest.hexdigest()
        return self.folder / name[:2] / name


def _parts(value: object) -> Iterator[bytes]:
    """Yield everything that a result can depend on, and nothing of where it lies.

    Raises
    ------
    TypeError
        For a kind of value that nobody has thought of: it must not be left out in silence.
    """
    if isinstance(value, Path):
        yield file_sha256(value).encode()
    elif isinstance(value, RunSource):
        yield f"run {value.name} {value.sha256}".encode()
    elif isinstance(value, Config):
        yield json.dumps(value.canonical(*BEFORE_VERDICT), sort_keys=True).encode()
    elif isinstance(value, Section):
        yield value.model_dump_json().encode()
    elif is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        for field in fields(value):
            yield from _parts(getattr(value, field.name))
    elif isinstance(value, pa.Table):
        yield json.dumps(value.to_pylist()).encode()
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape}".encode() + value.tobytes()
    elif isinstance(value, Mapping):
        yield from _parts(sorted(value.items()))
    elif isinstance(value, tuple | list):
        yield f"{len(value)} items".encode()
        if all(type(item) in (int, float, str) for item in value):
            yield repr(list(value)).encode()  # one by one they take longer than reading the result
            return
        for item in value:
            yield from _parts(item)
    elif value is None or isinstance(value, str | int | float | np.number):
        yield f"{type(value).__name__} {value!r}".encode()
    else:
        msg = f"a job with a {type(value).__name__} cannot be told from others"
        raise TypeError(msg)


def _encoded(result: object) -> bytes:
    """Return a result as one line of JSON with its Arrow tables behind it."""
    tables: list[pa.Table] = []
    tree = json.dumps(_tree(result, tables), allow_nan=True).encode()
    sink = pa.BufferOutputStream()
    for table in tables:
        options = pa.ipc.IpcWriteOptions(compression="lz4")
        with pa.ipc.new_stream(sink, table.schema, options=options) as writer:
            writer.write_table(table)
    return tree + b"\n" + bytes(sink.getvalue())


def _tree(value: object, tables: list[pa.Table]) -> Any:
    if isinstance(value, pa.Table):
        tables.append(value)
        return {"table": len(tables) - 1}
    if isinstance(value, np.ndarray):
        tables.append(pa.table({SAMPLES: value.ravel()}))
        return {"array": [len(tables) - 1, *value.shape]}
    if isinstance(value, tuple | list):
        return {"items": [_tree(each, tables) for each in value]}
    if isinstance(value, Mapping):
        return {"fields": {name: _tree(each, tables) for name, each in value.items()}}
    return value.item() if isinstance(value, np.generic) else value


def _decoded(content: bytes) -> Any:
    line, _, rest = content.partition(b"\n")
    source = pa.BufferReader(rest)
    tables = []
    while source.tell() < len(rest):
        with pa.ipc.open_stream(source) as reader:
            tables.append(reader.read_all())
    return _value(json.loads(line), tables)


def _value(tree: Any, tables: list[pa.Table]) -> Any:
    if not isinstance(tree, dict):
        return tree
    ((kind, inner),) = tree.items()
    if kind == "table":
        return tables[inner]
    if kind == "array":
        number, *shape = inner
        samples = tables[number][SAMPLES].combine_chunks().to_numpy(zero_copy_only=False)
        return np.array(samples).reshape(shape)  # a copy can be written to, as what was kept
    if kind == "fields":
        return {name: _value(each, tables) for name, each in inner.items()}
    return tuple(_value(each, tables) for each in inner)
