"""The sweep's plot: divergence over the delay, as the thesis's Figures 5-4 to 5-6."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from opamc_cli.stages.report.figures.figure import canvas, style, to_png
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.storage.files.atomic import atomic_path

ROLES = ("baseline", "target")


def write_figure(table: pa.Table, path: Path) -> None:
    """Draw the divergences of a sweep table: a row for each axis, a column for each order.

    Every point is one segment, the line joins the means, and the dashed line stands at the
    delay of (4-2).
    """
    rows = {name: np.asarray(values) for name, values in table.to_pydict().items()}
    axes = sorted(set(rows["axis"].tolist()))
    orders = sorted(set(rows["order"].tolist()))
    jsd = rows["jsd"].astype(np.float64)
    with style():
        drawing = canvas(0.6 + 2.0 * len(axes), width_in=1.2 + 2.8 * len(orders))
        panels = drawing.subplots(len(axes), len(orders), sharex=True, sharey=True, squeeze=False)
        for i, axis in enumerate(axes):
            for j, order in enumerate(orders):
                panel = panels[i, j]
                here = (rows["axis"] == axis) & (rows["order"] == order)
                panel.set_title(f"axis {axis}, order {order}")
                for role in ROLES:
                    part = here & (rows["role"] == role) & np.isfinite(jsd)
                    tau, value = rows["tau"][part], jsd[part]
                    if not tau.size:
                        continue
                    panel.plot(tau, value, ".", color=colour(role), markersize=2.5, alpha=0.45)
                    at = np.unique(tau)
                    means = [value[tau == t].mean() for t in at]
                    panel.plot(at, means, color=colour(role), label=role)
                for tau_opt in np.unique(rows["tau_opt"][here]):
                    panel.axvline(tau_opt, color=colour("muted"), linewidth=0.8, linestyle="--")
        for panel in panels[-1]:
            panel.set_xlabel("time delay τ (samples)")
        for panel in panels[:, 0]:
            panel.set_ylabel("JSD")
        panels[0, 0].set_ylim(bottom=0.0)
        handles, labels = panels[0, 0].get_legend_handles_labels()
        drawing.legend(handles, labels, loc="outside upper right", ncols=2)
        image = to_png(drawing)
    with atomic_path(path) as temporary:
        temporary.write_bytes(image)
