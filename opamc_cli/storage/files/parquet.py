"""Parquet files that others may have written or damaged: whatever the reader makes of them."""

import hashlib
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.config.reading import require_regular_file, shown
from opamc_cli.errors import InputError

MAGIC = b"PAR1"
"""With which a file begins and ends."""

MOST_ROWS = 50_000_000
"""Of a stage table, which is read as a whole: years of nights have less."""


class _Absent:
    """A finder of modules for which pandas is not installed."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        del path, target
        if name == "pandas":
            raise ModuleNotFoundError(name, name=name)


def forgo_pandas() -> None:
    """Have pyarrow make arrays without pandas, in a process that is ours.

    Where pandas is installed, pyarrow loads it at its first array, to know a data frame if it sees
    one; it takes as long as to judge a joint. It sees none here. It asks once, and who asks for a
    data frame later (`to_pandas`) gets one.
    """
    if "pandas" in sys.modules:
        return
    absent: Any = _Absent()
    sys.meta_path.insert(0, absent)
    try:
        pa.array([None])
    finally:
        sys.meta_path.remove(absent)


@contextmanager
def reading(path: Path, advice: str, what: str = "cannot be read as Parquet") -> Iterator[None]:
    """Take whatever the Parquet reader stumbles over for a damaged file.

    Raises
    ------
    InputError
        With the reader's first words.
    """
    try:
        yield
    except (MemoryError, InputError):
        raise
    except Exception as error:  # of another's library, whose errors no list keeps up with
        lines = str(error).strip().splitlines()
        reason = shown_line(lines[0]) if lines else type(error).__name__
        if _cut_off(path):
            reason = "it begins as Parquet and has no end: cut off, or still being written"
        msg = f"{path}: {what} ({reason}); {advice}"
        raise InputError(msg) from error


def _cut_off(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            begins = file.read(len(MAGIC))
            file.seek(-len(MAGIC), os.SEEK_END)
            return begins == MAGIC != file.read()
    except OSError:
        return False


def shown_line(text: str) -> str:
    """Return a line of another's making, as far as a sentence can hold it."""
    plain = "".join(c if c.isprintable() else "�" for c in text.rstrip("."))
    return plain if len(plain) <= 160 else f"{plain[:160]}…"


def read_schema(path: Path, advice: str) -> pa.Schema:
    """Return the schema of a Parquet file with its metadata.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    require_regular_file(path, InputError)
    with reading(path, advice):
        schema = pq.read_schema(path)
        _refuse_repeated(path, schema, advice)
    return schema


def _refuse_repeated(path: Path, schema: pa.Schema, advice: str) -> None:
    # names that are not UTF-8 are found when they are first looked at
    for name in schema.names:
        if schema.names.count(name) > 1:
            msg = f"{path}: has column {shown(name)} more than once; {advice}"
            raise InputError(msg)


def samples_sha256(path: Path, columns: Iterable[str], footer: pq.FileMetaData) -> str:
    """Return the SHA-256 of some columns as they are stored, whatever the file says besides.

    Nothing is decoded: the same samples, compressed otherwise, are others.

    Parameters
    ----------
    path
        A Parquet file.
    columns
        Names of columns of numbers.
    footer
        Of the file.

    Returns
    -------
    str
        Empty if none of them ever changes.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    wanted = set(columns)
    digest = hashlib.sha256()
    changing = False
    with reading(path, "copy it again from its source"), path.open("rb") as file:
        for number in range(footer.num_row_groups):
            group = footer.row_group(number)
            for chunk in map(group.column, range(group.num_columns)):
                if chunk.path_in_schema not in wanted:
                    continue
                known = chunk.statistics
                changing |= known is None or (known.has_min_max and known.min != known.max)
                starts = (chunk.dictionary_page_offset, chunk.data_page_offset)
                file.seek(min(start for start in starts if start is not None))
                digest.update(chunk.path_in_schema.encode())
                digest.update(file.read(max(chunk.total_compressed_size, 0)))
    return digest.hexdigest() if changing else ""


def read_whole(path: Path, advice: str) -> pa.Table:
    """Read a Parquet file of bounded length, and verify its checksums.

    Raises
    ------
    InputError
        If it cannot be read, or is too long.
    """
    require_regular_file(path, InputError)
    with reading(path, advice), pq.ParquetFile(path, page_checksum_verification=True) as file:
        if file.metadata.num_rows > MOST_ROWS:
            msg = f"{path}: has {file.metadata.num_rows} rows, at most {MOST_ROWS} are read"
            raise InputError(msg)
        _refuse_repeated(path, file.schema_arrow, advice)
        table = file.read()
        table.validate(full=True)
        return table
