"""Distribution of the divergences, axis by axis (thesis Figure 5-12)."""

import numpy as np

from opamc_cli.stages.report.figures.figure import (
    Figure,
    canvas,
    finish,
    grid_shape,
    hide_surplus,
    style,
)
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.focus import Focus, axis_scores, need_divergences, pooled_features
from opamc_cli.stages.report.results.inputs import ROLES, ReportInputs

MAX_BINS = 40


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw the histograms of baseline and target on common bins."""
    need_divergences(inputs)
    axes = inputs.axes
    rows, columns = grid_shape(len(axes))
    with style():
        drawing = canvas(0.5 + 1.6 * rows)
        panels = list(np.atleast_1d(drawing.subplots(rows, columns, squeeze=False)).flat)
        words = []
        for panel, axis in zip(panels, axes, strict=False):
            groups = {
                role: axis_scores(inputs, axis, focus.order[axis], role)["jsd"] for role in ROLES
            }
            edges = _edges(np.concatenate(list(groups.values())))
            for role, values in groups.items():
                if values.size:
                    counts, _ = np.histogram(values, edges)
                    share = counts / values.size
                    panel.stairs(share, edges, fill=True, color=colour(role), alpha=0.35)
                    panel.stairs(share, edges, color=colour(role), linewidth=1.2, label=role)
            features = pooled_features(inputs, axis, focus.order[axis]) or {}
            ks = features.get("ks")
            panel.set_title(f"Axis {axis}" + (f" · KS {ks:.2f}" if ks is not None else ""))
            words.append(f"Axis {axis}: KS {ks:.2f}." if ks is not None else f"Axis {axis}.")
            panel.set_xlabel("JSD")
            panel.set_xlim(left=0.0)
        for panel in panels[::columns]:
            panel.set_ylabel("share")
        hide_surplus(panels, len(axes))
        handles, labels = panels[0].get_legend_handles_labels()
        drawing.legend(handles, labels, loc="outside upper right", ncols=2)
        return finish(
            drawing,
            "jsd-histogram",
            "Distribution of the divergences",
            "The same values as shares of segments on common bins. KS is the largest distance "
            "between the two distribution functions: 0 the same, 1 no overlap.",
            "Histograms of Jensen-Shannon divergence, baseline and target, one panel for each "
            "axis. " + " ".join(words),
        )


def _edges(values: np.ndarray) -> np.ndarray:
    if not values.size:
        return np.linspace(0.0, 1.0, 11)
    low, high = float(values.min()), float(values.max())
    if high <= low:
        half = max(0.05 * abs(high), 1e-6)
        return np.linspace(low - half, high + half, 3)
    # Freedman and Diaconis (1981) on the pooled values, within sensible bounds
    spread = np.subtract(*np.percentile(values, [75, 25]))
    width = 2.0 * spread / np.cbrt(values.size)
    bins = int(np.clip((high - low) / width if width > 0 else 12, 12, MAX_BINS))
    return np.linspace(low, high, bins + 1)
