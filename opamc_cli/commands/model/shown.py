"""What `opamc model` and `opamc report` say of a joint's model on a terminal."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from opamc_cli.commands.terminal.tables import printable

if TYPE_CHECKING:
    from rich.console import RenderableType

MOST_REJECTED = 3


def parameters(values: Mapping[str, float]) -> str:
    """Return parameters with four digits."""
    return ", ".join(f"{name} {value:.4g}" for name, value in values.items())


def fields_table(title: str, *headings: str) -> Any:
    """Return an empty table."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, box=SIMPLE_HEAD, title_justify="left", title_style="bold")
    for heading in headings:
        table.add_column(heading)
    return table


def headline(result: Mapping[str, Any]) -> str:
    """Say in words what the declared model of an axis lacks.

    Parameters
    ----------
    result
        One object of loop.json's `axes`.
    """
    return printable(_headline(result))


def _headline(result: Mapping[str, Any]) -> str:
    before, after = result["before"]["rmse_a"], result["after"]["rmse_a"]
    unit = result.get("unit", "A")
    named = [step for step in result["steps"] if not step["effect"].startswith("unnamed")]
    words = []
    for step in named:
        name = step["effect"] + (", approximately" if step.get("approximate") else "")
        meaning = step["interpretation"].split(":")[0].split(" (")[0]
        words.append(f"{meaning} ({name})")
    error = f"error {before:.4g} → {after:.4g} {unit}"
    reached = "how much can be explained is not known"
    if result["explained_share"] is not None and result.get("ceiling", {}).get("share") != 0:
        reached = f"{result['explained_share']:.0%} of what can be explained"
    if named:
        listed = "; ".join(words)
        return f"Axis {result['axis']} lacks {listed}: {error}, {reached}"
    if result["verdict"] == "nothing-missing":
        error = f"error {before:.4g} {unit}"
        return f"Axis {result['axis']} lacks nothing that the data can show: {error}"
    curves = [step["interpretation"].split(";")[0] for step in result["steps"]]
    what = "; ".join(curves) or f"something in the {result.get('domain')} domain"
    return f"Axis {result['axis']} lacks {what}, which no effect of the library describes: {error}"


def loop_tables(result: Mapping[str, Any]) -> Sequence["RenderableType"]:
    """Return all that a closed loop found on an axis, one object of loop.json's `axes`."""
    before, after, ceiling = result["before"], result["after"], result["ceiling"]
    unit = result["unit"]
    shown: list[RenderableType] = [
        headline(result),
        f"{result['verdict']}; on sealed data r2 {before['r2']:.4f} → {after['r2']:.4f}; ceiling "
        f"{ceiling['share']:.0%} ± {ceiling['standard_error']:.0%} of the mean square, floor "
        f"{result['floor_a']:.4g} {unit}",
    ]
    if result["steps"]:
        errors = (f"{unit} before", f"{unit} after")
        table = fields_table("Steps", "effect", "parameters", "gain", "form", *errors)
        for step in result["steps"]:
            ties = f" (or {', '.join(step['ties'])})" if step["ties"] else ""
            table.add_row(
                step["effect"] + ties,
                parameters(step["parameters"]),
                f"{step['gain']:.1%}",
                f"{step['fit_of_name']:.0%}" if step["fit_of_name"] else "–",
                f"{step['rmse_before_a']:.4g}",
                f"{step['rmse_after_a']:.4g}",
            )
        shown.append(table)
    shown += [f"{step['effect']}: {step['interpretation']}" for step in result["steps"]]
    shown += [
        f"to tell {step['effect']} from {', '.join(step['ties'])}: {step['separating_experiment']}"
        for step in result["steps"]
        if step["separating_experiment"]
    ]
    if result["domain"]:
        shown.append(f"what remains is structured in the {result['domain']} domain")
    shown += [
        f"rejected {entry['effect']}: {entry['why']}"
        for entry in result["rejected"][:MOST_REJECTED]
    ]
    return [*shown, *untestable(result), f"sealed: {', '.join(result['sealed'])}"]


def untestable(result: Mapping[str, Any]) -> list["RenderableType"]:
    """Return what the recordings cannot show, a line each."""
    return [f"untestable {entry['effect']}: {entry['why']}" for entry in result["untestable"]]
