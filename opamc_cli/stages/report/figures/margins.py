"""Room for the texts beside a drawing's panels, reckoned from the texts alone.

matplotlib's constrained layout draws everything twice more to measure it: two thirds of the time of
a report's figures. What it measures is not what a browser draws either, which has the page's font.
"""

from collections.abc import Sequence

from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure as Canvas
from matplotlib.layout_engine import LayoutEngine

SIGN_EM, LINE_EM = 0.64, 1.3
"""Width of a digit and height of a line, in font sizes."""

EDGE_PT = 5.0
"""Between the outermost texts and the drawing's edge, and between panels."""

TICK_PT = 7.0
"""Length of a tick and the gap to its label."""

ROUNDS = 2
"""A panel's size tells how many ticks it has, and their labels tell its size."""


class TextMargins(LayoutEngine):
    """A layout engine for a grid of equal panels and a legend above them."""

    _adjust_compatible = False
    _colorbar_gridspec = False

    def execute(self, fig: Canvas) -> None:
        """Place the panels; matplotlib calls it as it begins to draw."""
        for _ in range(ROUNDS):
            _place(fig)


def _place(fig: Canvas) -> None:
    spans = {panel: spec for panel in fig.axes if (spec := panel.get_subplotspec()) is not None}
    if not spans:
        return
    width, height = (72.0 * inches for inches in fig.get_size_inches())
    grid = next(iter(spans.values())).get_gridspec()
    left, right = [0.0] * grid.ncols, [0.0] * grid.ncols
    top, bottom = [0.0] * grid.nrows, [0.0] * grid.nrows
    under = {panel: _tick_labels(panel.xaxis, "bottom") for panel in spans}
    for panel, spec in spans.items():
        if panel.get_visible() and panel.axison:
            _widen(left, spec.colspan.start, _beside(panel))
            _widen(right, spec.colspan.stop - 1, _after(under[panel]))
            _widen(top, spec.rowspan.start, _above(panel))
            _widen(bottom, spec.rowspan.stop - 1, _below(panel, under[panel]))
    legend = _lines(1) + EDGE_PT if fig.legends else 0.0
    wide = (width - 2 * EDGE_PT - sum(left) - sum(right)) / grid.ncols
    high = (height - 2 * EDGE_PT - legend - sum(top) - sum(bottom)) / grid.nrows
    for panel, spec in spans.items():
        columns, rows = spec.colspan, spec.rowspan
        x = [
            EDGE_PT + sum(left[: n + 1]) + sum(right[:n]) + (n + after) * wide
            for n, after in ((columns.start, 0), (columns.stop - 1, 1))
        ]
        y = [
            EDGE_PT + legend + sum(top[: n + 1]) + sum(bottom[:n]) + (n + after) * high
            for n, after in ((rows.start, 0), (rows.stop - 1, 1))
        ]
        tall = y[1] - y[0]
        panel.set_position((x[0] / width, 1 - y[1] / height, (x[1] - x[0]) / width, tall / height))
        panel.set_title(panel.get_title("left"), loc="left", y=1 + _lines(_factors(panel)) / tall)
        # else matplotlib measures every tick's label to find the place of the axis's name
        panel.xaxis.set_label_coords(0.5, -_ticks_below(under[panel]) / tall)
        panel.yaxis.set_label_coords(-_ticks_beside(panel) / (x[1] - x[0]), 0.5)


def _widen(margins: list[float], place: int, needed: float) -> None:
    margins[place] = max(margins[place], needed)


def _beside(panel: Axes) -> float:
    name = _lines(1) if panel.get_ylabel() else 0.0
    return EDGE_PT + name + _ticks_beside(panel)


def _ticks_beside(panel: Axes) -> float:
    labels = _tick_labels(panel.yaxis, "left")
    return TICK_PT + _width(labels) if labels else 0.0


def _after(labels: Sequence[str]) -> float:
    # half of the last tick's label reaches over the panel's end
    return EDGE_PT + 0.5 * _width(labels)


def _above(panel: Axes) -> float:
    return EDGE_PT + _lines(_factors(panel) + bool(panel.get_title("left")))


def _factors(panel: Axes) -> int:
    """Return 1 if a common factor of the tick labels stands above the panel."""
    return int(bool(panel.yaxis.get_major_formatter().get_offset()))


def _below(panel: Axes, labels: Sequence[str]) -> float:
    name = bool(panel.get_xlabel())
    return EDGE_PT + _lines(name) + _ticks_below(labels)


def _ticks_below(labels: Sequence[str]) -> float:
    return _lines(1) + TICK_PT if labels else 0.0


def _tick_labels(axis: Axis, side: str) -> Sequence[str]:
    """Return the labels of an axis's ticks; none where a neighbour's stand for them."""
    if not axis.get_tick_params()[f"label{side}"]:
        return ()
    return axis.get_major_formatter().format_ticks(list(axis.get_majorticklocs()))


def _width(labels: Sequence[str]) -> float:
    return SIGN_EM * float(rcParams["font.size"]) * max(map(len, labels), default=0)


def _lines(n: int) -> float:
    return LINE_EM * float(rcParams["font.size"]) * n
