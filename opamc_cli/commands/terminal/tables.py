"""Verdicts, features and loops as tables for the terminal."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from opamc_cli.commands.terminal.fitted import FittedTable
from opamc_cli.commands.terminal.streams import printable

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.padding import Padding
    from rich.text import Text

    from opamc_cli.stages.report.results.inputs import ReportInputs

ENOUGH_SESSIONS = 4
"""Of the baseline: with fewer, limits are so wide that the reasons of each joint say so."""

DIFFERS = 0.01
"""Corrected p-value up to which a healthy joint has changed, too little or no more than others."""

STYLES = {"healthy": "green", "changed": "yellow", "fault": "bold red", "unknown": "dim"}


def verdict_table(verdict: Mapping[str, Any]) -> "RenderableType":
    """Return a verdict for the terminal: one line if all is well, else a table and what to do.

    Parameters
    ----------
    verdict
        Content of verdict.json.
    """
    from rich.console import Group
    from rich.text import Text

    from opamc_cli.stages.report.wording import verdict as verdict_words
    from opamc_cli.stages.report.wording.numbers import number, p_value
    from opamc_cli.storage.schemas.channels import axes_phrase

    axes = list(verdict.get("axes", ()))
    unhealthy = doubtful(verdict)
    title = Text(verdict_words.headline(verdict), style=_style_of(verdict))
    if not unhealthy:
        known = [a for a in axes if isinstance(a.get("health_index"), int | float)]
        if known:
            top = max(known, key=lambda a: float(a["health_index"]))
            title.append(
                f" (largest health index {number(top['health_index'])}, axis {top['axis']})",
                style="dim",
            )
        return title
    table = FittedTable(
        ("axis", "state", "health index", "p", "corrected", "Δμ", "Δσ²", "KS"),
        right=(0, 2, 3, 4, 5, 6, 7),
        dropped=("Δσ²", "Δμ", "KS", "p", "health index"),
    )
    for entry in axes:
        features = entry.get("features") or {}
        state = str(entry.get("state"))
        table.add_row(
            str(entry.get("axis")),
            _state(state),
            number(entry.get("health_index")),
            p_value(entry.get("p_value")),
            p_value(entry.get("p_adjusted")),
            *(number(features.get(name)) for name in ("delta_mu", "delta_var", "ks")),
        )
    shared = verdict_words.shared_reasons(unhealthy)
    lines = [line for entry in unhealthy for line in _explanation(entry, set(shared))]
    for reason, numbers in shared.items():
        lines += [Text(f"{axes_phrase(numbers)}:", style="bold"), _indented(reason)]
    return Group(title, Text(), table, Text(), *lines)


def verdict_lines(verdict: Mapping[str, Any]) -> "list[Text]":
    """Return a verdict in few lines: for each joint that is not healthy what, how sure, what to do.

    Parameters
    ----------
    verdict
        Content of verdict.json.

    Returns
    -------
    list of Text
        One line if all is well, one more of few baseline sessions, and of each healthy joint that
        has changed; a faulty joint has five at most.
    """
    from rich.text import Text

    from opamc_cli.stages.report.wording import verdict as verdict_words
    from opamc_cli.stages.report.wording.numbers import number, p_phrase
    from opamc_cli.stages.verdict.wording.brief import foremost

    first = foremost(verdict.get("axes", ()))
    unhealthy = sorted(doubtful(verdict), key=lambda entry: entry is not first)
    if len(unhealthy) != 1 or not unhealthy[0].get("brief"):
        lines = [Text(verdict_words.headline(verdict), style=_style_of(verdict))]
    else:
        lines = []  # the one joint's own line says it
    healthy = len(verdict.get("axes", ())) - len(unhealthy)
    for entry in unhealthy:
        known = entry.get("brief")
        if not known:
            said = next(iter(entry.get("reasons", ())), verdict_words.advice(entry) or "not judged")
            lines.append(Text(printable(f"axis {entry.get('axis')}: {said}")))
            continue
        others = f"; {healthy} other axes healthy" if len(unhealthy) == 1 and healthy > 1 else ""
        ratio = (entry.get("distance") or {}).get("ratio")
        state = {"fault": "at fault"}.get(str(entry.get("state")), str(entry.get("state")))
        title = Text(f"Axis {entry.get('axis')} {state}", style=_style(str(entry.get("state"))))
        title.append(
            f": p {p_phrase(entry.get('p_adjusted'))}, {number(ratio)} times as "
            f"far from the baseline as a healthy session{others}",
            style="not bold",
        )
        lines.append(title)
        lines.append(Text(printable(f"  do first: {known['inspect']}")))
        lines += [Text(printable(f"  seen: {text}")) for text in known["evidence"]]
        lines.append(Text(printable(f"  against: {known['against']}")))
    for entry in verdict.get("axes", ()):
        p = entry.get("p_adjusted")
        known = isinstance(p, int | float) and entry not in unhealthy and entry.get("reasons")
        if known and p <= DIFFERS:
            text = printable(f"axis {entry.get('axis')}: {entry['reasons'][0]}")
            lines.append(Text(text, style="dim"))
    sessions = (verdict.get("baseline") or {}).get("sessions")
    if healthy and isinstance(sessions, int) and sessions < ENOUGH_SESSIONS:
        text = "1 baseline session says" if sessions == 1 else f"{sessions} baseline sessions say"
        text += " little of how much healthy ones vary, and damage may not show: record more, "
        lines.append(Text(f"{text}on other days", style="dim"))
    return lines


def feature_table(inputs: "ReportInputs") -> "RenderableType":
    """Return the features of every axis, for a folder without a verdict."""
    from opamc_cli.stages.report.focus import choose_focus, pooled_features
    from opamc_cli.stages.report.wording.numbers import number

    focus = choose_focus(inputs)
    table = FittedTable(
        ("axis", "order", "Δμ", "Δσ²", "KS"), right=(0, 1, 2, 3, 4), dropped=("Δσ²", "Δμ")
    )
    for axis in inputs.axes:
        features = pooled_features(inputs, axis, focus.order[axis]) or {}
        table.add_row(
            str(axis),
            str(focus.order[axis]),
            *(number(features.get(name)) for name in ("delta_mu", "delta_var", "ks")),
        )
    return table


def doubtful(verdict: Mapping[str, Any]) -> "list[Mapping[str, Any]]":
    """Return the axes that are not healthy for sure: those that are excused among them."""
    axes = verdict.get("axes", ())
    return [one for one in axes if one.get("state") != "healthy" or one.get("excused")]


def _explanation(entry: Mapping[str, Any], said_below: set[str]) -> "list[RenderableType]":
    from rich.text import Text

    from opamc_cli.stages.report.wording import verdict as verdict_words
    from opamc_cli.stages.report.wording.numbers import cause_phrase

    sentences = [str(r) for r in entry.get("reasons", ()) if str(r) not in said_below]
    cause = entry.get("cause")
    if cause and not any(str(cause.get("interpretation")) in said for said in sentences):
        sentences.append(f"cause: {cause_phrase(cause)}")
    advice = verdict_words.advice(entry)
    if advice:
        sentences.append(advice)
    if not sentences:
        return []
    heading = Text(f"axis {entry.get('axis')}:", style="bold")
    return [heading, *(_indented(sentence) for sentence in sentences)]


def _indented(text: str) -> "Padding":
    from rich.padding import Padding
    from rich.text import Text

    return Padding(Text(printable(text)), (0, 0, 0, 2), expand=False)


def _state(state: str) -> "Text":
    from rich.text import Text

    from opamc_cli.stages.report.figures.palette import state_sign

    return Text(f"{state_sign(state)} {printable(state)}", style=_style(state))


def _style_of(verdict: Mapping[str, Any]) -> str:
    """Return the style of the worst state."""
    from opamc_cli.stages.report.wording import verdict as verdict_words

    worst = next(iter(verdict_words.by_state(verdict)), "unknown")
    return _style("unknown" if worst == "healthy" and doubtful(verdict) else worst)


def _style(state: str) -> str:
    return STYLES.get(state, STYLES["unknown"])
