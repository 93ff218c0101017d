"""What the page says of an axis, of the comparison and of a closed loop, ready for the template."""

from collections.abc import Mapping, Sequence
from typing import Any

from opamc_cli.stages.report.focus import Focus, pooled_features
from opamc_cli.stages.report.onset import Onset, find_onset
from opamc_cli.stages.report.results.inputs import ROLES, ReportInputs
from opamc_cli.stages.report.wording import loop as loop_words
from opamc_cli.stages.report.wording import verdict as verdict_words
from opamc_cli.stages.report.wording.numbers import cause_phrase, effect_phrase, moment
from opamc_cli.storage.runs.metadata import RunInfo

CONDITIONS = (
    ("robot", "robot {}"),
    ("program", "program {}"),
    ("speed_percent", "speed {}\u00a0%"),
    ("payload_kg", "payload {}\u00a0kg"),
    ("sampling_rate_hz", "{}\u00a0Hz"),
)
MAX_VALUES = 4
"""Of one condition that are listed when runs differ in it."""


def headline(inputs: ReportInputs) -> str:
    """Return what the page is about in one sentence."""
    if inputs.verdict is not None:
        return verdict_words.headline(inputs.verdict)
    if inputs.loop is not None:
        return loop_words.loop_headline(inputs.loop)
    return "No verdict yet"


def heading(inputs: ReportInputs, title: str) -> str:
    """Return what stands above the headline: title, robot and the target's days."""
    verdict = inputs.verdict or {}
    robots = {s.info.robot for role in ROLES for s in inputs.roles[role].sources if s.info.robot}
    robot = verdict.get("robot") or (robots.pop() if len(robots) == 1 else None)
    days = verdict_words.day_span(verdict.get("target") or {})
    return " · ".join(part for part in (title, robot, days) if part)


def axis_view(inputs: ReportInputs, axis: int, focus: Focus) -> dict[str, Any]:
    """Return what the page says of one axis."""
    entry = inputs.axis_verdict(axis) or {}
    features = dict(pooled_features(inputs, axis, focus.order[axis]) or {})
    features.update({k: v for k, v in (entry.get("features") or {}).items() if v is not None})
    elsewhere = verdict_words.said_elsewhere(entry)
    brief = entry.get("brief") or {}
    reasons = [str(reason) for reason in entry.get("reasons", ())]
    shown = [reason for reason in reasons if reason not in elsewhere]
    return {
        "axis": axis,
        "inspect": verdict_words.inspection(entry),
        "likely": verdict_words.likely_cause(entry),
        "chance": verdict_words.chance_phrase(entry, len((inputs.verdict or {}).get("axes", ()))),
        "distance": verdict_words.distance_phrase(entry),
        "why": list(brief.get("evidence") or shown),
        "against": brief.get("against"),
        "more": [*(shown if brief else ()), *(entry.get("cause") or {}).get("why", ())],
        # what conditions as unusual may hide is not seen to be healthy
        "state": "not told" if entry.get("excused") else entry.get("state", "not judged"),
        "health_index": entry.get("health_index"),
        "p_value": entry.get("p_value"),
        "p_adjusted": entry.get("p_adjusted"),
        "features": features,
        "cause": cause_phrase(entry.get("cause")),
        "effect": effect_phrase(entry["cause"]).replace("_", " ") if entry.get("cause") else "–",
        "reasons": reasons,
        "advice": verdict_words.advice(entry),
        "since": _since(find_onset(inputs, axis, focus.order[axis])),
    }


def compared(inputs: ReportInputs) -> list[dict[str, Any]]:
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
        moments = [moment(starts[0]), moment(starts[-1])] if starts else []
        rows.append(
            {
                "role": role,
                "runs": list(runs),
                "cycles": len(cycles),
                "when": " to ".join(dict.fromkeys(moments)),
                "conditions": _conditions([s.info for s in sources]),
            }
        )
    return rows


def loop_view(entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the page says of a closed loop.

    Parameters
    ----------
    entry
        One object of loop.json's `axes`.
    """
    return {
        "axis": int(entry["axis"]),
        "unit": entry.get("unit", "A"),
        "summary": loop_words.loop_phrase(entry),
        "declared": ", ".join(map(str, entry.get("declared", ()))),
        "sealed": ", ".join(map(str, entry.get("sealed", ()))),
        "before": entry.get("before") or {},
        "after": entry.get("after") or {},
        "orders": entry.get("orders"),
        "remains": loop_words.remains(entry),
        "steps": [{**step, "effect_text": effect_phrase(step)} for step in entry.get("steps", ())],
        "columns": f"{loop_words.STEP_COLUMNS.capitalize()}.",
        "experiments": loop_words.experiments(entry),
        "rejected": [loop_words.set_aside(item) for item in entry.get("rejected", ())],
        "untestable": [loop_words.set_aside(item) for item in entry.get("untestable", ())],
        "notes": [str(note) for note in entry.get("notes", ())],
    }


def _since(onset: Onset) -> str:
    if onset.first_run is None:
        return (
            "Not known: by its patterns no target segment lies above the baseline's highest of its "
            "motion; what else has changed tells no segment."
        )
    where = f"run {onset.first_run}"
    if onset.first_started_at:
        where += f" (begun {moment(onset.first_started_at)})"
    if onset.first_cycle is not None and onset.first_cycle >= 0:
        where += f", cycle {onset.first_cycle}"
    return (
        f"{onset.n_above} of {onset.n_target} target segments lie above the baseline's highest "
        f"of their motion, the first in {where}."
    )


def _conditions(infos: Sequence[RunInfo]) -> str:
    parts = []
    for key, label in CONDITIONS:
        values = sorted({getattr(i, key) for i in infos if getattr(i, key) is not None}, key=str)
        shown = [f"{v:g}" if isinstance(v, float) else str(v) for v in values[:MAX_VALUES]]
        if shown:
            parts.append(label.format(" / ".join(shown)))
    return ", ".join(parts)
