"""Text tables: any separator, decimal mark, encoding; with or without a header.

Rows are parsed block by block, so that a recording of gigabytes does not need gigabytes.
"""

import codecs
import csv
import io
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.map.map_file import IngestMap
from opamc_cli.storage.ingest.source import Block, Listed, Name, Selection, missing_channel
from opamc_cli.storage.ingest.time.dates import parse_dates, timestamp_type, utc_text

BLOCK_BYTES = 1 << 22
FIELD_MARK = "\x1f"
"""Stands for a separator of more than one character once the text is rewritten."""

GZIP, ZIP = b"\x1f\x8b", b"PK\x03\x04"

_CONVERSION = re.compile(r"column #(\d+): Row #(\d+): .*invalid value '(.*)'", re.DOTALL)
_WIDTH = re.compile(r"Row #(\d+): Expected (\d+) columns, got (\d+)")

MOST_LINE = 1 << 22
"""Characters of a line of the heading that are read at once."""


class CsvSource:
    """An open text table.

    Raises
    ------
    InputError
        If there are no data rows, or more columns than names, or the text is not in the map's
        encoding.
    """

    def __init__(self, path: Path, channels: IngestMap) -> None:
        self.path = path
        self._map = channels
        self._encoding = "utf-8" if _is_utf8(channels.encoding) else channels.encoding
        self._no_number = [*pacsv.ConvertOptions().null_values, *channels.missing]
        self._dates: set[int] = set()
        self.remarks: list[str] = []
        self._skipped = channels.skip_rows + channels.header + channels.units_rows * channels.header
        separator = {"tab": "\t", "\\t": "\t"}.get(channels.separator, channels.separator)
        self._pattern = r"[ \t]+" if separator == "whitespace" else re.escape(separator)
        self._rewrites = separator == "whitespace" or len(separator) > 1
        self._delimiter = FIELD_MARK if self._rewrites else separator
        header, self._units, self._first_row = self._read_top()
        self._names = [name.strip() for name in header]
        beyond = [text for text in self._first_row[len(header) :] if text.strip()]
        if header and beyond:  # else each column might pass for its neighbour
            msg = (
                f"{path}: its first row has {len(self._first_row)} columns, its header names "
                f"{len(header)}; check separator and decimal, or name what is missing in the header"
            )
            raise InputError(msg)

    def __enter__(self) -> Self:
        """Return the source itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is held open between reads."""

    def channels(self) -> list[Listed]:
        """Return the columns whose first row holds a number, a date or nothing."""
        listed = []
        for position, text in enumerate(self._first_row):
            given = self._names[position] if position < len(self._names) else ""
            known = "" if text.strip() in self._no_number else text.strip()
            kind = _kind(known, self._map.decimal)
            if kind is None or (self._map.header and not given):
                continue
            name: Name = given if given and self._names.count(given) == 1 else position
            repeated = f"{given} ({position})" if given and name == position else None
            unit = self._units[position].strip(" []()") if position < len(self._units) else ""
            listed.append(Listed(name, None, unit or None, kind == "date", repeated))
        return listed

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected columns block by block."""
        position = {name: self._position(s.source) for name, s in selections.items()}
        types = {
            f"c{position[name]}": self._date_type(position[name]) if s.dates else pa.float64()
            for name, s in selections.items()
        }
        self._dates = {position[name] for name, s in selections.items() if s.dates}
        for batch in self._batches(types):
            block: Block = {}
            for name, selection in selections.items():
                column = batch.column(f"c{position[name]}")
                if pa.types.is_string(column.type):
                    texts = [text.replace(",", ".") for text in column.to_pylist()]
                    block[name] = parse_dates(self.path, selection.source, texts)
                else:
                    block[name] = _to_numpy(column, selection.dates)
            yield block

    def value(self, source: Name) -> object:
        """Return the value of a column in the first data row."""
        return self._first_row[self._position(source)].strip()

    def _date_type(self, position: int) -> pa.DataType:
        first = self._first_row[position]
        # ISO 8601 allows a comma before the fraction of a second, the parser does not
        return pa.string() if "," in first else timestamp_type(first)

    def _position(self, source: Name) -> int:
        if isinstance(source, int):
            if not 0 <= source < len(self._first_row):
                known = [f"0..{len(self._first_row) - 1}"]
                raise missing_channel(self.path, source, known)
            return source
        found = [i for i, name in enumerate(self._names) if name == source.strip()]
        if not found or found[0] >= len(self._first_row):
            raise missing_channel(self.path, source, [name for name in self._names if name])
        if len(found) > 1:
            msg = (
                f"{self.path}: {len(found)} columns are called {source!r}; "
                f"name one by its number: {', '.join(map(str, found))}"
            )
            raise InputError(msg)
        return found[0]

    def _read_top(self) -> tuple[list[str], list[str], list[str]]:
        units: list[str] = []
        try:
            with self._text() as text:
                for _ in range(self._map.skip_rows):
                    if not text.readline(MOST_LINE):
                        break
                rows = (row for row in csv.reader(text, delimiter=self._delimiter) if row)
                header = next(rows, []) if self._map.header else []
                for _ in range(self._map.units_rows * self._map.header):
                    units = units or next(rows, [])
                first = next(rows, None)
        except UnicodeDecodeError as error:
            raise self._wrong_encoding(error) from error
        except csv.Error as error:
            msg = f"{self.path}: its first rows are not a text table ({error})"
            raise InputError(msg) from error
        if first is None:
            msg = f"{self.path}: no data rows after {self._skipped} lines; check skip_rows, header"
            raise InputError(msg)
        return header, units, first

    def _text(self) -> io.TextIOWrapper:
        encoding = "utf-8-sig" if self._encoding == "utf-8" else self._encoding
        # universal newlines: csv.reader alone would refuse files that end lines by CR
        return io.TextIOWrapper(self._bytes(), encoding=encoding, newline=None)

    def _bytes(self) -> Any:
        raw = pa.input_stream(str(self.path), compression="detect")
        if not self._rewrites:
            return raw
        blanks = self._map.separator == "whitespace"
        return io.BufferedReader(_Rewritten(raw, self._pattern, blanks), BLOCK_BYTES)

    def _batches(self, types: Mapping[str, pa.DataType]) -> Iterator[pa.RecordBatch]:
        names = [f"c{i}" for i in range(len(self._first_row))]
        try:
            with pacsv.open_csv(
                self._bytes(),
                read_options=pacsv.ReadOptions(
                    column_names=names,
                    skip_rows=self._skipped,
                    block_size=BLOCK_BYTES,
                    encoding=self._encoding,
                    use_threads=False,
                ),
                parse_options=pacsv.ParseOptions(
                    delimiter=self._delimiter, invalid_row_handler=self._cut_off
                ),
                convert_options=pacsv.ConvertOptions(
                    include_columns=list(types),
                    column_types=dict(types),
                    decimal_point=self._map.decimal,
                    null_values=self._no_number,
                ),
            ) as reader:
                yield from reader
        except UnicodeDecodeError as error:
            raise self._wrong_encoding(error) from error
        except (pa.ArrowException, OSError) as error:
            raise InputError(self._reason(str(error))) from error

    def _cut_off(self, row: Any) -> str:
        """Skip a last line that a logger was stopped in; all else of another width is an error."""
        if row.actual_columns >= row.expected_columns:
            return "error"
        last = b""
        with self._bytes() as stream:
            while part := stream.read(BLOCK_BYTES):
                last = (last + part)[-MOST_LINE:]
        ends = last.endswith(row.text.encode(self._encoding)) and not last.endswith((b"\n", b"\r"))
        self.remarks = [f"{self.path}: its last line is cut off and left out"] if ends else []
        return "skip" if ends else "error"

    def _reason(self, text: str) -> str:
        first_line = " ".join(text.split())[:200]
        if match := _CONVERSION.search(text):
            column, row, value = int(match[1]), int(match[2]), match[3]
            name = self._names[column] if column < len(self._names) else f"number {column}"
            held = f"{self.path}: column {name} holds {value[:40]!r} in line {row}, which is"
            if column in self._dates:
                return (
                    f"{held} no ISO 8601 time such as 2026-10-19T13:00:00.1; write it so, or give "
                    "sampling_rate_hz instead of time"
                )
            return (
                f"{held} not a number with decimal {self._map.decimal!r}; check decimal and "
                "separator, or name what stands for no number in missing"
            )
        if match := _WIDTH.search(text):
            return (
                f"{self.path}: line {match[1]} has {match[3]} columns where the first has "
                f"{match[2]}; check separator, skip_rows and whether the file is cut off"
            )
        return f"{self.path}: cannot be read as a text table ({first_line})"

    def _wrong_encoding(self, error: UnicodeDecodeError) -> InputError:
        with self.path.open("rb") as raw:
            begin = raw.read(4)
        if self.path.suffix != ".gz" and begin.startswith(GZIP):
            return InputError(
                f"{self.path}: is compressed by gzip; give it a name that ends in .gz"
            )
        if begin == ZIP:
            return InputError(
                f"{self.path}: is a zip archive, as spreadsheets (.xlsx) are; save it as text (CSV)"
            )
        held = error.object[:4] if isinstance(error.object, bytes) else b""
        if self.path.suffix == ".gz" and held.startswith(GZIP):
            return InputError(f"{self.path}: is compressed twice by gzip; unpack it once")
        near = (
            "utf-16" if held.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "latin-1"
        )
        return InputError(
            f"{self.path}: is not text in {self._map.encoding} (byte {error.start} cannot be "
            f"decoded); set encoding, such as {near}, in the map"
        )


class _Rewritten(io.RawIOBase):
    """A byte stream in which every separator is one `FIELD_MARK`."""

    def __init__(self, raw: Any, pattern: str, blanks: bool) -> None:
        self._raw = raw
        self._pattern = re.compile(pattern.encode())
        self._blanks = blanks
        self._rest = b""
        self._ready = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._ready:
            chunk = self._raw.read(BLOCK_BYTES)
            if not chunk and not self._rest:
                return 0
            lines = self._rest + chunk
            # whole lines only: a separator must not be cut in two
            end = lines.rfind(b"\n") + 1 if chunk else len(lines)
            self._rest, lines = lines[end:], lines[:end]
            if self._blanks:
                lines = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", lines)
            self._ready = self._pattern.sub(FIELD_MARK.encode(), lines)
        n = min(len(buffer), len(self._ready))
        buffer[:n], self._ready = self._ready[:n], self._ready[n:]
        return n


def _kind(text: str, decimal: str) -> str | None:
    """Return whether a cell holds a number (or nothing) or a date, None where something else."""
    try:
        float(text.replace(decimal, ".") or "nan")
    except ValueError:
        return "date" if utc_text(text.replace(",", ".")) is not None else None
    return "number"


def _is_utf8(encoding: str) -> bool:
    return encoding.lower().replace("_", "-") in ("utf-8", "utf8", "utf-8-sig")


def _to_numpy(column: pa.Array, dates: bool) -> np.ndarray[Any, np.dtype[Any]]:
    values = np.asarray(column.to_numpy(zero_copy_only=False))
    return values.astype("datetime64[us]") if dates else values.astype(np.float64, copy=False)
