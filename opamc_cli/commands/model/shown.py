"""What `opamc model` and `opamc report` say of a joint's model on a terminal."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from opamc_cli.commands.terminal.streams import printable

if TYPE_CHECKING:
    from rich.console import RenderableType

MOST_REJECTED = 3
CORNERS = 1.25
"""Times the error that is told, from which on the one sample by sample stands beside it, as
in 24 of 258 closings of three strangers' joints and a third of short measured ones."""
MOST_MEANINGS = 3
"""Effects that the first line explains; the table below it has them all."""


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
    # a file that another version wrote may lack fields
    axis, unit, steps = result["axis"], result.get("unit", "A"), result.get("steps", ())
    before, after = (
        f"{value:.4g}" if (value := result.get(side, {}).get("rmse_a")) is not None else "?"
        for side in ("before", "after")
    )
    words, axes = {}, _axes_beside(steps)
    for step in steps:
        effect, meaning = step.get("effect", "unnamed"), step.get("interpretation", "")
        if effect.startswith("unnamed"):
            continue
        name = effect + (", approximately" if step.get("approximate") else "")
        what = meaning.split(":")[0].split(" (")[0]
        if effect == "coupling" and len(axes) > 1:
            what = f"torque from the motion of axes {', '.join(axes[:-1])} and {axes[-1]}"
        words[f"{what} ({name})"] = effect
    explained = [*words][:MOST_MEANINGS]
    if more := [*words.values()][MOST_MEANINGS:]:
        explained.append(f"{len(more)} more ({', '.join(dict.fromkeys(more))})")
    from opamc_cli.stages.report.wording import loop as loop_words

    logged = _as_logged(result)
    error = f"error {before} → {after} {unit}{logged}"
    fails = "".join(f"; {why}" for why in loop_words.unreliable(result))
    functions = loop_words.without_name(steps)
    share = result.get("explained_share")
    reached = "how much can be explained is not known"
    if share is not None and loop_words.ceiling_known(result):
        reached = f"{share:.0%} of what can be explained{' has a name' if functions else ''}"
    elif result.get("verdict") == "closed":
        reached = "what is left is noise"
    if words:
        beside = f" and, without a name, {functions}" if functions else ""
        # of what fails where it was not fitted, the share that it explains says nothing
        reached = "" if result.get("fails") else f", {reached}"
        return f"Axis {axis} lacks {'; '.join(explained)}{beside}: {error}{reached}{fails}"
    if result.get("verdict") == "nothing-missing":
        noise, left = result.get("noise_a"), loop_words.beyond_noise(result)
        of_it = "" if noise is None else f", of which {noise:.2g} {unit} is noise between samples"
        if noise is not None and noise > result.get("before", {}).get("rmse_a", noise):
            # Beside corners the error is a smoothed one, and the noise of samples is no part of it.
            of_it = f"; noise between samples {noise:.2g} {unit}"
        if left is None:
            lacks = "nothing for certain" if result.get("unconfirmed") else "nothing worth naming"
            said = f"Axis {axis} lacks {lacks}: error {before} {unit}{logged}{of_it}"
            return f"{said}{fails}"
        check = ""
        if loop_words.beyond_noise(result, loop_words.FAR_ABOVE_NOISE) is not None:
            check = "; check how its motion was logged, units and gear ratio, or record more motion"
        return (
            f"Axis {axis}: nothing of the library explains the {left:.2g} {unit} that are left "
            f"beyond noise: error {before} {unit}{logged}{of_it}; the rest is slower noise, or "
            f"something that no effect describes{check}{fails}"
        )
    if "verdict" not in result or "steps" not in result:
        return f"Axis {axis}: loop.json does not say what was found; close the loop again"
    if not functions:
        whole = "no effect of the library, nor a function without a name, holds what is left"
        return f"Axis {axis}: {whole}: {error}{fails}"
    return (
        f"Axis {axis} lacks {functions}, which no effect of the library describes: {error}{fails}"
    )


def _as_logged(result: Mapping[str, Any]) -> str:
    """Return the errors sample by sample where they are much larger: corners count as smooth."""
    sides = [result.get(side, {}) for side in ("before", "after")]
    logged, told = ([one.get(key) for one in sides] for key in ("as_logged_a", "rmse_a"))
    if None in (*logged, *told) or logged[1] <= CORNERS * told[1]:
        return ""
    shown = dict.fromkeys(f"{value:.4g}" for value in logged)
    return f" (sample by sample {' → '.join(shown)})"


def _axes_beside(steps: Sequence[Mapping[str, Any]]) -> list[str]:
    """Name the joints whose motion loads this one, of all the steps that tell of one or two."""
    given = [step.get("parameters", {}) for step in steps if step.get("effect") == "coupling"]
    axes = {one[key] for one in given for key in ("axis", "beside") if key in one}
    return [f"{axis:g}" for axis in sorted(axes)]


def loop_tables(result: Mapping[str, Any]) -> Sequence["RenderableType"]:
    """Return all that a closed loop found on an axis, one object of loop.json's `axes`."""
    from opamc_cli.stages.report.wording import loop as loop_words

    before, after, unit = result["before"], result["after"], result["unit"]
    shown: list[RenderableType] = [
        headline(result),
        f"{result['verdict']}; on sealed data r2 {before['r2']:.4f} → {after['r2']:.4f}; "
        f"{loop_words.ceiling_phrase(result)}",
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
        shown += [table, loop_words.STEP_COLUMNS]
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
