"""`opamc model arm`: where the joints of an arm are, from runs in which they all move."""

from pathlib import Path
from typing import Annotated

import typer

from opamc_cli.commands.terminal.options import Json, Quiet
from opamc_cli.commands.terminal.output import Output


def arm(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN...", help="Run files or folders.")],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="A model that declares the arm, for --model."),
    ] = Path("arm.yaml"),
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Find where an arm's joints are, from positions and currents of all axes; writes arm.yaml."""
    from opamc_cli.stages.model.arm import check_out, find_arm, told, write_arm
    from opamc_cli.storage.files.parquet import forgo_pandas
    from opamc_cli.storage.runs.finding import find_runs

    forgo_pandas()
    output = Output(as_json, quiet)
    check_out(out)
    paths = find_runs(runs)
    found = find_arm(paths)
    write_arm(found, paths, out)
    output.passed_over(runs)
    if found.part != "whole":
        output.note(f"found in the {found.part} of the motion alone: does the payload change?")
    output.result(
        {
            "arm": found.arm.model_dump(mode="json"),
            "zero": found.letters,
            "left": {str(axis): share for axis, share in found.left.items()},
            "part": found.part,
            "written": str(out),
        },
        f"{len(found.letters)} joints found, axes at zero along {found.letters}; left of the "
        f"current of axis {told(found.left)}",
        str(out),
    )
