"""MAT files: versions 4 to 7 by scipy, version 7.3 as HDF5.

Channels are named ``variable`` or ``struct.field.field``. Older MAT files are compressed as one
piece per variable, so a variable is read whole; only the variables that the map names are.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatReadError

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.readers.hdf5 import Hdf5Source, open_hdf5
from opamc_cli.storage.ingest.source import (
    BLOCK_ROWS,
    Array,
    Block,
    Listed,
    Name,
    Selection,
    check_lengths,
    declared_rate,
    missing_channel,
    samples_of,
    width_of,
)
from opamc_cli.storage.ingest.time.dates import parse_dates

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
HDF5_OFFSET = 512
"""Where the HDF5 part of a MAT file of version 7.3 begins."""


@contextmanager
def open_mat(path: Path) -> Iterator["MatSource | Hdf5Source"]:
    """Open a MAT file of any version.

    Raises
    ------
    InputError
        If it is not a MAT file, or is of version 7.3 and h5py is not installed.
    """
    with path.open("rb") as handle:
        start = handle.read(HDF5_OFFSET + len(HDF5_MARK))
    if start.startswith(HDF5_MARK) or start.endswith(HDF5_MARK):
        with open_hdf5(path, struct_separator=".") as source:
            yield source
    else:
        yield MatSource(path)


class MatSource:
    """A MAT file of version 4 to 7."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._loaded: dict[str, Any] = {}
        self._variables = [name for name, _, _ in self._call(scipy.io.whosmat)]

    def channels(self) -> list[Listed]:
        """Return the variables and struct fields that hold numbers."""
        self._load(set(self._variables))
        listed: list[Listed] = []
        single: dict[str, Array] = {}
        names = list(self._variables)
        while names:
            name = names.pop(0)
            values = self._item(name)
            if values.dtype == object and values.size == 1:
                fields = getattr(values.flat[0], "_fieldnames", None) or ()
                names[:0] = [f"{name}.{field}" for field in fields]
            elif values.dtype.kind in "fiu":
                width = width_of(values.shape)
                if width is not False:
                    listed.append(Listed(name, width))
                elif values.size == 1:
                    single[name] = values
        self._loaded.clear()
        fields = [(name.rpartition("."), values) for name, values in single.items()]
        rates = (declared_rate({name: v}, place + dot) for (place, dot, name), v in fields)
        rate = next((one for one in rates if one is not None), None)
        return [replace(one, rate=rate) for one in listed]

    def blocks(self, selections: Mapping[str, Selection]) -> Iterator[Block]:
        """Yield the selected variables block by block."""
        wanted = {str(s.source).partition(".")[0] for s in selections.values()}
        self._load(wanted)
        columns = {name: self._column(s) for name, s in selections.items()}
        self._loaded.clear()
        lengths: dict[Name, int] = {
            selections[name].source: len(values) for name, values in columns.items()
        }
        n_samples = check_lengths(self.path, lengths)
        for start in range(0, n_samples, BLOCK_ROWS):
            stop = start + BLOCK_ROWS
            yield {
                name: values[start:stop]
                if selections[name].dates
                else values[start:stop].astype(np.float64)
                for name, values in columns.items()
            }

    def value(self, source: Name) -> object:
        """Return a variable's first value, or its text."""
        self._load({str(source).partition(".")[0]})
        flat = np.ravel(self._item(source))
        if flat.size == 0:
            msg = f"{self.path}: {source!r} is empty where a value is needed"
            raise InputError(msg)
        return flat[0]

    def _call(self, function: Any, **options: Any) -> Any:
        try:
            return function(str(self.path), **options)
        except MatReadError as error:
            # the one error of scipy's own descends from nothing that is caught with the others
            raise ValueError(str(error)) from error

    def _load(self, variables: set[str]) -> None:
        for variable in sorted(variables):
            if variable not in self._variables:
                raise missing_channel(self.path, variable, self._variables)
        absent = sorted(variables - set(self._loaded))
        if absent:
            loaded = self._call(
                scipy.io.loadmat, variable_names=absent, struct_as_record=False, squeeze_me=False
            )
            self._loaded.update({name: loaded[name] for name in absent})

    def _item(self, source: Name) -> Array:
        variable, *struct_fields = str(source).split(".")
        value = self._loaded[variable]
        known = self._variables
        for field in struct_fields:
            # a struct is an array of structs; of one, as a rule
            if isinstance(value, np.ndarray) and value.dtype == object and value.size == 1:
                value = value.flat[0]
            known = list(getattr(value, "_fieldnames", None) or ())
            if field not in known:
                raise missing_channel(self.path, source, known)
            value = getattr(value, field)
        return np.asarray(value)

    def _column(self, selection: Selection) -> Array:
        values = self._item(selection.source)
        if selection.dates:
            texts = [str(np.ravel(text)[0]).strip() for text in np.ravel(values)]
            return parse_dates(self.path, selection.source, texts)
        if values.dtype.kind not in "fiub":
            what = "a struct" if values.dtype == object else str(values.dtype)
            msg = f"{self.path}: {selection.source!r} holds {what}, numbers are needed"
            raise InputError(msg)
        _, time = samples_of(self.path, selection.source, selection.index, values.shape)
        if time is None:
            return values
        return np.asarray(np.take(values, selection.index or 0, axis=1 - time))
