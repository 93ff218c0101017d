"""Bars with the time that is left, on a terminal only: cron mails whatever else it gets."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

Watch = Callable[[int, int], None]
Steps = Callable[[str], Watch]
"""Called with a step's name as it begins; what it returns is called with what is done of it."""


@contextmanager
def steps_shown(quiet: bool) -> Iterator[Steps]:
    """Show the steps of a long command for as long as it runs; nothing stays behind."""
    if quiet or not sys.stderr.isatty():
        yield lambda _: lambda done, total: None
        return
    with _bars() as bars:

        def begin(name: str) -> Watch:
            for task in bars.tasks:
                bars.update(task.id, visible=False)
            task_id = bars.add_task(name, total=None)

            def watch(done: int, total: int) -> None:
                bars.update(task_id, completed=done, total=total)

            return watch

        yield begin


def _bars() -> "Progress":
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("gone,"),
        TimeRemainingColumn(),
        TextColumn("left"),
        console=Console(stderr=True),
        transient=True,
    )
