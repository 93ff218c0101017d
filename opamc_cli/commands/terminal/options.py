"""Options that every subcommand shares."""

from pathlib import Path
from typing import Annotated

import typer

ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", metavar="FILE", help="YAML file with the options of the stages."),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override one option, such as patterns.gamma=1; may be repeated.",
    ),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Where the results are written.")]
Jobs = Annotated[
    int,
    typer.Option(
        "--jobs",
        min=0,
        metavar="N",
        help="Worker processes; 0: one per core. Results do not change.",
    ),
]
Json = Annotated[
    bool,
    typer.Option("--json", help="Machine-readable result on stdout, all else on stderr."),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print nothing unless something is wrong.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", help="Every reason and note, and the table of all axes.")
]
ExitZero = Annotated[
    bool, typer.Option("--exit-zero", help="Exit 0 where the verdict alone would make it 1.")
]
MovedRuns = Annotated[
    list[Path] | None,
    typer.Option(
        "--runs",
        metavar="DIR",
        help="Where the runs are now, if they were moved; may be repeated.",
    ),
]

DEFAULT_OUT = Path("opamc-out")

ALL_CORES = 0
"""Default of `Jobs`: a night's logs are judged on all cores, a few short ones in this process."""
