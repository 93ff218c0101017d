"""Stage `patterns`: motions and runs in, ordinal pattern counts out (thesis 4.2).

Beside them it keeps what the other witnesses look at, which the thesis does not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.config.models import PatternsConfig
from opamc_cli.errors import OpamcError
from opamc_cli.signal.motion.rotation import torque_current
from opamc_cli.signal.ordinal.patterns import n_windows, ordinal_counts, time_delay
from opamc_cli.signal.plausible.quality import bridged
from opamc_cli.stages.chain.witnesses import WITNESSES
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.processes.parallel import Watch, map_items, unwatched
from opamc_cli.stages.recordings.envelope import course_of
from opamc_cli.stages.recordings.identified import IdentifiedPart, identified_parts
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import MOTIONS, PATTERNS, PLACE
from opamc_cli.storage.sources import read_sources, sources_record
from opamc_cli.storage.tables import check_current, read_table, record_at, table_input, write_table

FILES = (files.PATTERNS, *(witness.FILE_NAME for witness in WITNESSES))


@dataclass(frozen=True)
class PatternsOutcome:
    """What `run` did."""

    path: Path
    """The pattern table; those of the witnesses lie beside it."""
    table: pa.Table
    """The patterns' rows."""
    errors: tuple[OpamcError, ...]
    """One for each axis of a run that could not be read."""
    notes: tuple[str, ...]
    """Which delays are not those of (4-2), and why."""

    def by_motion(self) -> list[dict[str, Any]]:
        """Return delay, patterns and segments by axis, motion and order."""
        rows = self.table.group_by(["axis", "motion", "order", "tau"]).aggregate(
            [("n_patterns", "sum"), ("segment", "count")]
        )
        named = rows.rename_columns({"n_patterns_sum": "n_patterns", "segment_count": "segments"})
        keys = [(key, "ascending") for key in ("axis", "motion", "order", "tau")]
        listed: list[dict[str, Any]] = named.sort_by(keys).to_pylist()
        return listed


@dataclass(frozen=True)
class _Job:
    part: IdentifiedPart
    config: PatternsConfig


def run(
    motions: Path,
    config: Config,
    out: Path,
    *,
    moved_to: Sequence[Path] = (),
    jobs: int = 1,
    watch: Watch = unwatched,
    kept: KeptResults | None = None,
) -> PatternsOutcome:
    """Count the ordinal patterns of every identified segment's envelope; feed the witnesses.

    Parameters
    ----------
    motions
        Table of stage `identify`.
    config
        Section `patterns` is used.
    out
        Folder of the tables.
    moved_to
        Folders of the runs, if they were moved.
    jobs, watch, kept
        As of `segment.run`.

    Raises
    ------
    InputError
        If a table or run cannot be used.
    """
    table = read_table(motions, "identify", MOTIONS)
    check_current(motions)
    sources = read_sources(motions, moved_to)
    work = [_Job(part, config.patterns) for part in identified_parts(table, sources)]
    outcome = map_items(remembered(_analyse, kept), work, jobs, watch)
    if outcome.errors and not outcome.results:
        raise outcome.errors[0]
    patterns = pa.concat_tables(
        [PATTERNS.empty_table(), *(result[files.PATTERNS] for result in outcome.results)]
    ).combine_chunks()
    beside = {
        witness.FILE_NAME: pa.concat_tables(
            [
                witness.SCHEMA.empty_table(),
                *(result[witness.FILE_NAME] for result in outcome.results),
            ]
        ).combine_chunks()
        for witness in WITNESSES
    }
    inputs = [table_input(motions)]
    # segments of other options have other ends, and so have their patterns
    used = config.canonical("patterns") | {
        "segment": record_at(motions)["config"].get("segment", {})
    }
    for name, rows in {files.PATTERNS: patterns, **beside}.items():
        write_table(
            out / name,
            rows,
            stage="patterns",
            config=used,
            inputs=inputs,
            extra=sources_record(sources, out),
        )
    notes = _delays_in_words(table, patterns, config)
    return PatternsOutcome(out / files.PATTERNS, patterns, outcome.errors, tuple(notes))


