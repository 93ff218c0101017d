"""Envelope of the same motion in baseline and target, aligned by lag (thesis Figure 4-2)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from opamc_cli.stages.recordings.envelope import read_envelope
from opamc_cli.stages.report.figures.figure import (
    MAX_TRACE_POINTS,
    Figure,
    canvas,
    finish,
    short,
    style,
)
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.focus import Focus, axis_scores
from opamc_cli.stages.report.results.columns import Columns, extremes, n_rows, select
from opamc_cli.stages.report.results.inputs import ROLES, NothingToDrawError, ReportInputs

CLOSE_UP_WINDOWS = 12
"""Ordinal windows that the close-up spans."""


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw the envelopes over the whole motion and close up."""
    axis = focus.axis
    motion, order = focus.motion[axis], focus.order[axis]
    traces = {role: _trace(inputs, role, axis, motion, order) for role in ROLES}
    tau = _delay(inputs, axis, motion, order)
    period_s = float(np.median(np.diff(traces["baseline"][0])))
    window_s = (order - 1) * tau * period_s
    with style():
        drawing = canvas(4.0)
        panels = drawing.subplots(2, 1)
        for role, (time, values, _) in traces.items():
            x, y = extremes(time, values, MAX_TRACE_POINTS)
            panels[0].plot(x, y, color=colour(role), linewidth=0.8, alpha=0.85)
        overlap = (
            max(trace[0][0] for trace in traces.values()),
            min(trace[0][-1] for trace in traces.values()),
        )
        start, stop = _close_up(traces, overlap, CLOSE_UP_WINDOWS * window_s)
        for role, (time, values, name) in traces.items():
            part = (time >= start) & (time <= stop)
            x, y = extremes(time[part], values[part], MAX_TRACE_POINTS)
            panels[1].plot(x, y, color=colour(role), linewidth=1.2, label=f"{role}: {name}")
        panels[0].axvspan(start, stop, color=colour("muted"), alpha=0.15, linewidth=0)
        panels[0].set_title(f"Axis {axis}, motion {motion}")
        panels[1].set_title("Close-up of the shaded part, where they differ most")
        _window_bar(panels[1], start, window_s)
        for panel in panels:
            panel.set_ylabel(f"envelope ({inputs.unit})")
            panel.margins(x=0.0)
        panels[1].set_xlabel("time from the start of the reference segment (s)")
        drawing.legend(loc="outside upper right", ncols=2)
        return finish(
            drawing,
            "envelopes",
            f"Envelope of axis {axis}, motion {motion}",
            "The current's envelope, proportional to torque: the reference segment of the "
            "baseline, and the target's segment of median divergence shifted by its lag. The bar "
            f"is one ordinal window: order\u00a0{order}, τ\u00a0=\u00a0{tau}\u00a0samples, "
            f"{1e3 * window_s:.1f}\u00a0ms.",
            f"Two overlaid traces of the current envelope of axis {axis}, motion {motion}, from "
            "baseline and target.",
        )


def _delay(inputs: ReportInputs, axis: int, motion: int, order: int) -> int:
    scores = inputs.scores
    same = (scores["axis"] == axis) & (scores["motion"] == motion) & (scores["order"] == order)
    return int(scores["tau"][same][0])


def _trace(
    inputs: ReportInputs, role: str, axis: int, motion: int, order: int
) -> tuple[NDArray[np.float64], NDArray[np.floating], str]:
    """Time from the reference's start, envelope, and where it is from."""
    tables = inputs.roles[role]
    motions = tables.motions
    if motions is None or "lag" not in motions:
        msg = f"{role}/motions.parquet is absent"
        raise NothingToDrawError(msg)
    rows = select(motions, (motions["axis"] == axis) & (motions["motion"] == motion))
    if not n_rows(rows):
        msg = f"{role} has no segment of motion {motion} on axis {axis}"
        raise NothingToDrawError(msg)
    if role == "baseline" and rows["reference"].any():
        row = int(np.flatnonzero(rows["reference"])[0])
    else:
        row = _median_row(rows, axis_scores(inputs, axis, order, role, motion))
    name = str(rows["run"][row])
    envelope = str(tables.config.get("patterns", {}).get("envelope", "auto"))
    start, stop, lag = (int(rows[key][row]) for key in ("start", "stop", "lag"))
    with tables.open_run(name) as run:
        values = read_envelope(run, axis, start, stop, envelope)  # type: ignore[arg-type]
        time = (np.arange(values.size) - lag) / run.sampling_rate_hz
    if values.size < 2:
        msg = f"the segment of motion {motion} on axis {axis} is empty"
        raise NothingToDrawError(msg)
    return time, values, f"{short(name)}, cycle {int(rows['cycle'][row])}"


def _median_row(rows: Columns, scores: dict[str, Any]) -> int:
    """Return the segment whose divergence is the median of its motion's."""
    sequence = np.argsort(scores["jsd"], kind="stable")
    if sequence.size:
        middle = sequence[sequence.size // 2]
        same = (rows["run"] == scores["run"][middle]) & (rows["cycle"] == scores["cycle"][middle])
        if same.any():
            return int(np.flatnonzero(same)[0])
    return 0


def _close_up(
    traces: Mapping[str, tuple[NDArray[np.float64], NDArray[np.floating], str]],
    overlap: tuple[float, float],
    length_s: float,
) -> tuple[float, float]:
    """Return the stretch of the overlap in which the two envelopes differ most."""
    first, last = overlap
    time, baseline, _ = traces["baseline"]
    inside = (time >= first) & (time <= last)
    if np.count_nonzero(inside) < 2 or length_s >= last - first:
        return first, last
    target = np.interp(time[inside], traces["target"][0], traces["target"][1])
    energy = np.concatenate(([0.0], np.cumsum(np.nan_to_num(target - baseline[inside]) ** 2)))
    size = max(1, round(length_s / float(time[1] - time[0])))
    best = int(np.argmax(energy[size:] - energy[:-size])) if energy.size > size else 0
    start = float(time[inside][best])
    return start, min(start + length_s, last)


def _window_bar(panel: Axes, start: float, window_s: float) -> None:
    low, high = panel.get_ylim()
    height = high + 0.10 * (high - low)
    panel.set_ylim(low, high + 0.22 * (high - low))
    left = start + 0.5 * window_s
    panel.plot([left, left + window_s], [height, height], color=colour("ink"), linewidth=3)
    panel.annotate(
        "one ordinal window",
        (left + window_s, height),
        xytext=(6, 0),
        textcoords="offset points",
        va="center",
        fontsize=8.5,
    )
