"""A figure as inline SVG: small, the same bytes every time, and in the colours of its page."""

import io
import re
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure as Canvas

from opamc_cli.stages.report.figures.margins import TextMargins
from opamc_cli.stages.report.figures.palette import PALETTE, colour

WIDTH_IN = 9.6
MAX_TRACE_POINTS = 1600
"""Points of one trace: two for each pixel of a column of 800."""

MAX_NAME = 36
"""Signs of a run's name in a figure."""

STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.titley": 1.0,  # else every text around the panel is measured to find the title's height
    "axes.labelsize": 9.0,
    "axes.labelcolor": colour("muted"),
    "axes.edgecolor": colour("grid"),
    "axes.titlecolor": colour("ink"),
    "axes.facecolor": "none",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": colour("grid"),
    "grid.linewidth": 0.5,
    "xtick.color": colour("grid"),
    "ytick.color": colour("grid"),
    "xtick.labelcolor": colour("muted"),
    "ytick.labelcolor": colour("muted"),
    "text.color": colour("ink"),
    "text.parse_math": False,  # a dollar in a run's name is a dollar
    "figure.facecolor": "none",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "lines.linewidth": 1.1,
    "path.simplify_threshold": 0.3,
}


@dataclass(frozen=True)
class Figure:
    """A finished figure."""

    name: str
    """Short name, the figure's id on the page."""
    title: str
    caption: str
    """With `title`: what is seen and how to read it."""
    alt: str
    """What it shows, for those who do not see it."""
    svg: str
    """Inline SVG element."""


def style() -> AbstractContextManager[None]:
    """Return the context in which every figure is drawn: our style upon matplotlib's defaults.

    A matplotlibrc of the user's does not change the report.
    """
    defaults = {k: v for k, v in mpl.rcParamsDefault.items() if not k.startswith("backend")}
    settings: Any = {**defaults, **STYLE}
    return mpl.rc_context(settings)


def canvas(height_in: float, width_in: float = WIDTH_IN) -> Canvas:
    """Return an empty drawing of the report's width; draw within `style`."""
    return Canvas(figsize=(width_in, height_in), layout=TextMargins())


def finish(drawing: Canvas, name: str, title: str, caption: str, alt: str) -> Figure:
    """Turn a drawing into a figure of the report."""
    return Figure(name, title, caption, alt, to_svg(drawing, name))


def to_svg(drawing: Canvas, name: str) -> str:
    """Return a drawing as an SVG element for the inside of a page.

    The page's custom properties take the place of colours, so that one drawing serves light,
    dark and paper. Ids are salted with `name`, coordinates rounded to 1/100 point, and what only
    a file of its own needs (prolog, name spaces, date) is left out.
    """
    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name}):
        # not `savefig`, which draws it once more beforehand
        untyped: Any = FigureCanvasSVG(drawing)
        untyped.print_svg(buffer, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"<style type=\"text/css\">.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r" xmlns(:xlink)?=\"[^\"]*\"", "", text).replace("xlink:href", "href")
    text = re.sub(r"<svg[^>]*?(viewBox=\"[^\"]*\")[^>]*>", r'<svg \1 aria-hidden="true">', text)
    text = re.sub(r"<g id=\"[a-zA-Z0-9_.]+\"", "<g", text)
    text = re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\d+\.\d\d)\d+", r"\1", tag[0]), text)
    text = re.sub(r" transform=\"rotate\(-?0 [^\"]*\)\"", "", text)
    text = text.replace("font-family: 'DejaVu Sans'; ", "")
    for role, (light, _) in PALETTE.items():
        text = text.replace(light, f"var(--{role})")
    return re.sub(r"\n\s*", "\n", text).strip()


def to_png(drawing: Canvas) -> bytes:
    """Return a drawing as PNG on the light page's ground, for places that take no SVG."""
    buffer = io.BytesIO()
    FigureCanvasAgg(drawing)
    drawing.savefig(
        buffer,
        format="png",
        dpi=120,
        facecolor=colour("paper"),
        metadata={"Software": None},
    )
    return buffer.getvalue()


def short(name: str) -> str:
    """Return the end of a long name, which is what tells runs of one folder apart."""
    return name if len(name) <= MAX_NAME else "…" + name[1 - MAX_NAME :]


def grid_shape(n_panels: int) -> tuple[int, int]:
    """Return rows and columns for a number of equal panels."""
    columns = min(3, max(n_panels, 1))
    return -(-max(n_panels, 1) // columns), columns


def hide_surplus(panels: list[Axes], used: int) -> None:
    """Blank the panels of a grid that hold nothing."""
    for panel in panels[used:]:
        panel.set_axis_off()
