"""Stage `decide`: pattern tables and what lies beside them in, verdict.json out; no recordings.

What a diagnosis found out from the recordings themselves, causes and joints that cannot be judged,
is taken from what it left (`findings`), as long as that is of the same tables.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from opamc_cli.config import Config
from opamc_cli.errors import ExitCode, InputError, OpamcError
from opamc_cli.stages.chain import score, to_patterns
from opamc_cli.stages.chain.compared.side import Side, Sides, read_side
from opamc_cli.stages.chain.witnesses import WITNESSES
from opamc_cli.stages.verdict import verdict
from opamc_cli.stages.verdict.decision import decide
from opamc_cli.stages.verdict.findings import read_findings
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.schemas import files
from opamc_cli.storage.sources import other_robot
from opamc_cli.storage.tables import check_current

FILES = (files.VERDICT, *score.FILES)


@dataclass(frozen=True)
class DecideOutcome:
    """What `run` did."""

    verdict: dict[str, Any]
    """Content of verdict.json."""
    exit_code: ExitCode
    """What it ends with."""
    errors: tuple[OpamcError, ...] = ()
    """What was left out, and why nothing that was found unchanged is a verdict."""


def default_tables(folder: Path) -> tuple[Path, Path]:
    """Return the two pattern tables that a diagnosis leaves in its folder."""
    baseline, target = (folder / role / files.PATTERNS for role in ("baseline", "target"))
    return baseline, target


def run(baseline: Path, target: Path, config: Config, folder: Path, out: Path) -> DecideOutcome:
    """Decide about every joint from tables alone.

    Parameters
    ----------
    baseline, target
        Tables of stage `patterns`; spectra and profiles are taken from beside them.
    config
        Section `score` is used.
    folder
        Where a diagnosis left its findings, if one did.
    out
        Where the new one is written.

    Raises
    ------
    InputError
        If a table cannot be used or is not there, or the two cannot be compared.
    """
    sides = Sides(_whole(baseline), _whole(target), config.score.day_starts_at)
    found = read_findings(folder, (baseline, target))
    scored = score.compare_sides(sides, config, out)
    decided = decide(sides, config)
    notes = [*scored.notes, *scored.doubts, *decided.notes(), *decided.blind(config.score)]
    if any(axis not in found.causes for axis in decided.differing()):
        notes.append("no cause was sought, which needs the recordings: `opamc diagnose` does it")
    sources = (*sides.baseline.sources, *sides.target.sources)
    head = verdict.header(sources, notes, out, score.FILES)
    head["tables"] |= _beside(folder, (baseline, target))
    written = verdict.write(decided, scored, config, out, found, head)
    stranger = other_robot(sides.baseline.sources, sides.target.sources)
    unsure = [InputError(why) for why in (stranger, *scored.doubts) if why]
    errors = (*decided.odd_ones(), *unsure)
    worst = ExitCode.NOT_ENOUGH_DATA if unsure else ExitCode.PARTIAL if errors else ExitCode.DONE
    return DecideOutcome(written.verdict, written.exit_code or worst, errors)


def _whole(patterns: Path) -> Side:
    """Read the tables of one side; a witness whose table was lost would be missed by nobody."""
    side = read_side(patterns)
    check_current(patterns)
    for witness in WITNESSES:
        path = patterns.with_name(witness.FILE_NAME)
        if witness.FILE_NAME not in side.witnesses:
            msg = f"{path}: no such file; it belongs to {patterns.name}: run `opamc patterns` again"
            raise InputError(msg)
        check_current(path)
    return side


def _beside(folder: Path, tables: tuple[Path, Path]) -> dict[str, str]:
    """Return the hashes of the tables of both sides that lie below a folder, by their names."""
    root = folder.resolve()
    found = {}
    for table in tables:
        for name in to_patterns.FILES:
            path = table.with_name(name)
            if path.exists() and table.parent.resolve().parent == root:
                found[f"{table.parent.name}/{name}"] = file_sha256(path)
    return found
