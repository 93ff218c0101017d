"""What a diagnosis compares: the tables of the baseline and, read apart from them, the target's."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pyarrow as pa

from opamc_cli.stages.chain.compared.pattern_rows import Key, PatternRows, group_patterns
from opamc_cli.stages.chain.witnesses import WITNESSES
from opamc_cli.stages.recordings.sessions import Sessions, in_words, lie_in_folders, sessions_of
from opamc_cli.storage.schemas.tables import PATTERNS
from opamc_cli.storage.sources import RunSource, read_sources
from opamc_cli.storage.tables import read_table


@dataclass(frozen=True)
class Side:
    """Tables of the baseline or of the target, as stage `patterns` wrote them."""

    path: Path
    """The pattern table."""
    sources: tuple[RunSource, ...]
    """Recordings that it was made from."""
    patterns: pa.Table
    """Its rows."""
    witnesses: Mapping[str, pa.Table]
    """Rows of the tables beside it, by file name; those that are there."""


def read_side(patterns: Path) -> Side:
    """Read a pattern table and the witnesses' tables beside it.

    A baseline that is kept is read once and compared with any number of targets.

    Raises
    ------
    InputError
        If a table cannot be used.
    """
    table = read_table(patterns, "patterns", PATTERNS)
    beside = {
        witness.FILE_NAME: patterns.with_name(witness.FILE_NAME)
        for witness in WITNESSES
        if patterns.with_name(witness.FILE_NAME).exists()
    }
    schemas = {witness.FILE_NAME: witness.SCHEMA for witness in WITNESSES}
    return Side(
        patterns,
        read_sources(patterns),
        table,
        {name: read_table(path, "patterns", schemas[name]) for name, path in beside.items()},
    )


@dataclass(frozen=True)
class Sides:
    """Baseline and target, and how their recordings make sessions."""

    baseline: Side
    target: Side
    """With `baseline`: tables of either side."""
    day_starts_at_h: float = 12.0
    """Hour of the day, UTC, at which a night ends."""

    @cached_property
    def sessions(self) -> tuple[Sessions, Sessions]:
        """Sessions of baseline and target, told apart in the same way."""
        by_folder = lie_in_folders(self.baseline.sources)
        own, other = (
            sessions_of(side.sources, self.day_starts_at_h, by_folder)
            for side in (self.baseline, self.target)
        )
        return own, other

    @cached_property
    def rows(self) -> tuple[dict[Key, PatternRows], dict[Key, PatternRows]]:
        """Pattern rows of baseline and target, by axis, motion, order and delay."""
        own, other = (
            group_patterns(side.patterns, str(side.path), sessions.of_run)
            for side, sessions in zip((self.baseline, self.target), self.sessions, strict=True)
        )
        return own, other

    def notes(self) -> list[str]:
        """Say what is worth knowing about the sessions."""
        return in_words(*self.sessions)
