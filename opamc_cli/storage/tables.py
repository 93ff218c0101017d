"""Stage outputs: their columns, where they came from, and how they get to disk whole.

Every table carries in its schema metadata key `opamc_table` one JSON object: stage, schema
version, canonical config and its hash, the inputs' relative paths and SHA-256, and the versions
of the libraries that computed it. Nothing in it depends on the clock or the machine, so the same
inputs and config give the same bytes.
"""

import json
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli import __version__
from opamc_cli.config.models import digest
from opamc_cli.errors import InputError
from opamc_cli.storage.atomic import atomic_path
from opamc_cli.storage.result import published
from opamc_cli.storage.runs import file_sha256

TABLE_KEY = b"opamc_table"
SCHEMA_VERSION = 1
MAY_BE_NULL = frozenset(
    {
        *("temperature_c", "gamma", "lda"),
        *("jsd", "chance", "excess", "delta_mu", "delta_var", "ks"),
    }
)
"""Columns of stage tables in which null means unknown."""

LIBRARIES = ("numpy", "scipy", "numba", "pyarrow", "scikit-learn")

SEGMENTS = pa.schema(
    [
        ("run", pa.string()),
        ("axis", pa.int16()),
        ("segment", pa.int32()),
        ("start", pa.int64()),
        ("stop", pa.int64()),
        ("sampling_rate_hz", pa.float64()),
        ("f_max_hz", pa.float64()),
        ("direction", pa.int8()),
        ("variance", pa.float64()),
        ("edge", pa.bool_()),
        ("kind", pa.string()),
        ("signal", pa.string()),
        ("temperature_c", pa.float64()),
    ]
)
MOTIONS = pa.schema(
    [
        *SEGMENTS,
        pa.field("cycle", pa.int32()),
        pa.field("motion", pa.int32()),
        pa.field("similarity", pa.float64()),
        pa.field("lag", pa.int64()),
        pa.field("reference", pa.bool_()),
        pa.field("reference_f_max_hz", pa.float64()),
        pa.field("reference_samples", pa.int64()),
    ]
)
PATTERNS = pa.schema(
    [
        ("run", pa.string()),
        ("axis", pa.int16()),
        ("cycle", pa.int32()),
        ("motion", pa.int32()),
        ("segment", pa.int32()),
        ("start", pa.int64()),
        ("stop", pa.int64()),
        ("order", pa.int8()),
        ("tau", pa.int32()),
        ("gamma", pa.float64()),
        ("f_max_hz", pa.float64()),
        ("n_patterns", pa.int64()),
        ("n_masked", pa.int64()),
        ("counts", pa.list_(pa.int64())),
        ("signal", pa.string()),
        ("temperature_c", pa.float64()),
    ]
)


@dataclass(frozen=True)
class Provenance:
    """Where a table came from.

    Attributes
    ----------
    stage
        Name of the stage that made it.
    config
        The stage's canonical configuration.
    config_hash
        SHA-256 of the canonical configuration.
    inputs
        Path of each input, relative to the table's folder, and its SHA-256.
    """

    stage: str
    config: Mapping[str, Any]
    config_hash: str
    inputs: tuple[tuple[str, str], ...]


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
    with atomic_path(path) as temporary:
        pq.write_table(
            table.replace_schema_metadata(metadata),
            temporary,
            compression="zstd",
            write_page_checksum=True,
        )


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
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            table = file.read()
    except (pa.ArrowException, OSError) as error:
        reason = str(error).strip().splitlines()[0]
        msg = f"{path}: cannot be read as Parquet ({reason}); run `opamc {stage}` again"
        raise InputError(msg) from error
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
            msg = f"{path}: column {field.name} is missing; run `opamc {stage}` again"
            raise InputError(msg)
        if not table.schema.field(field.name).type.equals(field.type):
            have = table.schema.field(field.name).type
            msg = (
                f"{path}: column {field.name} has type {have}, {field.type} is needed; "
                f"run `opamc {stage}` again"
            )
            raise InputError(msg)
    _check_rows(path, table, record, schema or ())
    return table


def _check_rows(
    path: Path, table: pa.Table, record: Mapping[str, Any], needed: Iterable[pa.Field]
) -> None:
    """Refuse rows that no stage writes: they were edited by hand."""
    for field in needed:
        n_null = table.column(field.name).null_count
        if n_null and field.name not in MAY_BE_NULL:
            msg = (
                f"{path}: column {field.name} is null in {n_null} of {table.num_rows} rows; "
                f"run `opamc {record['stage']}` again"
            )
            raise InputError(msg)
    if "runs" in record and "run" in table.column_names:
        known = {entry["name"] for entry in record["runs"]}
        for name in table.column("run").unique().to_pylist():
            if name not in known:
                msg = (
                    f"{path}: names run {name!r}, it was made from {', '.join(sorted(known))}; "
                    f"run `opamc {record['stage']}` again"
                )
                raise InputError(msg)


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
    try:
        record = json.loads(raw)
    except (UnicodeDecodeError, json.JSONDecodeError):
        record = None
    if not isinstance(record, dict):
        msg = f"{path}: its metadata key 'opamc_table' is not a JSON object; make the table again"
        raise InputError(msg)
    return record


def table_provenance(path: Path) -> Provenance:
    """Return where the table at `path` came from.

    Raises
    ------
    InputError
        If it is not a stage table.
    """
    try:
        metadata = pq.read_schema(path).metadata
    except (pa.ArrowException, OSError) as error:
        msg = f"{path}: cannot be read as Parquet ({error})"
        raise InputError(msg) from error
    record = table_record(path, metadata)
    return Provenance(
        stage=record["stage"],
        config=record["config"],
        config_hash=record["config_hash"],
        inputs=tuple((entry["path"], entry["sha256"]) for entry in record["inputs"]),
    )


def table_input(path: Path) -> tuple[Path, str]:
    """Return (path, SHA-256), the form in which `write_table` takes its inputs."""
    return path, file_sha256(path)


def library_versions() -> dict[str, str]:
    """Return the versions of opamc and of the libraries that its numbers depend on."""
    versions = {name: version(name) for name in LIBRARIES}
    return {"opamc": __version__, "python": platform.python_version(), **versions}


def _relative(path: Path, folder: Path) -> str:
    seen = published(path.resolve()), published(folder.resolve())
    return Path(os.path.relpath(*seen)).as_posix()
