"""The report: figures and tables put on one page that needs nothing else."""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from opamc_cli.stages.report import wording
from opamc_cli.stages.report.figure import Figure
from opamc_cli.stages.report.figures import (
    envelopes,
    feature_space,
    jsd_histogram,
    jsd_scatter,
    latent_axis,
    motion_signal,
    order_spectrum,
    ordinal_distribution,
    residual,
    similarity,
)
from opamc_cli.stages.report.focus import Focus, by_severity, choose_focus, pooled_features
from opamc_cli.stages.report.inputs import (
    ROLES,
    NothingToDrawError,
    ReportInputs,
    read_inputs,
)
from opamc_cli.stages.report.onset import Onset, find_onset
from opamc_cli.stages.report.palette import custom_properties, state_role, state_sign
from opamc_cli.storage.atomic import write_text
from opamc_cli.storage.tables import library_versions

FILE_NAME = "report.html"

EVIDENCE = (
    ("divergence of every segment", jsd_scatter.figure),
    ("distribution of the divergences", jsd_histogram.figure),
    ("ordinal patterns", ordinal_distribution.figure),
    ("envelope", envelopes.figure),
    ("feature space", feature_space.figure),
    ("latent axis", latent_axis.figure),
    ("motion signal", motion_signal.figure),
    ("identification", similarity.figure),
)
"""The thesis's figures: first what the verdict rests on, then how the segments were found."""

LOOP_TABLES = ("residuals.parquet", "order_spectrum.parquet")
LOOP = (("residual", residual.figure), ("order spectrum", order_spectrum.figure))


@dataclass(frozen=True)
class Section:
    """Figures under one heading, and one line for each that could not be drawn."""

    figures: tuple[Figure, ...]
    omitted: tuple[str, ...]


@dataclass(frozen=True)
class ReportOutcome:
    """What `run` did.

    Attributes
    ----------
    path
        The page that was written.
    inputs
        What it was made from.
    omitted
        One line for each part that could not be drawn.
    """

    path: Path
    inputs: ReportInputs
    omitted: tuple[str, ...]


