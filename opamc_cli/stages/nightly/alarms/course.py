"""A joint's nights, one after the other, against one baseline."""

import math
from collections.abc import Iterator, Mapping, Sequence
from datetime import date
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.trend.chart import control_chart
from opamc_cli.stages.nightly.inputs.baseline_name import condition_in

JUDGED = ("healthy", "changed", "fault")


def courses(
    joint: Sequence[Mapping[str, Any]],
) -> Iterator[tuple[list[Mapping[str, Any]], str]]:
    """Yield a joint's nights by the baseline that they were compared with.

    Nights of another condition say nothing of what this one's have shown: neither do they clear
    its alarms, nor does its chart begin anew after them.

    Yields
    ------
    rows : list
        Nights of one condition, one baseline after the other.
    replaced : str
        First night of the condition's next baseline; empty without one.
    """
    by_condition: dict[str, list[Mapping[str, Any]]] = {}
    for row in joint:
        by_condition.setdefault(condition_in(row["baseline"]), []).append(row)
    for rows in by_condition.values():
        parts = [list(part) for _, part in groupby(rows, key=lambda row: row["baseline"])]
        begins = [*(part[0]["night"] for part in parts[1:]), ""]
        yield from zip(parts, begins, strict=True)


def chart_of(rows: Sequence[Mapping[str, Any]], baseline_nights: int) -> NDArray[np.float64]:
    """Return the chart's average of each night of a joint, in its own standard deviations."""
    values = [
        row["distance"] - (row["common"] or 0.0)
        if row["state"] in JUDGED and not row["harmless"] and row["distance"] is not None
        else math.nan
        for row in rows
    ]
    healthy = np.array([row["state"] == "healthy" for row in rows], dtype=np.bool_)
    return control_chart(np.array(values, dtype=np.float64), healthy, baseline_nights)


def measured(rows: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the nights that were judged, and by a distance."""
    return [row for row in rows if row["state"] in JUDGED and row["distance"] is not None]


def distances(rows: Sequence[Mapping[str, Any]]) -> NDArray[np.float64]:
    """Log distances, shape (n,), less what all joints of the robot share."""
    return np.array([row["distance"] - (row["common"] or 0.0) for row in rows], dtype=np.float64)


def days(rows: Sequence[Mapping[str, Any]]) -> NDArray[np.float64]:
    """Nights as numbers of days, shape (n,)."""
    return np.array([day(row["night"]) for row in rows], dtype=np.float64)


def day(night: str) -> int:
    """Return the number of a night's day."""
    return date.fromisoformat(night).toordinal()
