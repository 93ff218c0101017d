"""`opamc example`: recordings and configurations to try everything on."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal.options import Json, Quiet
from opamc_cli.commands.terminal.output import Output


def example(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where they are written; made if needed.")
    ] = Path("opamc-example"),
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write recordings of a virtual robot, healthy and at fault, and all configurations.

    What is there already is left alone.
    """
    from opamc_cli.config.shipped import copy_shipped

    output = Output(as_json, quiet)
    written = copy_shipped(folder)
    command = (
        f"opamc diagnose --baseline {folder}/normal --target {folder}/fault "
        f"--set joint.gear_ratio=100 --set joint.pole_pairs=5 --out {folder}/result"
    )
    output.result(
        {"folder": str(folder), "written": [str(path) for path in written], "next": command},
        f"{folder}: {len(written)} files written; now try",
        f"  {command}",
    )
