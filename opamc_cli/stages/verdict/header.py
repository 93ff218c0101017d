"""What a verdict says besides its axes: when, by what, of which recordings and tables."""

import os
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from opamc_cli import __version__
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.sources import RunSource

SCHEMA_VERSION = 1


def header(
    sources: Sequence[RunSource],
    notes: Sequence[str],
    folder: Path,
    tables: Iterable[str],
) -> dict[str, Any]:
    """Return the fields of verdict.json beside `axes`.

    Parameters
    ----------
    sources
        The recordings of both sides.
    notes
        What is worth knowing of the diagnosis as a whole.
    folder, tables
        The tables that the verdict rests on, as paths below their folder; the verdict holds
        their hashes, and no report mixes it with others.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "version": __version__,
        "created_at": _now().isoformat(timespec="seconds"),
        "robot": _common(source.info.robot for source in sources),
        "program": _common(source.info.program for source in sources),
        "notes": list(notes),
        "tables": {name: file_sha256(folder / name) for name in sorted(tables)},
    }


def _now() -> datetime:
    """Return the time, or what SOURCE_DATE_EPOCH says: two runs can then be compared bytewise."""
    fixed = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(fixed), UTC) if fixed.isdecimal() else datetime.now(UTC)


def _common(values: Iterable[str | None]) -> str | None:
    known = {value for value in values if value is not None}
    return known.pop() if len(known) == 1 else None
