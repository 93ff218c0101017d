"""A folder of results for one cell alone, apart from its logs."""

import os
from contextlib import suppress
from pathlib import Path

from opamc_cli.config.cell import CellConfig, load_cell
from opamc_cli.errors import ConfigError, UsageError
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.logs import holds_logs, robot_of
from opamc_cli.storage.schemas import files

CLAIM = ".opamc.cell"
"""File in `out` that holds the path of the cell's file, of the last start."""


SOME_ROBOT, SOME_NIGHT = "robot", "2001-01-01"


def check_apart(cell: CellConfig, path: Path) -> None:
    """Refuse results among the logs: they would be taken for logs, or logs for results.

    Raises
    ------
    UsageError
        If a night's results would lie in a folder of logs, or a file of the results is a log to
        the cell's patterns.
    """
    named = (SOME_ROBOT,) if cell.robots == "auto" else tuple(cell.robots)
    out = Path(_absolute(str(cell.out)))
    nights = [out / robot / SOME_NIGHT for robot in named]
    written = [out / name for name in (files.HISTORY, files.PAGE, files.METRICS)]
    written += [night / name for night in nights for name in (files.VERDICT, files.REPORT)]
    for pattern in map(_absolute, filter(None, (cell.runs, cell.baseline.runs))):
        robots = {robot_of(pattern, str(one)) for one in written} - {None}
        taken = robots if cell.robots == "auto" else robots & {"", *named}
        if taken or any(holds_logs(pattern, str(night)) for night in nights):
            msg = (
                f"{path}: out is {cell.out}, where results and recordings ({pattern}) would be "
                "taken for one another; name a folder apart from the logs"
            )
            raise UsageError(msg)


def claim(cell: CellConfig, path: Path) -> None:
    """Remember whose results a folder holds.

    Raises
    ------
    UsageError
        If another cell's file that is still there writes other recordings' results into it.
    """
    mine, there = str(path.resolve()), cell.out / CLAIM
    before = ""
    with suppress(OSError, UnicodeDecodeError):
        before = there.read_text(encoding="utf-8").strip()
    if before == mine:
        return
    with suppress(ConfigError):  # it is gone, or no cell any more
        other = load_cell(Path(before)) if before else cell
        same = other.out.resolve() == cell.out.resolve()
        if same and _absolute(other.runs) != _absolute(cell.runs):
            msg = (
                f"{cell.out}: holds the results of {before}, which looks after other recordings "
                f"({other.runs}); give each cell an `out` of its own"
            )
            raise UsageError(msg)
    write_text(there, mine + "\n")


def _absolute(pattern: str) -> str:
    return pattern if "://" in pattern else os.path.abspath(pattern)  # noqa: PTH100 - without ".."
