"""What a diagnosis compares: the tables of the baseline and, read apart from them, the target's."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.decision.witnesses.patterns import inflation_within_sessions
from opamc_cli.stages.chain.compared.pattern_rows import (
    Key,
    PatternRows,
    cycle_counts,
    group_patterns,
)
from opamc_cli.stages.chain.witnesses import WITNESSES
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.recordings.sessions import (
    BY_FILE,
    Sessions,
    in_words,
    lie_in_folders,
    sessions_of,
)
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


Cycles = tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]
"""Counts of each cycle, and its session; see `cycle_counts`."""


def _inflations(cycles: tuple[Cycles, ...]) -> tuple[float, ...]:
    """Return how many times more the cycles of one session scatter than chance, key by key."""
    return tuple(inflation_within_sessions(counts, session) for counts, session in cycles)


@dataclass(frozen=True)
class Sides:
    """Baseline and target, and how their recordings make sessions."""

    baseline: Side
    target: Side
    """With `baseline`: tables of either side."""
    day_starts_at_h: float | None = 12.0
    """Hour of the day, UTC, at which a night ends; None: the folders tell nights."""
    kept: KeptResults | None = None
    """Where what the baseline alone tells may lie."""
    target_by_file: bool = False
    """Whether each of the target's recordings is held against the baseline by itself."""

    @cached_property
    def sessions(self) -> tuple[Sessions, Sessions]:
        """Sessions of baseline and target, told apart in the same way."""
        by_folder = lie_in_folders(self.baseline.sources)
        own, other = (
            sessions_of(side.sources, self.day_starts_at_h, by_folder)
            for side in (self.baseline, self.target)
        )
        if self.target_by_file:
            other = Sessions({run: run for run in other.of_run}, (BY_FILE,))
        return own, other

    @cached_property
    def rows(self) -> tuple[dict[Key, PatternRows], dict[Key, PatternRows]]:
        """Pattern rows of baseline and target, by axis, motion, order and delay."""
        own, other = (
            group_patterns(side.patterns, str(side.path), sessions.of_run)
            for side, sessions in zip((self.baseline, self.target), self.sessions, strict=True)
        )
        return own, other

    @cached_property
    def baseline_cycles(self) -> dict[Key, Cycles]:
        """The baseline's segments pooled by cycle."""
        return {key: cycle_counts(part) for key, part in self.rows[0].items()}

    @cached_property
    def inflations(self) -> dict[Key, float]:
        """How many times more the baseline's cycles scatter than independent patterns would."""
        cycles = self.baseline_cycles
        found = remembered(_inflations, self.kept)(tuple(cycles.values()))
        return dict(zip(cycles, found, strict=True))

    def notes(self) -> list[str]:
        """Say what is worth knowing about the sessions."""
        return in_words(*self.sessions)
