"""What each added effect explains: its partial residual over its own covariate, and its form."""

from collections.abc import Mapping
from typing import Any

from opamc_cli.stages.report.figures.figure import Figure, canvas, finish, style
from opamc_cli.stages.report.figures.palette import colour
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs

MOST = 6
"""Effects that are drawn, in the order in which they were added; a joint seldom lacks more."""
COLUMNS = 2


def figure(inputs: ReportInputs, axis: int) -> Figure:
    """Draw the partial residual of every effect that the loop added to one axis."""
    added = inputs.loop_axis(axis).get("steps", ())
    steps = [step for step in added if step.get("curve")]
    if not steps:
        nothing = f"the loop added nothing to axis {axis}"
        msg = f"loop.json holds no curve of axis {axis}" if added else nothing
        raise NothingToDrawError(msg)
    shown = steps[:MOST]
    rows = -(-len(shown) // COLUMNS)
    with style():
        drawing = canvas(2.1 * rows)
        panels = drawing.subplots(rows, min(COLUMNS, len(shown)), squeeze=False).flat
        for step, panel in zip(shown, panels, strict=False):  # which leaves the others
            curve = step["curve"]
            panel.plot(
                curve["x"],
                curve["residual_a"],
                linestyle="none",
                marker="o",
                markersize=3,
                color=colour("target"),
                label="partial residual",
            )
            panel.plot(
                curve["x"], curve["named_a"], color=colour("baseline"), linewidth=1.5, label="form"
            )
            panel.set_title(_title(step))
            panel.set_xlabel(f"{curve['covariate']} ({curve['unit']})")
            panel.set_ylabel(inputs.unit)
        for panel in list(panels):
            panel.set_visible(False)
        handles, labels = drawing.axes[0].get_legend_handles_labels()
        drawing.legend(handles, labels, loc="outside upper right", ncols=2)
        names = ", ".join(str(step["effect"]).replace("_", " ") for step in shown)
        more = f" {len(steps) - MOST} more are in loop.json." if len(steps) > MOST else ""
        return finish(
            drawing,
            f"partial-residuals-{axis}",
            f"What was added to axis {axis}",
            "What an effect and the final residual hold together (dots), averaged over the "
            "effect's own covariate, and what the effect holds (line). Friction is drawn as it "
            f"resists the motion. Where dots leave the line, the form is another one.{more}",
            f"Partial residuals of axis {axis} with the forms that were added: {names}.",
        )


def _title(step: Mapping[str, Any]) -> str:
    name = str(step["effect"]).removeprefix("unnamed_").replace("_", " ")
    order = step.get("parameters", {}).get("order")
    name = f"{name} {order:.4g}" if isinstance(order, int | float) else name
    if str(step["effect"]).startswith("unnamed_"):
        return f"{name}: no name"
    return f"{name}, approximately" if step.get("approximate") else name
