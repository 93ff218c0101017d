"""One cell for one folder of results: two that share one would judge each other's nights anew."""

from contextlib import suppress
from pathlib import Path

from opamc_cli.config.cell import CellConfig, load_cell
from opamc_cli.errors import ConfigError, UsageError
from opamc_cli.storage.files.atomic import write_text

CLAIM = ".opamc.cell"
"""File in `out` that holds the path of the cell's file, of the last start."""


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
    return pattern if "://" in pattern else str(Path(pattern).absolute())
