"""The report: figures and tables put on one page that needs nothing else."""

import functools
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.report.figures.loading import undocumented
from opamc_cli.stages.report.figures.palette import custom_properties, state_role, state_sign
from opamc_cli.stages.report.focus import by_severity, choose_focus
from opamc_cli.stages.report.results.inputs import NothingToDrawError, ReportInputs, read_inputs
from opamc_cli.stages.report.results.provenance import provenance
from opamc_cli.stages.report.templates import environment
from opamc_cli.stages.report.views import axis_view, compared, heading, headline, loop_view
from opamc_cli.stages.report.wording.numbers import moment, number, p_phrase, p_value
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.schemas import files

if TYPE_CHECKING:
    import jinja2

    from opamc_cli.stages.report.figures.figure import Figure

Part = TypeVar("Part")


@dataclass(frozen=True)
class Section:
    """Figures under one heading, and one line for each that could not be drawn."""

    figures: "tuple[Figure, ...]"
    omitted: tuple[str, ...]


@dataclass(frozen=True)
class ReportOutcome:
    """What `run` did."""

    path: Path
    """The page that was written."""
    inputs: ReportInputs
    """What it was made from."""
    omitted: tuple[str, ...]
    """One line for each part that could not be drawn."""


def run(
    out: Path,
    *,
    title: str = "Joint health",
    baseline: Sequence[Path] = (),
    target: Sequence[Path] = (),
    figures_of_healthy: bool = True,
    kept: KeptResults | None = None,
) -> ReportOutcome:
    """Write report.html of an output folder.

    Parameters
    ----------
    out
        Folder with scores.parquet, features.parquet and whatever else the chain left.
    title
        Heading of the page.
    baseline, target
        Where the runs are now, if not where the tables remember them.
    figures_of_healthy
        Whether joints that are healthy have their part in the figures.
    kept
        Where drawings of the baseline alone may lie.

    Raises
    ------
    InputError
        If scores or features are missing, or any file is damaged.
    """
    inputs = read_inputs(out, {"baseline": _folders(baseline), "target": _folders(target)})
    inputs = replace(inputs, kept=kept)
    page, omitted = render(inputs, title, figures_of_healthy)
    path = out / files.REPORT
    write_text(path, page)
    return ReportOutcome(path, inputs, omitted)


def draw_baseline(out: Path, kept: KeptResults) -> None:
    """Keep what `run` draws of the baseline alone, of each joint in an output folder.

    Raises
    ------
    InputError
        As `run` does.
    """
    inputs = replace(read_inputs(out, {"baseline": [], "target": []}), kept=kept)
    with undocumented():
        from opamc_cli.stages.report.figures import motion_signal

    focus = choose_focus(inputs)
    every = [(str(axis), replace(focus, axis=axis)) for axis in inputs.axes]
    _draw(every, lambda of_axis: motion_signal.figure(inputs, of_axis))


def _folders(paths: Sequence[Path]) -> list[Path]:
    """Return where runs are to be looked for: a file stands for its folder."""
    return [path if path.is_dir() else path.parent for path in paths]


def render(
    inputs: ReportInputs, title: str, figures_of_healthy: bool = True
) -> tuple[str, tuple[str, ...]]:
    """Return the page, and one line for each part that could not be drawn."""
    if inputs.axes:
        focus = choose_focus(inputs)
        evidence = Section((), ("figures: not drawn of healthy joints",))
        drawn = inputs if figures_of_healthy else inputs.unhealthy()
        if drawn.axes:
            with undocumented():
                from opamc_cli.stages.report.figures.shown import EVIDENCE

            looked_at = choose_focus(drawn)  # the worst of all may be a healthy one
            evidence = _draw(EVIDENCE, lambda draw: draw(drawn, looked_at))
        views = {axis: axis_view(inputs, axis, focus) for axis in by_severity(inputs)}
    else:
        evidence, views = Section((), ()), {}
    loops = [_loop_part(inputs, entry) for entry in (inputs.loop or {}).get("axes", ())]
    notes = _notes(inputs)
    omitted = [
        *notes,
        *evidence.omitted,
        *(line for loop in loops for line in loop["section"].omitted),
    ]
    page = _template().render(
        title=title,
        styles=custom_properties() + "\n" + _resource("report.css"),
        headline=headline(inputs),
        heading=heading(inputs, title),
        known=[str(note) for note in (inputs.verdict or {}).get("notes", ())],
        rows=list(views.values()),
        attention=[v for axis, v in views.items() if inputs.state(axis) not in (None, "healthy")],
        compared=compared(inputs) if views else [],
        evidence=evidence,
        loops=loops,
        notes=notes,
        provenance=provenance(inputs),
    )
    return page, tuple(omitted)


def _notes(inputs: ReportInputs) -> list[str]:
    """Whole sections that the folder has nothing for."""
    notes = []
    if not inputs.axes:
        notes.append("diagnosis: scores.parquet is absent; `opamc diagnose` writes it")
    elif inputs.verdict is None:
        notes.append("verdict: verdict.json is absent; `opamc diagnose` writes it")
    if inputs.loop is None:
        notes.append("closed loop: loop.json is absent; `opamc model close` writes it")
    return notes


def _loop_part(inputs: ReportInputs, entry: Mapping[str, Any]) -> dict[str, Any]:
    with undocumented():
        from opamc_cli.stages.report.figures.shown import LOOP

    view = loop_view(entry)
    return {**view, "section": _draw(LOOP, lambda draw: draw(inputs, view["axis"]))}


def _draw(parts: "Sequence[tuple[str, Part]]", call: "Callable[[Part], Figure]") -> Section:
    figures, omitted = [], []
    with warnings.catch_warnings():
        # a sign that the font lacks is drawn by the browser, which has more fonts
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        for name, draw in parts:
            try:
                figures.append(call(draw))
            except NothingToDrawError as reason:
                omitted.append(f"{name}: {reason}")
    return Section(tuple(figures), tuple(omitted))


@functools.cache
def _template() -> "jinja2.Template":
    found = environment(_resource)
    found.filters |= {
        "number": number,
        "p_value": p_value,
        "p_phrase": p_phrase,
        "moment": moment,
    }
    found.globals |= {"sign": state_sign, "role": state_role}
    return found.get_template("report.html.j2")


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath("page", name).read_text(encoding="utf-8")