def _delays_in_words(motions: pa.Table, patterns: pa.Table, config: Config) -> list[str]:
    """Say which delays were not those of (4-2), by axis."""
    length = {
        (row["axis"], row["motion"]): row["reference_samples"]
        for row in motions.select(["axis", "motion", "reference_samples"]).to_pylist()
    }
    columns = ["axis", "motion", "order", "tau", "signal"]
    # not `group_by`: to load what it is made of takes longer than all the rest
    rows = zip(*(patterns[name].to_pylist() for name in columns), strict=True)
    found = [dict(zip(columns, row, strict=True)) for row in dict.fromkeys(rows)]
    notes = []
    for axis in sorted({row["axis"] for row in found}):
        own = [row for row in found if row["axis"] == axis]
        used = ", ".join(
            f"{lengths[0]} to {lengths[-1]}" if len(lengths) > 1 else f"{lengths[0]}"
            for lengths in [sorted({row["tau"] for row in own})]
        )
        if own[0]["signal"] == "reported" and not (
            config.patterns.tau or config.joint.ratio_of(axis)
        ):
            notes.append(
                f"axis {axis}: no carrier and no joint.gear_ratio tell the patterns' delay; it is "
                f"chosen from the baseline's own current ({used} samples)"
            )
        shortened = [
            row
            for row in own
            if row["tau"] * (row["order"] - 1) * 2 + 2 * row["order"] > length[axis, row["motion"]]
        ]
        if shortened:
            motions_of = sorted({row["motion"] for row in shortened})
            one, more = len(motions_of) == 1, len(motions_of) - MOST_NAMED
            named = ", ".join(map(str, motions_of[:MOST_NAMED])) + f" and {more} more" * (more > 0)
            notes.append(
                f"axis {axis}: motion{'' if one else 's'} {named} {'is' if one else 'are'} short "
                f"for {'its' if one else 'their'} patterns, whose delay was limited to {used} "
                f"samples so that half of {'it' if one else 'each'} is left to count"
            )
    return notes


MOST_NAMED = 5
"""Motions of an axis that a note names, of up to hundreds in a long program."""

LARGEST_SHARE = 0.5
"""Of a motion that a pattern's window may span: longer ones leave hardly any to count."""


def delay(
    config: PatternsConfig, fs_hz: float, f_max_hz: float, order: int, samples: int
) -> int | None:
    """Return the time delay of a motion.

    Parameters
    ----------
    config
        A fixed delay, or γ of (4-2).
    fs_hz, f_max_hz
        Sampling rate, and frequency of the motion's carrier or of its current's fluctuations.
    order
        Of the patterns.
    samples
        Of the motion, as its reference has them.

    Returns
    -------
    int or None
        In samples; shortened until the window spans no more than `LARGEST_SHARE` of the motion,
        None if even neighbouring samples do not fit.
    """
    wanted = config.tau or time_delay(fs_hz, f_max_hz, order, config.gamma)
    longest = int(LARGEST_SHARE * samples) // (order - 1)
    return min(wanted, longest) if longest else None


def _analyse(job: _Job) -> dict[str, pa.Table]:
    """Return the patterns of the segments of one axis and what each witness keeps of them."""
    config = job.config
    patterns: list[dict[str, Any]] = []
    kept: dict[str, list[dict[str, Any]]] = {witness.FILE_NAME: [] for witness in WITNESSES}
    for row, current, whole in job.part.courses(config):
        fs_hz = row["sampling_rate_hz"]
        patterns += _pattern_rows(row, np.abs(course_of(current)), fs_hz, config)
        # cut short, a segment's parts would not be those of the others
        if whole:
            course = bridged(course_of(current))
            torque = course
            if np.iscomplexobj(current):
                torque = bridged(torque_current(current, row["reference_f_max_hz"], fs_hz))
            place = {name: row[name] for name in PLACE}
            for witness in WITNESSES:
                if columns := witness.kept(course, torque, fs_hz, config):
                    kept[witness.FILE_NAME].append({**place, **columns})
    patterns.sort(key=lambda row: (row["segment"], row["order"]))
    return {
        files.PATTERNS: pa.Table.from_pylist(patterns, schema=PATTERNS),
        **{
            witness.FILE_NAME: pa.Table.from_pylist(kept[witness.FILE_NAME], schema=witness.SCHEMA)
            for witness in WITNESSES
        },
    }


def _pattern_rows(
    row: dict[str, Any],
    envelope: npt.NDArray[np.floating],
    fs_hz: float,
    config: PatternsConfig,
) -> list[dict[str, Any]]:
    """Count the patterns of one segment, for every order."""
    delays = {}
    for order in sorted(set(config.orders)):
        tau = delay(config, fs_hz, row["reference_f_max_hz"], order, row["reference_samples"])
        if tau is not None:
            delays[order] = tau
    rows = []
    for tau in sorted(set(delays.values())):
        orders = [order for order, other in delays.items() if other == tau]
        for order, counts in ordinal_counts(envelope, orders, tau).items():
            counted = int(counts.sum())
            rows.append(
                {
                    **{name: row[name] for name in (*PLACE, "signal", "temperature_c")},
                    "order": order,
                    "tau": tau,
                    "gamma": None if config.tau else config.gamma,
                    "f_max_hz": row["reference_f_max_hz"],
                    "n_patterns": counted,
                    "n_masked": n_windows(envelope.size, order, tau) - counted,
                    "counts": counts,
                }
            )
    return rows
