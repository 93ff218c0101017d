"""Divergence of every segment in time order, axis by axis (thesis Figure 5-11)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from opamc_cli.stages.report.figures.figure import (
    Figure,
    canvas,
    finish,
    grid_shape,
    hide_surplus,
    style,
)
from opamc_cli.stages.report.figures.palette import colour, state_sign
from opamc_cli.stages.report.focus import Focus, axis_scores, need_divergences
from opamc_cli.stages.report.results.columns import extremes
from opamc_cli.stages.report.results.inputs import ROLES, ReportInputs, time_order

MAX_POINTS = 400
"""Of one role in one panel; more would only hide each other."""

MARKERS = {"baseline": "o", "target": "^"}


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw the divergences of all axes."""
    need_divergences(inputs)
    with style():
        drawing, thinned = _draw(inputs, focus)
        caption = (
            "One point is one segment, runs in time order: baseline against the pool without its "
            "own cycle, then target against the whole baseline pool. The dotted line is the "
            "highest of the baseline."
        )
        if thinned:
            caption += " Where there are many, the lowest and highest of each stretch are drawn."
        return finish(
            drawing,
            "jsd-scatter",
            "Divergence of every segment",
            caption,
            "Scatter plots of Jensen-Shannon divergence, one panel for each axis. "
            + " ".join(_in_words(inputs, axis, focus.order[axis]) for axis in inputs.axes),
        )


def _draw(inputs: ReportInputs, focus: Focus) -> tuple[Canvas, bool]:
    """Return the drawing, to be finished within `style`, and whether points were left out."""
    axes = inputs.axes
    rows, columns = grid_shape(len(axes))
    drawing = canvas(0.5 + 1.75 * rows)
    panels = list(drawing.subplots(rows, columns, sharey=True, squeeze=False).flat)
    thinned = [
        _panel(panel, inputs, axis, focus.order[axis])
        for panel, axis in zip(panels, axes, strict=False)
    ]
    for panel in panels[::columns]:
        panel.set_ylabel("JSD")
    panels[0].set_ylim(bottom=0.0)
    hide_surplus(panels, len(axes))
    handles, labels = panels[0].get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside upper right", ncols=3)
    return drawing, any(thinned)


def _panel(panel: Axes, inputs: ReportInputs, axis: int, order: int) -> bool:
    start = 0
    thinned = False
    for role in ROLES:
        rows = axis_scores(inputs, axis, order, role)
        jsd = rows["jsd"][time_order(rows, inputs.roles[role].run_rank())]
        x, y = extremes(start + np.arange(jsd.size, dtype=np.float64), jsd, MAX_POINTS)
        thinned |= x.size < jsd.size
        panel.plot(
            x,
            y,
            MARKERS[role],
            color=colour(role),
            markersize=4.2 if y.size < 100 else 2.6,
            markeredgewidth=0.0,
            alpha=0.85,
            label=role,
            clip_on=False,
        )
        if role == "baseline" and jsd.size:
            panel.axhline(jsd.max(), color=colour("baseline"), linewidth=0.9, linestyle=":")
        start += jsd.size
    state = inputs.state(axis)
    panel.set_title(f"Axis {axis}" + (f" · {state_sign(state)} {state}" if state else ""))
    panel.set_xlabel("segment")
    panel.set_xlim(-0.5, max(start, 1) - 0.5)
    return thinned


def _in_words(inputs: ReportInputs, axis: int, order: int) -> str:
    means = []
    for role in ROLES:
        jsd = axis_scores(inputs, axis, order, role)["jsd"]
        means.append(f"{role} {jsd.mean():.3g}" if jsd.size else f"{role} none")
    return f"Axis {axis}: mean {', '.join(means)}."