def run(
    out: Path,
    *,
    title: str = "Joint health",
    baseline: Sequence[Path] = (),
    target: Sequence[Path] = (),
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

    Raises
    ------
    InputError
        If scores or features are missing, or any file is damaged.
    """
    inputs = read_inputs(out, {"baseline": baseline, "target": target})
    page, omitted = render(inputs, title)
    path = out / FILE_NAME
    write_text(path, page)
    return ReportOutcome(path, inputs, omitted)


def render(inputs: ReportInputs, title: str) -> tuple[str, tuple[str, ...]]:
    """Return the page, and one line for each part that could not be drawn."""
    if inputs.axes:
        focus = choose_focus(inputs)
        evidence = _draw(EVIDENCE, lambda draw: draw(inputs, focus))
        views = {axis: _axis_view(inputs, axis, focus) for axis in by_severity(inputs)}
    else:
        evidence, views = Section((), ()), {}
    loops = [_loop_view(inputs, entry) for entry in (inputs.loop or {}).get("axes", ())]
    notes = _notes(inputs)
    omitted = [
        *notes,
        *evidence.omitted,
        *(line for loop in loops for line in loop["section"].omitted),
    ]
    template = _environment().get_template("report.html.j2")
    page = template.render(
        title=title,
        styles=custom_properties() + "\n" + _resource("report.css"),
        headline=_headline(inputs),
        rows=[views[axis] for axis in sorted(views)],
        attention=[v for axis, v in views.items() if inputs.state(axis) not in (None, "healthy")],
        compared=_compared(inputs) if views else [],
        evidence=evidence,
        loops=loops,
        notes=notes,
        provenance=_provenance(inputs),
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


def _draw(
    parts: Sequence[tuple[str, Callable[..., Figure]]],
    call: Callable[[Callable[..., Figure]], Figure],
) -> Section:
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


def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_resource),
        autoescape=True,  # whatever the template is called: names of runs are not ours
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": wording.number,
        "p_value": wording.p_value,
        "p_phrase": wording.p_phrase,
        "moment": wording.moment,
    }
    environment.globals |= {"sign": state_sign, "role": state_role}
    return environment


def _resource(name: str) -> str:
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")


def _headline(inputs: ReportInputs) -> str:
    if inputs.verdict is not None:
        return wording.headline(inputs.verdict)
    if inputs.loop is not None:
        return wording.loop_headline(inputs.loop)
    return "No verdict yet"


def _axis_view(inputs: ReportInputs, axis: int, focus: Focus) -> dict[str, Any]:
    entry = inputs.axis_verdict(axis) or {}
    features = dict(pooled_features(inputs, axis, focus.order[axis]) or {})
    features.update({k: v for k, v in (entry.get("features") or {}).items() if v is not None})
    onset = find_onset(inputs, axis, focus.order[axis])
    return {
        "axis": axis,
        "state": entry.get("state", "not judged"),
        "health_index": entry.get("health_index"),
        "p_value": entry.get("p_value"),
        "p_adjusted": entry.get("p_adjusted"),
        "features": features,
        "cause": wording.cause_phrase(entry.get("cause")),
        "effect": wording.effect_phrase(entry["cause"]) if entry.get("cause") else "–",
        "reasons": [str(reason) for reason in entry.get("reasons", ())],
        "advice": wording.advice(entry),
        "since": _since(onset),
        "onset": onset,
        "motions": entry.get("motions", ()),
        "order": focus.order[axis],
        "worst_motion": focus.motion[axis],
    }


def _since(onset: Onset) -> str:
    if onset.first_run is None:
        return "No target segment lies above the baseline's highest of its motion."
    where = f"run {onset.first_run}"
    if onset.first_started_at:
        where += f" (begun {wording.moment(onset.first_started_at)})"
    if onset.first_cycle is not None and onset.first_cycle >= 0:
        where += f", cycle {onset.first_cycle}"
    return (
        f"{onset.n_above} of {onset.n_target} target segments lie above the baseline's highest "
        f"of their motion, the first in {where}."
    )


def _compared(inputs: ReportInputs) -> list[dict[str, Any]]:
    """Return what was compared with what, one row for each role."""
    rows = []
    for role in ROLES:
        mine = inputs.scores["role"] == role
        runs = dict.fromkeys(str(run) for run in inputs.scores["run"][mine])
        sources = [s for s in inputs.roles[role].sources if s.name in runs]
        starts = sorted(s.info.started_at for s in sources if s.info.started_at)
        cycles = {
            (str(run), int(cycle))
            for run, cycle in zip(
                inputs.scores["run"][mine], inputs.scores["cycle"][mine], strict=True
            )
        }
        rows.append(
            {
                "role": role,
                "runs": list(runs),
                "cycles": len(cycles),
                "when": " to ".join(
                    dict.fromkeys(wording.moment(s) for s in (starts[0], starts[-1]))
                )
                if starts
                else None,
                "conditions": _conditions([s.info for s in sources]),
            }
        )
    return rows


def _conditions(infos: Sequence[Any]) -> str:
    parts = []
    for key, label in (
        ("robot", "robot {}"),
        ("program", "program {}"),
        ("speed_percent", "speed {}\u00a0%"),
        ("payload_kg", "payload {}\u00a0kg"),
        ("sampling_rate_hz", "{}\u00a0Hz"),
    ):
        values = sorted({getattr(i, key) for i in infos if getattr(i, key) is not None}, key=str)
        if values:
            shown = " / ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in values[:4])
            parts.append(label.format(shown))
    return ", ".join(parts)


def _loop_view(inputs: ReportInputs, entry: Mapping[str, Any]) -> dict[str, Any]:
    axis = int(entry["axis"])
    return {
        "axis": axis,
        "summary": wording.loop_phrase(entry.get("verdict")),
        "entry": entry,
        "steps": [
            {**step, "effect_text": wording.effect_phrase(step)} for step in entry.get("steps", ())
        ],
        "experiments": wording.experiments(entry),
        "rejected": [wording.set_aside(item) for item in entry.get("rejected", ())],
        "untestable": [wording.set_aside(item) for item in entry.get("untestable", ())],
        "remains": wording.remains(entry),
        "section": _draw(LOOP, lambda draw: draw(inputs, axis)),
    }


def _provenance(inputs: ReportInputs) -> dict[str, Any]:
    config: dict[str, Any] = {}
    for file in inputs.files:
        if file.record is not None and file.name in LOOP_TABLES:
            config["model"] = file.record.get("config")
        elif file.record is not None:
            config.update(file.record.get("config") or {})
    records = [file.record for file in inputs.files if file.record is not None]
    versions = next((r["versions"] for r in records if "versions" in r), library_versions())
    return {
        "config": json.dumps(config, indent=2, sort_keys=True),
        "config_hash": (inputs.verdict or {}).get("config_hash"),
        "versions": versions,
        "files": inputs.files,
        "runs": [(role, source) for role in ROLES for source in inputs.roles[role].sources],
        "base": _base(inputs, config),
    }


def _base(inputs: ReportInputs, config: Mapping[str, Any]) -> str:
    base = (inputs.verdict or {}).get("base", config.get("score", {}).get("base"))
    if "base" in inputs.scores:
        base = float(np.asarray(inputs.scores["base"])[0])
    return f"{base:g}" if isinstance(base, int | float) else "not recorded"
