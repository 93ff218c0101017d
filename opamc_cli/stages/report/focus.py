"""Which axis, motion and order a figure shows when there is room for one."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from opamc_cli.stages.report.results.columns import Columns, select
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs

SEVERITY = ("insufficient-data", "healthy", "changed", "fault")

LEAST_AXES = 2
"""Joints that a figure needs which compares them; one joint's numbers stand in the table."""


@dataclass(frozen=True)
class Focus:
    """What the report looks at most closely."""

    axis: int
    """The axis that is worst off."""
    motion: Mapping[int, int]
    """The motion of each axis whose divergence rose most."""
    order: Mapping[int, int]
    """The order that each axis was decided on."""


def choose_focus(inputs: ReportInputs) -> Focus:
    """Return the worst axis, and for every axis its worst motion and its order."""
    orders = {axis: _order(inputs, axis) for axis in inputs.all_axes}
    motions = {axis: _worst_motion(inputs.scores, axis, orders[axis]) for axis in inputs.all_axes}
    return Focus(max(inputs.axes, key=lambda axis: _rank(inputs, axis)), motions, orders)


def need_divergences(inputs: ReportInputs) -> None:
    """Check that there is a divergence to draw.

    Raises
    ------
    NothingToDrawError
        If all are unknown.
    """
    if not np.isfinite(inputs.scores["jsd"]).any():
        msg = "scores.parquet holds no finite divergence"
        raise NothingToDrawError(msg)


def by_severity(inputs: ReportInputs) -> list[int]:
    """Return all axes from the worst to the best."""
    return sorted(inputs.all_axes, key=lambda axis: (_rank(inputs, axis), -axis), reverse=True)


def axis_scores(
    inputs: ReportInputs, axis: int, order: int, role: str, motion: int | None = None
) -> dict[str, Any]:
    """Return the finite scores of an axis, one order and role, and maybe one motion."""
    scores = inputs.scores
    mask = (scores["axis"] == axis) & (scores["order"] == order) & (scores["role"] == role)
    mask &= np.isfinite(scores["jsd"].astype(np.float64))
    if motion is not None:
        mask &= scores["motion"] == motion
    return select(scores, mask)


def pooled_features(inputs: ReportInputs, axis: int, order: int) -> dict[str, float] | None:
    """Return the features of an axis over all its motions, if the table holds them."""
    table = inputs.features
    rows = np.flatnonzero(
        (table["axis"] == axis) & (table["order"] == order) & (table["motion"] == -1)
    )
    if not rows.size:
        return None
    names = ("delta_mu", "delta_var", "ks", "lda")
    values = {name: float(table[name][rows[0]]) for name in names if name in table}
    return {name: value for name, value in values.items() if np.isfinite(value)}


def _rank(inputs: ReportInputs, axis: int) -> tuple[int, float]:
    entry = inputs.axis_verdict(axis) or {}
    state = str(entry.get("state", "insufficient-data"))
    index = entry.get("health_index")
    if index is None:
        features = pooled_features(inputs, axis, _order(inputs, axis)) or {}
        index = features.get("delta_mu", -np.inf)
    return (SEVERITY.index(state) if state in SEVERITY else 0), float(index)


def _order(inputs: ReportInputs, axis: int) -> int:
    entry = inputs.axis_verdict(axis) or {}
    orders = [int(m["order"]) for m in entry.get("motions", ()) if "order" in m]
    if orders:
        return max(orders)
    scores = inputs.scores
    return int(scores["order"][scores["axis"] == axis].max(initial=0))


def _worst_motion(scores: Columns, axis: int, order: int) -> int:
    mine = select(scores, (scores["axis"] == axis) & (scores["order"] == order))
    worst, rise = -1, -np.inf
    for motion in np.unique(mine["motion"]):
        jsd = {
            role: mine["jsd"][
                (mine["motion"] == motion) & (mine["role"] == role) & np.isfinite(mine["jsd"])
            ]
            for role in ("baseline", "target")
        }
        means = {name: float(np.mean(values)) for name, values in jsd.items() if values.size}
        change = means.get("target", -np.inf) - means.get("baseline", 0.0)
        if change > rise or worst < 0:
            worst, rise = int(motion), change
    return worst
