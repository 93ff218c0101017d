"""Parquet files and Feather (Arrow IPC) files of other programs.

Channels are named by their column, fields of structs ``column.field``; of a column of lists the
map picks one number of each list by `index`. Metadata of the file are read as ``@key``.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.feather
import pyarrow.parquet as pq

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import (
    BLOCK_ROWS,
    Array,
    Block,
    Listed,
    Name,
    Selection,
    missing_channel,
)
from opamc_cli.storage.ingest.time.dates import parse_dates

RUN_KEY = b"opamc"
"""Metadata key of what is a run already."""


@contextmanager
def open_parquet(path: Path) -> Iterator["ArrowSource"]:
    """Open a Parquet file; row groups are read as they are asked for.

    Raises
    ------
    InputError
        If it is not Parquet, or is a run already.
    """
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        raise _unreadable(path, "Parquet", error) from error
    if RUN_KEY in (file.schema_arrow.metadata or {}):
        msg = f"{path}: is a run already; give it to `opamc diagnose` or `opamc model` as it is"
        raise InputError(msg)

    def batches(columns: list[str]) -> Iterator[pa.RecordBatch]:
        return iter(file.iter_batches(BLOCK_ROWS, columns=columns))

    with file:
        yield ArrowSource(path, file.schema_arrow, batches)


@contextmanager
def open_feather(path: Path) -> Iterator["ArrowSource"]:
    """Open a Feather file of either version, or an Arrow IPC file or stream.

    Raises
    ------
    InputError
        If it is none of them.
    """
    try:
        table = pyarrow.feather.read_table(path, memory_map=True)
    except (pa.ArrowException, OSError) as error:
        try:
            with pa.OSFile(str(path)) as handle, pa.ipc.open_stream(handle) as stream:
                table = stream.read_all()
        except (pa.ArrowException, OSError):
            raise _unreadable(path, "Feather or Arrow", error) from error

    def batches(columns: list[str]) -> Iterator[pa.RecordBatch]:
        return iter(table.select(columns).to_batches(BLOCK_ROWS))

    yield ArrowSource(path, table.schema, batches)


class ArrowSource:
    """An open table of Arrow columns."""

    def __init__(self, path: Path, schema: pa.Schema, batches: Any) -> None:
        self.path = path
        self._schema = schema
        self._batches = batches

    def channels(self) -> list[Listed]:
        """Return the columns and struct fields that hold numbers, lists of numbers or dates."""
        listed: list[Listed] = []
        for name, kind in self._leaves():
            if pa.types.is_timestamp(kind):
                listed.append(Listed(name, dates=True))
            elif _is_number(kind):
                listed.append(Listed(name))
            elif _is_list(kind) and _is_number(kind.value_type):
                listed.append(Listed(name, self._width(name)))
        return listed

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected columns block by block."""
        known = dict(self._leaves())
        for selection in selections.values():
            if str(selection.source) not in known:
                raise missing_channel(self.path, selection.source, list(known))
        columns = sorted({self._column(str(s.source)) for s in selections.values()})
        for batch in self._batches(columns):
            yield {name: self._values(batch, selection) for name, selection in selections.items()}

    def value(self, source: Name) -> object:
        """Return a value of the schema's metadata (``@key``), or a column's first."""
        name = str(source)
        if name.startswith("@"):
            metadata = {k.decode(): v.decode() for k, v in (self._schema.metadata or {}).items()}
            if name[1:] not in metadata:
                raise missing_channel(self.path, source, [f"@{key}" for key in metadata])
            return metadata[name[1:]]
        if name not in dict(self._leaves()):
            raise missing_channel(self.path, source, [leaf for leaf, _ in self._leaves()])
        for batch in self._batches([self._column(name)]):
            for found in self._leaf(batch, name).drop_null()[:1].to_pylist():
                return found
        msg = f"{self.path}: column {name!r} is empty where a value is needed"
        raise InputError(msg)

    def _column(self, name: str) -> str:
        # a column may have a dot in its own name
        return name if name in self._schema.names else name.partition(".")[0]

    def _leaves(self) -> list[tuple[str, pa.DataType]]:
        leaves: list[tuple[str, pa.DataType]] = []
        for field in self._schema:
            if pa.types.is_struct(field.type):
                leaves += [(f"{field.name}.{inner.name}", inner.type) for inner in field.type]
            else:
                leaves.append((field.name, field.type))
        return leaves

    def _width(self, name: str) -> int:
        batch = next(iter(self._batches([self._column(name)])), None)
        lengths = pc.list_value_length(self._leaf(batch, name)) if batch is not None else None
        return int(pc.max(lengths).as_py() or 0) if lengths is not None else 0

    def _leaf(self, batch: pa.RecordBatch, name: str) -> pa.Array:
        if name in batch.schema.names:
            return batch.column(name)
        column, _, field = name.partition(".")
        return pc.struct_field(batch.column(column), field)

    def _values(self, batch: pa.RecordBatch, selection: Selection) -> Array:
        name = str(selection.source)
        column = self._leaf(batch, name)
        if _is_list(column.type):
            column = self._element(column, selection)
        elif selection.index is not None:
            msg = f"{self.path}: {name!r} holds single values; drop its index in the map"
            raise InputError(msg)
        if selection.dates:
            if pa.types.is_timestamp(column.type):
                stamps = np.asarray(column.to_numpy(zero_copy_only=False))
                return stamps.astype("datetime64[us]")
            texts = [text or "" for text in column.cast(pa.string()).to_pylist()]
            return parse_dates(self.path, name, texts)
        if not _is_number(column.type):
            msg = f"{self.path}: {name!r} holds {column.type}, numbers are needed"
            raise InputError(msg)
        numbers = column.cast(pa.float64(), safe=False)
        return np.asarray(numbers.to_numpy(zero_copy_only=False))

    def _element(self, column: pa.Array, selection: Selection) -> pa.Array:
        lengths = pc.list_value_length(column)
        shortest = pc.min(lengths).as_py() or 0
        if selection.index is None or selection.index >= shortest:
            msg = (
                f"{self.path}: {selection.source!r} holds lists of {shortest} values, index is "
                f"{selection.index}; set index to 0..{shortest - 1} in the map"
            )
            raise InputError(msg)
        return pc.list_element(column, selection.index)


def _is_number(kind: pa.DataType) -> bool:
    kinds = (pa.types.is_floating, pa.types.is_integer, pa.types.is_decimal)
    return any(is_kind(kind) for is_kind in kinds)


def _is_list(kind: pa.DataType) -> bool:
    kinds = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    return any(is_kind(kind) for is_kind in kinds)


def _unreadable(path: Path, name: str, error: Exception) -> InputError:
    reason = " ".join(str(error).split())[:120]
    return InputError(f"{path}: cannot be opened as {name} ({reason}); check format in the map")
