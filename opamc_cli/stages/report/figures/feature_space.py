"""The axes in the space of Δμ, Δσ² and KS (thesis Figures 4-9a and 5-13a)."""

import mpl_toolkits.mplot3d  # noqa: F401 - registers the projection
import numpy as np

from opamc_cli.stages.report.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.focus import Focus, pooled_features
from opamc_cli.stages.report.inputs import NothingToDrawError, ReportInputs
from opamc_cli.stages.report.palette import colour, state_role, state_sign

MARKERS = {"healthy": "o", "changed": "^", "fault": "X", "insufficient-data": "s"}
NAMES = ("delta_mu", "delta_var", "ks")


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw each axis as a point above its foot on the Δμ-Δσ² plane."""
    points = {}
    for axis in inputs.axes:
        features = pooled_features(inputs, axis, focus.order[axis]) or {}
        if all(name in features for name in NAMES):
            points[axis] = tuple(features[name] for name in NAMES)
    if not points:
        msg = "features.parquet has no axis with Δμ, Δσ² and KS over all motions"
        raise NothingToDrawError(msg)
    with style():
        drawing = canvas(4.3, 6.4)
        space = drawing.add_subplot(projection="3d")
        space.view_init(elev=18, azim=-58)
        for side in (space.xaxis, space.yaxis, space.zaxis):
            side.set_pane_color((0.0, 0.0, 0.0, 0.0))
            side.line.set_color(colour("grid"))
        shown = set()
        for axis, (x, y, z) in points.items():
            state = inputs.state(axis) or "not judged"
            mark = colour(state_role(state))
            space.plot([x, x], [y, y], [0.0, z], color=mark, linewidth=0.9, linestyle=":")
            space.plot(
                [x],
                [y],
                [z],
                MARKERS.get(state, "o"),
                color=mark,
                markersize=8,
                label=None if state in shown else f"{state_sign(state)} {state}",
            )
            shown.add(state)
            space.text(x, y, z + 0.05, f" {axis}", color=colour("ink"), fontweight="bold")
        space.set_zlim(0.0, 1.05)
        space.set_xlabel("Δμ of JSD")
        space.set_ylabel("Δσ² of JSD", labelpad=8)
        space.set_zlabel("KS")
        for axis_name in ("x", "y"):
            space.ticklabel_format(axis=axis_name, style="sci", scilimits=(-2, 2))
            space.locator_params(axis=axis_name, nbins=5)
        space.set_box_aspect(None, zoom=0.88)
        drawing.legend(loc="outside upper right", ncols=4)
        words = "; ".join(
            f"axis {axis}: {x:.3g}, {y:.3g}, {z:.2f}" for axis, (x, y, z) in points.items()
        )
        return finish(
            drawing,
            "feature-space",
            "Feature space",
            f"Each axis by the change of mean and variance of its divergences and by KS, over all "
            f"motions, order {_orders(focus, list(points))}. The number is the axis; dotted "
            "lines lead to the floor.",
            f"Three-dimensional scatter of Δμ, Δσ² and KS: {words}.",
        )


def _orders(focus: Focus, axes: list[int]) -> str:
    return ", ".join(str(n) for n in np.unique([focus.order[axis] for axis in axes]))
