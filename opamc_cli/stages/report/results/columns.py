"""Tables as named arrays, which is what figures are drawn from."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

Columns = Mapping[str, NDArray[Any]]


def to_columns(table: pa.Table) -> dict[str, NDArray[Any]]:
    """Return a table's columns as arrays; null numbers become NaN, lists stay lists."""
    result = {}
    for name in table.column_names:
        column = table.column(name)
        whole = pa.types.is_integer(column.type) and column.null_count
        if whole or pa.types.is_null(column.type):
            column = column.cast(pa.float64())
        result[name] = np.asarray(column.to_numpy(zero_copy_only=False))
    return result


def select(columns: Columns, mask: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
    """Return the rows where `mask` holds."""
    return {name: values[mask] for name, values in columns.items()}


def n_rows(columns: Columns) -> int:
    """Return the number of rows."""
    return len(next(iter(columns.values()))) if columns else 0


def extremes(
    x: NDArray[np.floating], y: NDArray[np.floating], max_points: int
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Thin a trace to its lowest and highest point in each of max_points / 2 equal stretches.

    Nothing that sticks out is lost, unlike with every n-th point.
    """
    if x.size <= max_points:
        return x, y
    size = -(-x.size // (max_points // 2))
    stretches = np.full((-(-x.size // size), size), np.nan, dtype=y.dtype)
    stretches.ravel()[: y.size] = y
    unknown = np.isnan(stretches)
    low = np.argmin(np.where(unknown, np.inf, stretches), axis=1)
    high = np.argmax(np.where(unknown, -np.inf, stretches), axis=1)
    nothing = ~np.isfinite(stretches).any(axis=1)
    low[nothing] = high[nothing] = 0
    keep = np.unique(np.arange(0, x.size, size)[:, None] + np.stack([low, high], axis=1))
    return x[keep], y[keep]
