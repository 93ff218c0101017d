"""The residual's spectrum over motor revolutions, before and after the loop."""

import math

import numpy as np

from opamc_cli.stages.report.figures.figure import MAX_TRACE_POINTS, Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.results.columns import extremes, select
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs

MAX_LABELS = 8


def figure(inputs: ReportInputs, axis: int) -> Figure:
    """Draw one axis's order spectrum, the orders that were added marked."""
    if inputs.spectrum is None:
        msg = "order_spectrum.parquet is absent"
        raise NothingToDrawError(msg)
    rows = select(inputs.spectrum, inputs.spectrum["axis"] == axis)
    if not rows["axis"].size:
        msg = f"order_spectrum.parquet has no row of axis {axis}: no motor angle, or too few turns"
        raise NothingToDrawError(msg)
    order = rows["order"].astype(np.float64)
    added = _added_orders(inputs, axis)
    with style():
        drawing = canvas(2.6)
        panel = drawing.add_subplot()
        for name, column, role, width in (
            ("before", "before_a", "target", 1.3),
            ("after", "after_a", "baseline", 1.0),
        ):
            x, y = extremes(order, rows[column].astype(np.float64), MAX_TRACE_POINTS)
            panel.plot(x, y, color=colour(role), linewidth=width, label=name)
        highest = float(np.nanmax(rows["before_a"]))
        for value in added[:MAX_LABELS]:
            nearest = int(np.argmin(np.abs(order - value)))
            top = float(np.nanmax(rows["before_a"][max(nearest - 1, 0) : nearest + 2]))
            panel.annotate(
                f"{value:g}",
                (value, top),
                xytext=(0, 4),
                textcoords="offset points",
                ha="center",
                fontweight="bold",
            )
        panel.set_xlabel("order (cycles per revolution)")
        panel.set_ylabel(f"amplitude ({inputs.unit})")
        panel.set_ylim(0.0, 1.15 * highest if highest > 0 else 1.0)
        panel.margins(x=0.01)
        panel.legend(loc="upper right", ncols=2)
        named = ", ".join(f"{value:g}" for value in added) or "none"
        return finish(
            drawing,
            f"order-spectrum-{axis}",
            f"Order spectrum of axis {axis}",
            f"Amplitude of the residual's share that repeats with the angle. Orders that the loop "
            f"added: {named}.",
            f"Order spectrum of axis {axis} before and after the loop; added orders: {named}.",
        )


def _added_orders(inputs: ReportInputs, axis: int) -> list[float]:
    found = []
    for step in inputs.loop_axis(axis).get("steps", ()):
        value = (step.get("parameters") or {}).get("order")
        if isinstance(value, int | float) and math.isfinite(value):
            found.append(float(value))
    return found
