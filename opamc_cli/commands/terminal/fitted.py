"""A table that leaves out columns on a narrow terminal, and never digits."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderResult
    from rich.table import Table
    from rich.text import Text

WRAPPED = 16
"""Least width of a column of words, which may be broken into lines."""

GAP = 3
"""Blanks between two columns."""


class FittedTable:
    """A table whose columns are chosen when it is printed.

    Parameters
    ----------
    headings
        Of the columns.
    right
        Places of the columns that are flush right.
    dropped
        Headings of the columns that may be left out, the first one first.
    wraps
        Headings of the columns of words.
    """

    def __init__(
        self,
        headings: Sequence[str],
        *,
        right: Sequence[int],
        dropped: Sequence[str],
        wraps: Sequence[str] = (),
    ) -> None:
        self._headings = list(headings)
        self._right = right
        self._dropped = dropped
        self._wraps = wraps
        self._rows: list[tuple[str | Text, ...]] = []

    def add_row(self, *cells: "str | Text") -> None:
        """Add a row, one cell for each heading."""
        self._rows.append(cells)

    def __rich_console__(self, console: "Console", options: "ConsoleOptions") -> "RenderResult":
        """Print the columns for which there is room."""
        for count in range(len(self._dropped) + 1):
            shown = [name for name in self._headings if name not in self._dropped[:count]]
            if self._needs(shown) <= options.max_width:
                break
        yield self._table(shown)

    def _needs(self, shown: Sequence[str]) -> int:
        from rich.cells import cell_len

        needed = GAP * (len(shown) - 1)
        for name in shown:
            place = self._headings.index(name)
            longest = max(cell_len(str(row[place])) for row in [self._headings, *self._rows])
            needed += min(longest, WRAPPED) if name in self._wraps else longest
        return needed

    def _table(self, shown: Sequence[str]) -> "Table":
        from rich.box import SIMPLE_HEAD
        from rich.table import Table

        table = Table(box=SIMPLE_HEAD, pad_edge=False, show_edge=False)
        places = [self._headings.index(name) for name in shown]
        for place in places:
            name = self._headings[place]
            justify = "right" if place in self._right else "left"
            table.add_column(name, justify=justify, no_wrap=name not in self._wraps)  # type: ignore[arg-type]
        for row in self._rows:
            table.add_row(*(row[place] for place in places))
        return table
