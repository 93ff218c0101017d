"""The axes in the space of Δμ, Δσ² and KS (thesis Figures 4-9a and 5-13a)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from mpl_toolkits.mplot3d import proj3d  # registers the projection, too

from opamc_cli.stages.report.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.focus import Focus, pooled_features
from opamc_cli.stages.report.inputs import NothingToDrawError, ReportInputs
from opamc_cli.stages.report.palette import colour, state_role, state_sign
from opamc_cli.stages.report.wording import axes_phrase

MARKERS = {"healthy": "o", "changed": "^", "fault": "X", "insufficient-data": "s"}
NAMES = ("delta_mu", "delta_var", "ks")
LABEL_SIZE = 0.02
"""Points nearer than this in the projected view share one label."""

Point = tuple[float, float, float]


def figure(inputs: ReportInputs, focus: Focus) -> Figure:
    """Draw each axis as a point above its foot on the Δμ-Δσ² plane."""
    points: dict[int, Point] = {}
    for axis in inputs.axes:
        features = pooled_features(inputs, axis, focus.order[axis]) or {}
        if all(name in features for name in NAMES):
            points[axis] = (1e3 * features["delta_mu"], 1e4 * features["delta_var"], features["ks"])
    if not points:
        msg = "features.parquet has no axis with Δμ, Δσ² and KS over all motions"
        raise NothingToDrawError(msg)
    with style():
        drawing = canvas(4.4, 6.4)
        drawing.set_layout_engine("none")
        space: Any = drawing.add_axes((-0.04, 0.03, 1.0, 0.95), projection="3d")
        space.view_init(elev=18, azim=-58)
        for side in (space.xaxis, space.yaxis, space.zaxis):
            side.set_pane_color((0.0, 0.0, 0.0, 0.0))
            side.line.set_color(colour("grid"))
        shown: set[str] = set()
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
        space.set_zlim(0.0, 1.05)
        for axes, (x, y, z) in _labels(points, space.get_proj()):
            space.text(x, y, z + 0.05, axes_phrase(axes), ha="center", fontweight="bold")
        space.set_xlabel("Δμ of JSD (10⁻³)", labelpad=8)
        space.set_ylabel("Δσ² of JSD (10⁻⁴)", labelpad=10)
        space.set_zlabel("KS", labelpad=2)
        space.locator_params(axis="x", nbins=5)
        space.locator_params(axis="y", nbins=5)
        space.set_box_aspect((1.35, 1.0, 0.85), zoom=1.05)
        drawing.legend(loc="upper left", ncols=4)
        words = "; ".join(
            f"axis {axis}: {x:.3g}e-3, {y:.3g}e-4, {z:.2f}" for axis, (x, y, z) in points.items()
        )
        return finish(
            drawing,
            "feature-space",
            "Feature space",
            f"Each axis by the change of mean and variance of its divergences and by KS, over all "
            f"motions, order {_orders(focus, list(points))}. Dotted lines lead to the floor.",
            f"Three-dimensional scatter of Δμ, Δσ² and KS: {words}.",
        )


def _labels(points: Mapping[int, Point], projection: Any) -> list[tuple[list[int], Point]]:
    """Group points that the view lays upon each other under their topmost."""
    groups: list[tuple[list[int], Point, tuple[float, float]]] = []
    for axis, point in sorted(points.items(), key=lambda item: -item[1][2]):
        u, v, _ = proj3d.proj_transform(*point, projection)
        for axes, _, (u0, v0) in groups:
            if np.hypot(u - u0, v - v0) < LABEL_SIZE:
                axes.append(axis)
                break
        else:
            groups.append(([axis], point, (float(u), float(v))))
    return [(axes, point) for axes, point, _ in groups]


def _orders(focus: Focus, axes: list[int]) -> str:
    return ", ".join(str(n) for n in np.unique([focus.order[axis] for axis in axes]))
