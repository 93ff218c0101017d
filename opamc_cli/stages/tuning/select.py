"""Stage `select`: order and scale factor γ from the baseline alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.config.models import PatternsConfig
from opamc_cli.decision.divergence.selection import self_consistency
from opamc_cli.errors import NotEnoughDataError, OpamcError
from opamc_cli.signal.ordinal.patterns import ordinal_counts, time_delay
from opamc_cli.stages.processes.parallel import Watch, map_items, unwatched
from opamc_cli.stages.recordings.envelope import course_of
from opamc_cli.stages.recordings.identified import IdentifiedPart, identified_parts
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import MOTIONS, SELECTION
from opamc_cli.storage.sources import read_sources
from opamc_cli.storage.tables import read_table, table_input, write_table


@dataclass(frozen=True)
class SelectionOutcome:
    """What `run` did."""

    path: Path
    """The table that was written."""
    table: pa.Table
    """Self-consistency by axis, order and γ, and how many patterns of the shortest motion fall on
    each of the α! possible ones."""
    order: int
    gamma: float
    """With `order`: the setting whose self-consistency, averaged over axes, is largest."""
    warnings: tuple[str, ...]
    """One for each order with fewer patterns than possible ones."""
    errors: tuple[OpamcError, ...]
    """One for each axis of a run that could not be read."""


Counts = npt.NDArray[np.int64]


def run(
    motions: Path,
    config: Config,
    out: Path,
    *,
    orders: Sequence[int] = (3, 4, 5, 6),
    gammas: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
    moved_to: Sequence[Path] = (),
    jobs: int = 1,
    watch: Watch = unwatched,
) -> SelectionOutcome:
    """Rate orders and scale factors by how well healthy segments know their own motion.

    Parameters
    ----------
    motions
        Table of stage `identify`, of the baseline.
    config
        `patterns.envelope` and `patterns.remove_offset` are used.
    out
        Folder of the table.
    orders, gammas
        What to rate.
    moved_to, jobs, watch
        As of `patterns.run`.

    Raises
    ------
    NotEnoughDataError
        If no axis has two motions and two cycles.
    """
    table = read_table(motions, "identify", MOTIONS)
    count = partial(_count, settings=[*product(orders, gammas)], config=config.patterns)
    work = identified_parts(table, read_sources(motions, moved_to))
    outcome = map_items(count, work, jobs, watch)
    rated = _rate([part for parts in outcome.results for part in parts])
    known = [row for row in rated if row["self_consistency"] is not None]
    if not known:
        msg = (
            f"{motions}: no axis has two motions in two cycles, which is what orders and γ are "
            "rated by; record more cycles, or keep the defaults"
        )
        raise NotEnoughDataError(msg)
    table = pa.Table.from_pylist(rated, schema=SELECTION)
    write_table(
        out / files.SELECTION,
        table,
        stage="select",
        config=config.canonical("patterns"),
        inputs=[table_input(motions)],
    )
    order, gamma = _best(known)
    few: dict[int, tuple[float, float]] = {}  # the smallest γ of an order with too few
    for row in rated:
        if row["patterns_per_cell"] < 1:
            own = row["gamma"], row["patterns_per_cell"]
            few[row["order"]] = min(own, few.get(row["order"], own))
    warnings = tuple(
        f"order {each}, gamma {scale:g} and more: {least:.2g} patterns for each possible one in "
        "the shortest motion; its divergence is mostly chance"
        for each, (scale, least) in sorted(few.items())
    )
    return SelectionOutcome(out / files.SELECTION, table, order, gamma, warnings, outcome.errors)


@dataclass(frozen=True)
class _Counted:
    """Counts of one axis of one run at one order and γ."""

    axis: int
    order: int
    gamma: float
    motions: tuple[int, ...]
    cycles: tuple[str, ...]
    counts: Counts


def _count(
    part: IdentifiedPart, settings: Sequence[tuple[int, float]], config: PatternsConfig
) -> list[_Counted]:
    found: dict[tuple[int, float], list[Counts]] = {setting: [] for setting in settings}
    for row, current, _ in part.courses(config):
        for order, gamma in settings:
            tau = time_delay(row["sampling_rate_hz"], row["reference_f_max_hz"], order, gamma)
            found[order, gamma].append(
                ordinal_counts(np.abs(course_of(current)), [order], tau)[order]
            )
    names = tuple(f"{row['run']}\n{row['cycle']}" for row in part.rows)
    motions = tuple(int(row["motion"]) for row in part.rows)
    return [
        _Counted(part.axis, order, gamma, motions, names, np.array(counts))
        for (order, gamma), counts in found.items()
    ]


def _rate(parts: Sequence[_Counted]) -> list[dict[str, Any]]:
    groups: dict[tuple[int, int, float], list[_Counted]] = {}
    for part in parts:
        groups.setdefault((part.axis, part.order, part.gamma), []).append(part)
    rows = []
    for (axis, order, gamma), own in sorted(groups.items()):
        counts = np.concatenate([part.counts for part in own])
        motions = np.concatenate([part.motions for part in own])
        cycles = np.concatenate([part.cycles for part in own])
        value = self_consistency(counts, motions, cycles)
        rows.append(
            {
                "axis": axis,
                "order": order,
                "gamma": gamma,
                "self_consistency": value if np.isfinite(value) else None,
                "patterns_per_cell": float(counts.sum(axis=1).min() / counts.shape[1]),
            }
        )
    return rows


def _best(rows: Sequence[dict[str, Any]]) -> tuple[int, float]:
    values: dict[tuple[int, float], list[float]] = {}
    for row in rows:
        values.setdefault((row["order"], row["gamma"]), []).append(row["self_consistency"])
    return max(sorted(values), key=lambda key: float(np.mean(values[key])))
