"""The axes by Δμ, Δσ² and KS (thesis Figures 4-9a and 5-13a), one panel for each.

The thesis draws one point for each axis in space; on paper its place is a guess, so the three
coordinates are shown beside each other.
"""

import numpy as np

from opamc_cli.stages.report.figures.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour, state_role, state_sign
from opamc_cli.stages.report.focus import LEAST_AXES, Focus, pooled_features
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs

MARKERS = {"healthy": "o", "changed": "^", "fault": "X", "insufficient-data": "s"}
PANELS = (
    ("delta_mu", 1e3, "Δμ of JSD (10⁻³)"),
    ("delta_var", 1e4, "Δσ² of JSD (10⁻⁴)"),
    ("ks", 1.0, "KS"),
)
ROW_IN = 0.26
"""Height of one axis's line."""


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw each axis as a point on a line of its own in each of three panels."""
    features = {
        axis: found
        for axis in inputs.axes
        if (found := pooled_features(inputs, axis, focus.order[axis]) or {})
        and all(name in found for name, _, _ in PANELS)
    }
    if not features:
        msg = "features.parquet has no axis with Δμ, Δσ² and KS over all motions"
        raise NothingToDrawError(msg)
    if len(features) < LEAST_AXES:
        msg = "it compares joints, and this is one: the table has its Δμ, Δσ² and KS"
        raise NothingToDrawError(msg)
    with style():
        drawing = canvas(1.0 + ROW_IN * len(features))
        panels = drawing.subplots(1, len(PANELS), sharey=True)
        shown: set[str] = set()
        for place, (axis, values) in enumerate(features.items()):
            state = inputs.state(axis) or "not judged"
            for panel, (name, factor, _) in zip(panels, PANELS, strict=True):
                panel.plot(
                    [factor * values[name]],
                    [place],
                    MARKERS.get(state, "o"),
                    color=colour(state_role(state)),
                    markersize=8,
                    clip_on=False,
                    label=None if state in shown else f"{state_sign(state)} {state}",
                )
                shown.add(state)
        for panel, (_, _, label) in zip(panels, PANELS, strict=True):
            panel.set_xlabel(label)
            panel.axvline(0.0, color=colour("muted"), linewidth=0.7)
            panel.set_ylim(len(features) - 0.5, -0.5)
        panels[2].set_xlim(-0.05, 1.05)
        panels[0].set_yticks(range(len(features)), [f"axis {axis}" for axis in features])
        drawing.legend(loc="outside upper right", ncols=4)
        orders = ", ".join(str(n) for n in np.unique([focus.order[axis] for axis in features]))
        words = "; ".join(
            f"axis {axis}: {1e3 * values['delta_mu']:.3g}e-3, {1e4 * values['delta_var']:.3g}e-4, "
            f"{values['ks']:.2f}"
            for axis, values in features.items()
        )
        return finish(
            drawing,
            "feature-space",
            "Features by axis",
            "Change of mean and variance of each axis's divergences, and the distance of their "
            f"two distributions, over all motions, order {orders}.",
            f"Three panels of points, Δμ, Δσ² and KS: {words}.",
        )
