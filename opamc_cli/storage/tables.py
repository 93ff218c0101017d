"""Stage outputs: where they came from, and how they get to disk whole.

Every table carries in its schema metadata key `opamc_table` one JSON object: stage, schema
version, canonical config and its hash, the inputs' relative paths and SHA-256, and the versions
of the libraries that computed it. Nothing in it depends on the clock or the machine, so the same
inputs and config give the same bytes.
"""

import json
import os
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from math import factorial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from pydantic import ConfigDict, Field, field_validator

from opamc_cli import __version__
from opamc_cli.config.models import Config, digest
from opamc_cli.errors import InputError, UsageError
from opamc_cli.storage.files.atomic import atomic_path
from opamc_cli.storage.files.json_documents import LARGEST, Document, parsed
from opamc_cli.storage.files.parquet import read_schema, read_whole
from opamc_cli.storage.files.result import published
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.runs.metadata import RunMetadata
from opamc_cli.storage.schemas.tables import LIMITS, MAY_BE_NULL

TABLE_KEY = b"opamc_table"
SCHEMA_VERSION = 1
LIBRARIES = ("numpy", "scipy", "numba", "pyarrow", "scikit-learn")


def write_table(
    path: Path,
    table: pa.Table,
    *,
    stage: str,
    config: Mapping[str, Any],
    inputs: Sequence[tuple[Path, str]],
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Write a stage table atomically, with its provenance and page checksums.

    Parameters
    ----------
    path
        Where to.
    table
        Rows in their final order.
    stage
        What made it.
    config
        The options that it was made with, as plain JSON types; hashed into `config_hash`.
    inputs
        (path, SHA-256) of every file that was read.
    extra
        Further JSON for the same metadata key, such as a fitted reference.

    Raises
    ------
    UsageError
        If a file that is no stage table would be replaced, or it cannot be written.
    """
    record = {
        "stage": stage,
        "schema_version": SCHEMA_VERSION,
        "config": config,
        "config_hash": digest(config),
        "inputs": [
            {"path": _relative(source, path.parent), "sha256": digest} for source, digest in inputs
        ],
        "versions": library_versions(),
        **(extra or {}),
    }
    metadata = {TABLE_KEY: json.dumps(record, sort_keys=True).encode()}
    _refuse_to_replace_others(published(path))
    with atomic_path(path) as temporary:
        pq.write_table(
            table.replace_schema_metadata(metadata),
            temporary,
            compression="zstd",
            write_page_checksum=True,
        )


def _refuse_to_replace_others(path: Path) -> None:
    """Refuse to write over a recording that happens to have a table's name."""
    if not path.is_file():
        return
    try:
        metadata = read_schema(path, "").metadata or {}
    except InputError:
        return  # a table that was damaged
    if TABLE_KEY not in metadata:
        msg = f"{path}: is no table of opamc and would be replaced; choose another --out"
        raise UsageError(msg)


def read_table(path: Path, stage: str, schema: pa.Schema | None = None) -> pa.Table:
    """Read a stage table and check that it is what it should be.

    Parameters
    ----------
    path
        The Parquet file.
    stage
        The stage that must have written it.
    schema
        Columns that it must hold, with their types.

    Raises
    ------
    InputError
        If it is missing, damaged, of another stage, of a newer schema, or lacks a column.
    """
    if not path.exists():
        msg = f"{path}: no such file; run `opamc {stage}` first"
        raise InputError(msg)
    if path.is_dir():
        msg = f"{path}: is a folder where a table of `opamc {stage}` is needed; name the file"
        raise InputError(msg)
    table = read_whole(path, f"run `opamc {stage}` again")
    record = table_record(path, table.schema.metadata)
    if record.get("stage") != stage:
        msg = f"{path}: is a table of stage {record.get('stage')!r}, {stage!r} is needed here"
        raise InputError(msg)
    if record.get("schema_version") != SCHEMA_VERSION:
        msg = (
            f"{path}: has schema version {record.get('schema_version')}, this opamc reads "
            f"{SCHEMA_VERSION}; run `opamc {stage}` again"
        )
        raise InputError(msg)
    for field in schema or ():
        if field.name not in table.column_names:
            raise _edited(path, stage, f"column {field.name} is missing")
        have = table.schema.field(field.name).type
        if not have.equals(field.type):
            raise _edited(
                path, stage, f"column {field.name} has type {have}, {field.type} is needed"
            )
    for why in _wrong_rows(table, record, schema or ()):
        raise _edited(path, stage, why)
    return table


def _edited(path: Path, stage: str, why: str) -> InputError:
    """Refuse what no stage writes: it was edited by hand, or laid together."""
    return InputError(f"{path}: {why}; run `opamc {stage}` again")


def _wrong_rows(
    table: pa.Table, record: Mapping[str, Any], needed: Iterable[pa.Field]
) -> Iterator[str]:
    """Yield what is wrong with rows."""
    for field in needed:
        n_null = table.column(field.name).null_count
        if n_null and field.name not in MAY_BE_NULL:
            yield f"column {field.name} is null in {n_null} of {table.num_rows} rows"
    for field in needed:
        if table.num_rows:
            yield from _wrong_values(table.column(field.name), field.name)
    if "segment" in table.column_names and "role" not in table.column_names:
        yield from _wrong_segments(table)
    if "counts" in table.column_names and "order" in table.column_names:
        lengths = pc.list_value_length(table["counts"]).to_pylist()
        for length, order in zip(lengths, table["order"].to_pylist(), strict=True):
            if length != factorial(order):
                there_are = f"there are {factorial(order)} patterns"
                yield f"counts of order {order} are {length}, {there_are}"
    if "runs" in record and "run" in table.column_names:
        known = {entry["name"] for entry in record["runs"]}
        for name in table.column("run").unique().to_pylist():
            if name not in known:
                yield f"names run {name!r}, it was made from {', '.join(sorted(known))}"


def _wrong_segments(table: pa.Table) -> Iterator[str]:
    """Yield that segments stand twice or not in their order, as of tables laid together."""
    names = {"run", "axis", "motion", "order"}.intersection(table.column_names)
    if not {"run", "axis"} <= names:
        return
    keys = [table[name].combine_chunks().dictionary_encode().indices.to_numpy() for name in names]
    rows = np.lexsort(keys)  # stable
    same_axis = np.all([np.diff(key[rows]) == 0 for key in keys], axis=0)
    if np.any(same_axis & (np.diff(table["segment"].to_numpy()[rows]) <= 0)):
        yield "has segments of an axis twice or not in their order"


def _wrong_values(column: pa.ChunkedArray, name: str) -> Iterator[str]:
    """Yield the numbers that are not possible."""
    values = pc.list_flatten(column) if pa.types.is_list(column.type) else column
    if not (pa.types.is_integer(values.type) or pa.types.is_floating(values.type)):
        return
    low, high = LIMITS.get(name, (-LARGEST, LARGEST))
    if name == "counts":
        low = 0
    if name == "order" and pa.types.is_floating(values.type):
        low, high = 0, LARGEST  # of a line over the angle, not of patterns
    if pa.types.is_floating(values.type):
        # an unknown number is NaN in some columns
        values = values.filter(pc.invert(pc.is_nan(values)))
    for value in pc.min_max(values).as_py().values():
        if value is not None and not low <= value <= high:
            yield f"column {name} holds {float(value):g}, {low:g} to {high:g} is possible"


def table_record(path: Path, metadata: Mapping[bytes, bytes] | None) -> dict[str, Any]:
    """Return the JSON object of a stage table's metadata.

    Raises
    ------
    InputError
        If the file carries none.
    """
    raw = (metadata or {}).get(TABLE_KEY)
    if raw is None:
        kind = "a run" if b"opamc" in (metadata or {}) else "a Parquet file of another program"
        msg = f"{path}: is {kind}, not a stage table of opamc"
        raise InputError(msg)
    place = f"{path}: its metadata key 'opamc_table'"
    document = parsed(_Record, raw, place, "make the table again")
    return document.model_dump(exclude_none=True)


class _Input(Document):
    path: str
    sha256: str


class RunEntry(Document):
    """A run that a table was made from; see `RunSource`."""

    name: str
    path: str
    sha256: str
    n_samples: Annotated[int, Field(ge=1)]
    info: RunMetadata


class _Record(Document):
    """The JSON of the metadata key `opamc_table`; a stage may have added to it."""

    model_config = ConfigDict(extra="allow")

    stage: str
    schema_version: int
    config: dict[str, Any] = Field(default_factory=dict)
    config_hash: str = ""
    inputs: list[_Input] = Field(default_factory=list)
    versions: dict[str, str] = Field(default_factory=dict)
    runs: list[RunEntry] | None = None

    @field_validator("config")
    @classmethod
    def _sections_are_mappings(cls, config: dict[str, Any]) -> dict[str, Any]:
        for name in Config.model_fields.keys() & config.keys():
            if not isinstance(config[name], dict):
                msg = f"{name} is no section of a configuration"
                raise ValueError(msg)
        return config


def record_at(path: Path) -> dict[str, Any]:
    """Return the JSON object of a stage table's metadata: stage, config, inputs and so on.

    Raises
    ------
    InputError
        If it is not a stage table.
    """
    return table_record(path, read_schema(path, "make the table again").metadata)


def check_current(path: Path) -> None:
    """Refuse a stage table if the table beside it that it was made from has been made anew.

    Raises
    ------
    InputError
        If so: a stage between the two was not run again.
    """
    record = record_at(path)
    for source in record["inputs"]:
        beside = path.parent / source["path"]
        own_folder = beside.parent == path.parent
        if own_folder and beside.is_file() and file_sha256(beside) != source["sha256"]:
            why = f"was made from another {beside.name} than the one beside it"
            raise _edited(path, record["stage"], why)


def table_input(path: Path) -> tuple[Path, str]:
    """Return (path, SHA-256), the form in which `write_table` takes its inputs."""
    return path, file_sha256(path)


@cache
def library_versions() -> Mapping[str, str]:
    """Return the versions of opamc and of the libraries that its numbers depend on.

    Asked once: each answer of importlib.metadata reads a file, and a night writes a dozen tables.
    """
    versions = {name: version(name) for name in LIBRARIES}
    return {"opamc": __version__, "python": platform.python_version(), **versions}


def _relative(path: Path, folder: Path) -> str:
    seen = published(path.resolve()), published(folder.resolve())
    return Path(os.path.relpath(*seen)).as_posix()
