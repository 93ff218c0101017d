"""The axes on one line: the discriminant's, or the health index (thesis Figure 5-13b)."""

import math

from opamc_cli.stages.report.figures.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour, state_role, state_sign
from opamc_cli.stages.report.focus import LEAST_AXES, Focus, pooled_features
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw each axis on the discriminant, or on the health index if none was trained."""
    values = {}
    for axis in inputs.axes:
        features = pooled_features(inputs, axis, focus.order[axis]) or {}
        if "lda" in features:
            values[axis] = features["lda"]
    trained = bool(values)
    if not trained:
        for axis in inputs.axes:
            index = (inputs.axis_verdict(axis) or {}).get("health_index")
            if isinstance(index, int | float) and math.isfinite(index):
                values[axis] = float(index)
    if not values:
        msg = "neither a discriminant was applied nor does verdict.json hold a health index"
        raise NothingToDrawError(msg)
    if not trained and len(values) < LEAST_AXES:
        msg = "it compares joints, and this is one: the table has its health index"
        raise NothingToDrawError(msg)
    with style():
        drawing = canvas(0.95 + 0.27 * len(values), 6.4)
        line = drawing.add_subplot()
        if not trained:
            line.axvspan(-1.0, 1.0, color=colour("baseline"), alpha=0.15, linewidth=0)
        line.axvline(0.0, color=colour("muted"), linewidth=0.8)
        for place, (axis, value) in enumerate(values.items()):
            state = inputs.state(axis) or "not judged"
            mark = colour(state_role(state))
            line.plot([0.0, value], [place, place], color=mark, linewidth=1.6)
            line.plot([value], [place], "o", color=mark, markersize=7)
            line.annotate(
                f"{value:.2f} {state_sign(state)} {state}".replace("-", "−", 1),
                (max(value, 0.0), place),
                xytext=(8, 0),
                textcoords="offset points",
                va="center",
                fontsize=8.5,
            )
        line.set_yticks(range(len(values)), [f"axis {axis}" for axis in values])
        line.set_ylim(len(values) - 0.4, -0.6)
        line.margins(x=0.25)
        line.grid(visible=False, axis="y")
        unit = "within-class standard deviations" if trained else "the baseline's own spread"
        line.set_xlabel(f"{'discriminant' if trained else 'health index'} (unit: {unit})")
        words = "; ".join(f"axis {axis} {value:.2f}" for axis, value in values.items())
        if trained:
            return finish(
                drawing,
                "latent-axis",
                "Latent axis",
                "The three features projected onto the trained discriminant: 0 is the grand mean "
                "of the training rows, faults are positive.",
                f"Positions on the linear discriminant: {words}.",
            )
        return finish(
            drawing,
            "latent-axis",
            "Health index",
            "No labelled rows, hence no discriminant: distance from the baseline's mean in units "
            "of the baseline's own spread; the band is one unit to each side.",
            f"Health index of the axes: {words}.",
        )
