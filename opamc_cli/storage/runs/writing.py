"""Write a run: one recording, one Parquet file, one row per sample."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.errors import InputError
from opamc_cli.storage.files.atomic import atomic_path
from opamc_cli.storage.files.json_documents import parsed
from opamc_cli.storage.runs.metadata import METADATA_KEY, RunInfo, RunMetadata

Array = npt.NDArray[Any]


ROW_GROUP_SAMPLES = 1 << 18
"""Samples per row group: 128 s at 2048 Hz, 19 MB for 18 float32 channels."""


@contextmanager
def write_run(path: Path, info: RunInfo, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a run for writing, block by block; it appears under its name when all is written.

    Raises
    ------
    InputError
        If what it says of itself is out of bounds.

    Yields
    ------
    pyarrow.parquet.ParquetWriter
        Call `write_table` with tables of the given schema. Blocks of `ROW_GROUP_SAMPLES` rows
        keep row groups whole.
    """
    metadata = dict(schema.metadata or {})
    metadata[METADATA_KEY] = raw = info.to_json().encode()
    # what no reader would take is not written
    parsed(RunMetadata, raw, f"{path}: its metadata", "correct the map or what was recorded")
    with (
        atomic_path(path) as temporary,
        pq.ParquetWriter(
            temporary,
            schema.with_metadata(metadata),
            # What an A/D converter delivers has few distinct values: a dictionary of them makes
            # the file a quarter smaller and decodes twice as fast as zstd over split bytes
            # (benchmarks/chain/encoding.py); other floats fall back to plain pages by themselves.
            use_dictionary=True,
            compression="lz4",
            write_page_checksum=True,
        ) as writer,
    ):
        yield writer


def save_run(path: Path, info: RunInfo, columns: Mapping[str, Array]) -> None:
    """Write a run from arrays of equal length, each in its own float width.

    Raises
    ------
    InputError
        If the arrays differ in length.
    """
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        msg = f"{path}: columns of different length {lengths}; a run has one row per sample"
        raise InputError(msg)
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    with write_run(path, info, table.schema) as writer:
        for start in range(0, table.num_rows, ROW_GROUP_SAMPLES):
            writer.write_table(table.slice(start, ROW_GROUP_SAMPLES))
