"""Commands that a sentence proposes; what they name is filled in where it is said."""

from collections.abc import Sequence
from pathlib import Path
from shlex import quote

ACKNOWLEDGE = "opamc nightly acknowledge ROBOT --why TEXT --cell CELL"
REBASELINE = "opamc nightly rebaseline ROBOT --from DATE --why TEXT --cell CELL"


def to_copy(text: str, robots: Sequence[str], cell: Path) -> str:
    """Name the robot, if it is one, and the cell's file in the commands of a sentence.

    The history keeps neither: robots share a line, and a path depends on where one stands.

    Examples
    --------
    >>> to_copy(f"to end it: {ACKNOWLEDGE}", ["KR 6"], Path("cell.yaml"))
    "to end it: opamc nightly acknowledge 'KR 6' --why TEXT --cell cell.yaml"
    """
    if len(robots) == 1:
        text = text.replace(" ROBOT --", f" {quote(robots[0])} --")
    return text.replace("--cell CELL", f"--cell {quote(str(cell))}")
