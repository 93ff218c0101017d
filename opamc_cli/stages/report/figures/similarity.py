"""Sliding similarity of the runs with the reference cycle (thesis Figure 3-4)."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from opamc_cli.signal.cycles.identification import sliding_similarity
from opamc_cli.stages.report.figures.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.focus import Focus
from opamc_cli.stages.report.results.columns import Columns, n_rows, select
from opamc_cli.stages.report.results.inputs import (
    ROLES,
    NothingToDrawError,
    ReportInputs,
    time_order,
)

MAX_SEGMENTS = 240
"""Of one role; the ones after that are left out, which the panel says."""


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw the similarity at every shift of the reference, for baseline and target."""
    baseline = inputs.roles["baseline"].motions
    if baseline is None or "reference" not in baseline:
        msg = "baseline/motions.parquet is absent"
        raise NothingToDrawError(msg)
    mine = select(baseline, baseline["axis"] == focus.axis)
    # a baseline of several runs holds one reference cycle of each axis
    reference = select(mine, mine["reference"].astype(bool))
    if not n_rows(reference):
        msg = f"no reference cycle was found on axis {focus.axis}"
        raise NothingToDrawError(msg)
    if (reference["kind"] == "window").all():
        msg = "the recordings never stand still: one kind of window, nothing to identify"
        raise NothingToDrawError(msg)
    threshold = _threshold(inputs)
    with style():
        drawing = canvas(3.6)
        panels = drawing.subplots(2, 1, sharey=True)
        words = []
        for panel, role in zip(panels, ROLES, strict=True):
            n_cycles, n_unidentified = _panel(panel, inputs, role, focus.axis, reference)
            panel.axhline(threshold, color=colour("muted"), linewidth=0.8, dashes=(4, 3))
            words.append(f"{role}: {n_cycles} cycles, {n_unidentified} segments unidentified")
            panel.set_title(words[-1])
            panel.set_ylabel("similarity")
        panels[0].set_ylim(top=1.02)
        panels[1].set_xlabel("segment at which the reference cycle is laid on")
        return finish(
            drawing,
            "similarity",
            f"Identification on axis {focus.axis}",
            "Cosine similarity of the segments' variances with the reference cycle's, slid by one "
            "segment, run after run. Filled: taken as the start of a cycle; cross: unidentified, "
            f"left out; dashed: the least similarity of a cycle ({threshold:g}). Similarity alone "
            "does not make a cycle: duration, speed and direction must fit as well.",
            f"Similarity with the reference cycle over the segments of axis {focus.axis}. "
            + "; ".join(words)
            + ".",
        )


def _panel(
    panel: Axes, inputs: ReportInputs, role: str, axis: int, reference: Columns
) -> tuple[int, int]:
    motions = inputs.roles[role].motions or {}
    rows = select(motions, motions["axis"] == axis) if n_rows(motions) else {}
    if not n_rows(rows) or "motion" not in rows:
        panel.text(0.5, 0.5, "no segments", ha="center", transform=panel.transAxes)
        return 0, 0
    sequence = time_order(rows, inputs.roles[role].run_rank())
    rows = {name: values[sequence] for name, values in rows.items()}
    unidentified = rows["motion"] < 0
    starts = (rows["motion"] == 0) & (rows["cycle"] >= 0)
    shown = min(unidentified.size, MAX_SEGMENTS)
    similarity = _similarity(rows, reference)[:shown]
    x = np.arange(shown)
    panel.plot(x, similarity, color=colour(role), linewidth=0.9)
    panel.plot(x, similarity, ".", color=colour(role), markersize=3)
    first = np.flatnonzero(starts[:shown])
    panel.plot(first, similarity[first], "o", color=colour(role), markersize=5.5)
    lost = np.flatnonzero(unidentified[:shown])
    low = float(np.nanmin(similarity)) if np.isfinite(similarity).any() else 0.0
    panel.plot(lost, np.full(lost.size, low), "x", color=colour("fault"), markersize=5)
    panel.set_xlim(-0.5, shown - 0.5)
    if shown < unidentified.size:
        panel.text(
            0.995,
            0.04,
            f"first {shown} of {unidentified.size} segments",
            ha="right",
            transform=panel.transAxes,
            color=colour("muted"),
        )
    return int(starts.sum()), int(unidentified.sum())


def _similarity(rows: Columns, reference: Columns) -> NDArray[np.float64]:
    """Similarity at each segment, of each run by itself; NaN where the cycle would not fit."""
    result = np.full(rows["run"].size, np.nan)
    wanted = reference["variance"].astype(np.float64)
    for run in dict.fromkeys(rows["run"]):
        own = np.flatnonzero(rows["run"] == run)
        found = sliding_similarity(wanted, rows["variance"][own].astype(np.float64))
        result[own[: found.size]] = found
    return result


def _threshold(inputs: ReportInputs) -> float:
    recorded = inputs.roles["baseline"].config.get("identify", {})
    return float(recorded.get("min_similarity", 0.9))
