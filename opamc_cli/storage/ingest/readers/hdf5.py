"""HDF5 files, and MAT files of version 7.3, which are HDF5 inside."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import (
    BLOCK_ROWS,
    Array,
    Block,
    Listed,
    Name,
    Rate,
    Selection,
    check_lengths,
    declared_rate,
    missing_channel,
    missing_library,
    samples_of,
    width_of,
)
from opamc_cli.storage.ingest.time.dates import parse_dates

ATTRIBUTE_MARK = "@"
"""Separates an object's path from the name of its attribute: ``motor/current@unit``."""


@contextmanager
def open_hdf5(path: Path, struct_separator: str = "/") -> Iterator["Hdf5Source"]:
    """Open an HDF5 file; `struct_separator` is what the map writes between group and dataset.

    Raises
    ------
    InputError
        If it is not HDF5 or h5py is not installed.
    """
    try:
        import h5py
    except ImportError as error:
        raise missing_library(path, "h5py", "hdf5") from error
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        msg = f"{path}: cannot be opened as HDF5 ({_first_line(error)}); check format in the map"
        raise InputError(msg) from error
    with file:
        yield Hdf5Source(path, file, struct_separator)


class Hdf5Source:
    """An open HDF5 file; datasets are read slice by slice."""

    def __init__(self, path: Path, file: Any, struct_separator: str) -> None:
        self.path = path
        self._file = file
        self._separator = struct_separator
        self._rates: dict[str, Rate | None] = {}

    def channels(self) -> list[Listed]:
        """Return the datasets and record fields that hold numbers, one or two-dimensional."""
        listed = []
        for name in self._known():
            dataset, field = self._dataset(name)
            kind = dataset.dtype if field is None else dataset.dtype[field]
            if kind.kind in "fiu" and not _is_matlab_text(dataset):
                unit = dataset.attrs.get("unit", dataset.attrs.get("units"))
                width = width_of(tuple(dataset.shape))
                if width is not False:
                    unit = None if unit is None else _text(unit)
                    listed.append(Listed(name, width, unit, rate=self._rate(dataset)))
        return listed

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected datasets block by block."""
        columns: dict[str, _Column] = {}
        lengths: dict[Name, int] = {}
        for name, selection in selections.items():
            columns[name] = self._column(selection)
            lengths[f"{selection.source}"] = columns[name].n_samples
        n_samples = check_lengths(self.path, lengths)
        for start in range(0, n_samples, BLOCK_ROWS):
            stop = min(start + BLOCK_ROWS, n_samples)
            block = {name: column.read(start, stop) for name, column in columns.items()}
            for name, selection in selections.items():
                if selection.dates:
                    texts = [_text(value) for value in block[name]]
                    block[name] = parse_dates(self.path, selection.source, texts)
            yield block

    def value(self, source: Name) -> object:
        """Return an attribute (``path@name``), or a dataset's first value or text."""
        place, mark, attribute = str(source).rpartition(ATTRIBUTE_MARK)
        if mark:
            owner = self._object(place or "/", source)
            if attribute not in owner.attrs:
                raise missing_channel(self.path, source, [f"{place}@{a}" for a in owner.attrs])
            found: object = owner.attrs[attribute]
        else:
            dataset, field = self._dataset(source)
            values = dataset[()] if field is None else dataset[field]
            if _is_matlab_text(dataset):
                return "".join(map(chr, np.ravel(values)))
            found = values
        flat = np.ravel(np.asarray(found))
        if flat.size == 0:
            msg = f"{self.path}: {source!r} is empty where a value is needed"
            raise InputError(msg)
        first = flat[0]
        return first.decode() if isinstance(first, bytes) else first

    def _rate(self, owner: Any) -> Rate | None:
        """Where the rate is: an attribute of an object, or in the groups that hold it."""
        place = owner.name.strip("/").replace("/", self._separator)
        if place not in self._rates:
            found = declared_rate(owner.attrs, place + ATTRIBUTE_MARK)
            if found is None and hasattr(owner, "items"):
                single = {k: v[()] for k, v in owner.items() if getattr(v, "size", 0) == 1}
                found = declared_rate(single, place + self._separator * bool(place))
            outer = found is None and place
            self._rates[place] = self._rate(owner.parent) if outer else found
        return self._rates[place]

    def _column(self, selection: Selection) -> "_Column":
        dataset, field = self._dataset(selection.source)
        kind = dataset.dtype if field is None else dataset.dtype[field]
        if kind.kind not in "fiub" and not selection.dates:
            msg = f"{self.path}: {selection.source!r} holds {kind}, numbers are needed"
            raise InputError(msg)
        n_samples, time = samples_of(
            self.path, selection.source, selection.index, tuple(dataset.shape)
        )
        return _Column(dataset, field, n_samples, time, selection.index or 0, selection.dates)

    def _dataset(self, source: Name) -> tuple[Any, str | None]:
        import h5py

        name = str(source)
        place = "/".join(name.split(self._separator))
        if place in self._file and isinstance(self._file[place], h5py.Dataset):
            return self._file[place], None
        # a table of records: the last part names a field of it
        parent, _, field = name.replace(".", "/").rpartition("/")
        if parent and parent in self._file:
            dataset = self._file[parent]
            if isinstance(dataset, h5py.Dataset) and field in (dataset.dtype.names or ()):
                return dataset, field
        raise missing_channel(self.path, source, self._known())

    def _object(self, place: str, source: Name) -> Any:
        place = "/".join(place.split(self._separator)) or "/"
        if place not in self._file:
            raise missing_channel(self.path, source, self._known())
        return self._file[place]

    def _known(self) -> list[str]:
        import h5py

        names: list[str] = []

        def visit(name: str, item: Any) -> None:
            if isinstance(item, h5py.Dataset) and not name.startswith("#refs#"):
                shown = self._separator.join(name.split("/"))
                fields = item.dtype.names
                names.extend([f"{shown}.{f}" for f in fields] if fields else [shown])

        self._file.visititems(visit)
        return names


class _Column:
    """One channel of a dataset: where its samples are."""

    def __init__(
        self, dataset: Any, field: str | None, n_samples: int, time: int | None, at: int, raw: bool
    ) -> None:
        self._dataset = dataset if field is None else dataset.fields(field)
        self.n_samples = n_samples
        self._time = time
        self._at = at
        self._raw = raw

    def read(self, start: int, stop: int) -> Array:
        if self._time is None:
            values = self._dataset[start:stop]
        elif self._time == 0:
            values = self._dataset[start:stop, self._at]
        else:
            values = self._dataset[self._at, start:stop]
        values = np.asarray(values)
        return values if self._raw else values.astype(np.float64)


def _is_matlab_text(dataset: Any) -> bool:
    return bool(dataset.attrs.get("MATLAB_class") == b"char")


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _first_line(error: Exception) -> str:
    return str(error).strip().splitlines()[0]
