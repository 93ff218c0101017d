"""What a subcommand prints: results on stdout, notes on stderr."""

import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from opamc_cli.commands.terminal.streams import complain, printable, say
from opamc_cli.errors import ExitCode

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from rich.console import RenderableType

    from opamc_cli.commands.terminal.progress import Steps

FILE_NAME = re.compile(r"\S.*\.[A-Za-z]\w{0,7}")
"""What a sentence about a recording begins with."""

MOST_NAMES = 3
"""Of recordings that fail as the first one does."""


@dataclass(frozen=True)
class Output:
    """Where results and notes go."""

    as_json: bool = False
    """Print the machine-readable result alone on stdout."""
    quiet: bool = False
    """Print nothing but errors (and the JSON result, if asked for)."""

    def note(self, text: str) -> None:
        """Print something worth knowing that is not the result."""
        if not self.quiet:
            say(f"{printable(text)}\n", sys.stderr)

    def notes(self, texts: Sequence[str], verbose: bool = False) -> None:
        """Print notes, those that differ in nothing but the recording and numbers as one."""
        for text in texts if verbose else folded(texts):
            self.note(text)

    def failure(self, text: str) -> None:
        """Print why one of several runs could not be used."""
        complain(text)

    def passed_over(self, paths: Sequence[Path]) -> None:
        """Print which folders of runs hold recordings that are none: they are not judged."""
        from opamc_cli.storage.runs.finding import passed_over

        for text in passed_over(paths):
            complain(text)

    def steps(self) -> "AbstractContextManager[Steps]":
        """Show which step is how far, on a terminal only."""
        from opamc_cli.commands.terminal.progress import steps_shown

        return steps_shown(self.quiet)

    def result(
        self, values: Mapping[str, Any], *shown: "RenderableType", urgent: bool = False
    ) -> None:
        """Print the result: `values` as JSON, or `shown` for people.

        An urgent result, such as a joint at fault, is printed even if quiet.
        """
        if self.as_json:
            say(json.dumps(values, indent=2, sort_keys=True, allow_nan=False) + "\n", sys.stdout)
        elif urgent or not self.quiet:
            # sentences, as those of a night, do without what tables take a hundredth of it to load
            sentences = all(isinstance(item, str) for item in shown)
            text = "".join(f"{item}\n" for item in shown) if sentences else _rendered(shown)
            if not sys.stdout.isatty():
                text = "".join(f"{line.rstrip()}\n" for line in text.splitlines())
            say(text, sys.stdout)

    def failures(self, failures: Sequence[str], n_done: int) -> ExitCode:
        """Print the runs that failed and return the exit code that they make."""
        for failure in gathered(failures):
            self.failure(failure)
        if failures and n_done:
            self.note(
                f"not used, or in part: {len(failures)}; all else of {n_done} "
                f"run{'s' * (n_done > 1)} is done"
            )
            return ExitCode.PARTIAL
        return ExitCode.BAD_INPUT if failures else ExitCode.DONE


def _rendered(shown: "Sequence[RenderableType]") -> str:
    from rich.console import Console

    # a file or pipe gets whole lines: a log that wraps at 80 columns cannot be searched;
    # brackets in a path are brackets, not markup
    text = StringIO()
    console = Console(
        file=text,
        force_terminal=sys.stdout.isatty() or None,
        width=None if sys.stdout.isatty() else 120,
        markup=False,
        emoji=False,
        highlight=False,
    )
    for item in shown:
        console.print(item, soft_wrap=isinstance(item, str))
    return text.getvalue()


def _alike(texts: Sequence[str]) -> list[list[str]]:
    """Group sentences, each once, that say the same of several files or axes, but for numbers."""
    groups: dict[str, list[str]] = {}
    for text in dict.fromkeys(texts):
        subject, colon, rest = text.partition(": ")
        if colon and FILE_NAME.fullmatch(subject):
            text_of_all = re.sub(r"[0-9]+", "#", rest)
        else:
            text_of_all = re.sub(r"[0-9]+", "#", text) if subject.startswith("axis ") else text
        groups.setdefault(text_of_all, []).append(text)
    return list(groups.values())


def gathered(failures: Sequence[str]) -> list[str]:
    """Return failures with one line for all files that fail alike, which it names.

    A logger whose columns have new names says so of each of a night's files.

    Examples
    --------
    >>> gathered([f"{name}.csv: 3 columns of {n}" for n, name in enumerate("abcde")])
    ['a.csv: 3 columns of 0; likewise b.csv, c.csv, d.csv and 1 more']
    >>> gathered(["a.csv: cut off", "b.csv: no rate"])
    ['a.csv: cut off', 'b.csv: no rate']
    """
    lines = []
    for first, *others in _alike(failures):
        names = [text.partition(": ")[0] for text in others]
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        likewise = f"; likewise {', '.join(names[:MOST_NAMES])}{more}" if names else ""
        lines.append(first + likewise)
    return lines


def folded(texts: Sequence[str]) -> list[str]:
    """Return notes with those that repeat for many runs as one line.

    Examples
    --------
    >>> folded(["a.parquet: no ratio", "b.parquet: no ratio", "rate differs"])
    ['2 runs: no ratio', 'rate differs']
    >>> folded(["a.csv: is large", "b.csv: is large"])
    ['2 files: is large']
    >>> folded(["a.parquet: 3 samples lost", "b.parquet: 8 samples lost"])
    ['a.parquet: 3 samples lost; 1 more run likewise']
    >>> folded([f"{run}.parquet: axis{axis}_a lacks 3" for run in "ab" for axis in (1, 2)])
    ['a.parquet: axis1_a lacks 3; 3 more like this, in 2 runs']
    >>> folded(["axis 3: no temperature", "axis 6: no temperature"])
    ['axes 3, 6: no temperature']
    """
    lines = []
    for alike in _alike(texts):
        more = len(alike) - 1
        rests = {text.partition(": ")[2] for text in alike}
        if more and alike[0].startswith("axis ") and len(rests) == 1:
            axes = ", ".join(text.partition(": ")[0].removeprefix("axis ") for text in alike)
            lines.append(f"axes {axes}: {rests.pop()}")
        elif more and alike[0].startswith("axis "):
            lines.append(f"{alike[0]} (and {more} more like this)")
        elif more and len(rests) == 1:
            what = "runs" if alike[0].partition(": ")[0].endswith(".parquet") else "files"
            lines.append(f"{len(alike)} {what}: {rests.pop()}")
        elif more and (runs := len({text.partition(": ")[0] for text in alike})) <= more:
            within = f"in {runs} runs" if runs > 1 else "in this run"
            lines.append(f"{alike[0]}; {more} more like this, {within}")
        elif more:
            lines.append(f"{alike[0]}; {more} more run{'s' if more > 1 else ''} likewise")
        else:
            lines.append(alike[0])
    return lines
