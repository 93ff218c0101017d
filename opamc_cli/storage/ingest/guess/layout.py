"""How a text table is laid out: separator, decimal mark, header, encoding."""

import re
from dataclasses import dataclass, replace
from pathlib import Path

import pyarrow as pa

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.time.dates import utc_text

LOOKED_AT_BYTES = 1 << 17
"""Some hundred rows: enough to see a header and where the numbers begin."""

SEPARATORS = (",", ";", "tab", "|", "whitespace")


@dataclass(frozen=True)
class Layout:
    """The text keys of a map."""

    separator: str
    decimal: str
    header: bool
    skip_rows: int
    units_rows: int
    encoding: str


def text_layout(path: Path, encoding: str | None = None) -> Layout:
    """Return the layout under which most cells of a text table are numbers.

    Parameters
    ----------
    path
        The file.
    encoding
        Of its text, None where the text is to tell it.

    Raises
    ------
    InputError
        If there is none.
    """
    text, encoding = _top(path, encoding)
    lines = text.splitlines()
    found = [
        _layout([_cells(line, separator) for line in lines], separator, decimal)
        for separator in SEPARATORS
        for decimal in (".", ",")
        if decimal != separator
    ]
    best = max(filter(None, found), key=lambda one: one[0], default=None)
    if best is None:
        msg = f"{path}: no rows of numbers are found in it; write the map by hand"
        raise InputError(msg)
    return replace(best[1], encoding=encoding)


def _top(path: Path, encoding: str | None) -> tuple[str, str]:
    try:
        with pa.input_stream(str(path), compression="detect") as stream:
            raw = stream.read(LOOKED_AT_BYTES)
    except (pa.ArrowException, OSError) as error:
        msg = f"{path}: cannot be read ({str(error).splitlines()[0][:120]})"
        raise InputError(msg) from error
    # the last line is cut off, here or where the logger was stopped
    whole = raw[: raw.rfind(b"\n") + 1] if raw.count(b"\n") > 2 else raw
    if encoding is not None:
        return whole.decode(encoding, "replace"), encoding
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return whole.decode("utf-16", "replace"), "utf-16"
    try:
        return whole.decode("utf-8-sig"), "utf-8"
    except UnicodeDecodeError:
        return whole.decode("cp1252", "replace"), "cp1252"


def _cells(line: str, separator: str) -> list[str]:
    if separator == "whitespace":
        return line.split()
    mark = "\t" if separator == "tab" else separator
    return [cell.strip().strip('"') for cell in line.split(mark)] if line.strip() else []


def _layout(rows: list[list[str]], separator: str, decimal: str) -> tuple[float, Layout] | None:
    """Return how many cells of a row are numbers, and the layout; None where it does not fit."""
    filled = [place for place, row in enumerate(rows) if row]
    if len(filled) < 2:
        return None
    width = len(rows[filled[-1]])
    start = None
    for place in reversed(filled):
        row = rows[place]
        if len(row) != width or not _holds_numbers(row, decimal):
            break
        start = place
    if start is None:
        return None
    data = [rows[place] for place in filled if place >= start]
    numbers = sum(_is_number(cell, decimal) for row in data for cell in row) / len(data)
    # a separator at the end of each row makes a column that has no name
    widths = {width, width - 1} if not any(row[-1] for row in data) else {width}
    # above the numbers stand names, and under them units
    titles: list[int] = []
    for place in range(start - 1, -1, -1):
        if not rows[place]:
            continue
        if not _could_be_titles(rows[place], widths):
            break
        titles.insert(0, place)
    titles = titles[-2:]
    header = bool(titles)
    skip = titles[0] if header else start
    return numbers, Layout(separator, decimal, header, skip, max(len(titles) - 1, 0), "")


def _could_be_titles(row: list[str], widths: set[int]) -> bool:
    named = [cell for cell in row if cell]
    return len(row) in widths and len(named) >= max(1, len(row) // 3)


def _holds_numbers(row: list[str], decimal: str) -> bool:
    known = [cell for cell in row if cell]
    numbers = [cell for cell in known if _is_number(cell, decimal)]
    dates = [cell for cell in known if utc_text(cell.replace(",", ".")) is not None]
    return bool(numbers) and len(numbers) + len(dates) >= 0.5 * len(known)


_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(nan|inf)", re.I)


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == "," and "." in cell:
        return False
    return _NUMBER.fullmatch(cell.replace(decimal, ".")) is not None
