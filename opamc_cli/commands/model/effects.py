"""`opamc model effects`: what the library of effects holds."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from opamc_cli.commands.terminal.options import Json
from opamc_cli.commands.terminal.output import Output

if TYPE_CHECKING:
    from opamc_cli.joint.effects.base import Effect

UNITS = {
    "order": "cycles per turn of the motor",
    "frequency_hz": "Hz",
    "stribeck_speed": "rad/s",
    "place_rad": "rad",
    "width_rad": "rad",
    "since_s": "s",
    "until_s": "s",
    "gripped_s": "s",
    "released_s": "s",
    "delay_s": "s",
}
"""Units of parameters whose name does not tell; others end in theirs."""


def effects(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="One effect, in full; default: all.")
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model", metavar="FILE", help="List the effects of its own library as well."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the effects that a joint's model may hold, or show one with its equation."""
    from opamc_cli.arm.effects import Arm
    from opamc_cli.arm.torques import KinematicChain
    from opamc_cli.commands.terminal.fitted import FittedTable
    from opamc_cli.config.joint_model import load_joint_model
    from opamc_cli.joint.effects.library import built_in_library, effect_named
    from opamc_cli.stages.model.declared.users_effects import load_user_effects

    library = built_in_library() | {Arm.name: Arm(KinematicChain(()))}
    for file in load_joint_model(model).library if model else ():
        library |= {effect.name: effect for effect in load_user_effects(file)}
    output = Output(as_json)
    if name is not None:
        told = _described(effect_named(library, name))
        lines = [f"{key}: {value}" for key, value in told.items() if value and key != "text"]
        output.result(told, *lines, "", told["text"])
        return
    all_told = [_described(effect) for effect in library.values()]
    table = FittedTable(
        ("effect", "domain", "parameters", "meaning"),
        right=(),
        dropped=("domain", "parameters"),
        wraps=("parameters", "meaning"),
    )
    for told in all_told:
        table.add_row(told["name"], told["domain"], told["parameters"], told["meaning"])
    output.result({"effects": all_told}, table)


def _described(effect: "Effect") -> dict[str, Any]:
    import inspect

    from opamc_cli.joint.effects.base import CHANNEL_REASONS

    parameters = dict.fromkeys((*getattr(effect, "searches", ()), *effect.forms))
    return {
        "name": effect.name,
        "domain": effect.domain,
        "meaning": effect.meaning or "part of every joint",
        "origin": effect.origin,
        "parameters": ", ".join(_with_unit(each) for each in parameters),
        "untestable where": "; ".join(CHANNEL_REASONS.get(each, each) for each in effect.needs),
        "text": inspect.getdoc(type(effect)) or "",
    }


def _with_unit(parameter: str) -> str:
    unit = UNITS.get(parameter)
    return f"{parameter} ({unit})" if unit else parameter
