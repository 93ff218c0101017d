"""What a diagnosis finds out from the recordings themselves, kept for deciding again without them.

Causes of the joints that differ, and joints that cannot be judged, with the hashes of the tables
beside which they hold.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic_core import from_json

from opamc_cli.config.reading import read_text
from opamc_cli.errors import InputError
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.files.json_documents import MOST_BYTES
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.schemas import files

ROLES = ("baseline", "target")


@dataclass(frozen=True)
class Findings:
    """Causes, and reasons why joints cannot be judged, by axis."""

    causes: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    unjudged: Mapping[int, Sequence[str]] = field(default_factory=dict)
    foreign: frozenset[int] = frozenset()
    """Of these, the ones of another program or log."""
    friction: Mapping[int, float] = field(default_factory=dict)
    """By how much friction differs, of 1, where joints are excused by the others."""


NOTHING_FOUND = Findings()


def write_findings(folder: Path, findings: Findings) -> None:
    """Write the findings beside the pattern tables of a diagnosis."""
    content = {
        "tables": {
            f"{role}/{files.PATTERNS}": file_sha256(folder / role / files.PATTERNS)
            for role in ROLES
        },
        "causes": {str(axis): dict(cause) for axis, cause in findings.causes.items()},
        "unjudged": {str(axis): list(why) for axis, why in findings.unjudged.items()},
        "foreign": sorted(findings.foreign),
        "friction": {str(axis): value for axis, value in findings.friction.items()},
    }
    write_text(folder / files.FINDINGS, json.dumps(content, indent=2, allow_nan=False) + "\n")


def read_findings(folder: Path, tables: tuple[Path, Path]) -> Findings:
    """Return the findings in a folder; none where there are none, or of other tables."""
    try:
        content = from_json(read_text(folder / files.FINDINGS, InputError, MOST_BYTES))
        vouched = [content["tables"][f"{role}/{files.PATTERNS}"] for role in ROLES]
        found = Findings(
            {int(axis): dict(cause) for axis, cause in content["causes"].items()},
            {int(axis): [str(each) for each in why] for axis, why in content["unjudged"].items()},
            frozenset(map(int, content.get("foreign", ()))),
            {int(axis): float(value) for axis, value in content.get("friction", {}).items()},
        )
    except (InputError, ValueError, LookupError, TypeError, AttributeError):
        return NOTHING_FOUND
    return found if vouched == [file_sha256(table) for table in tables] else NOTHING_FOUND
