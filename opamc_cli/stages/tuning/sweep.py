"""Stage `sweep`: divergences over a range of delays and orders (thesis 5.2.1)."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.config.models import PatternsConfig
from opamc_cli.decision.divergence.features import ks_statistic
from opamc_cli.decision.divergence.jensen_shannon import (
    divergences_from_pool,
    leave_cycle_out_divergences,
)
from opamc_cli.errors import NotEnoughDataError, OpamcError
from opamc_cli.signal.ordinal.patterns import ordinal_counts, time_delay
from opamc_cli.stages.processes.parallel import Watch, map_items, unwatched
from opamc_cli.stages.recordings.envelope import course_of
from opamc_cli.stages.recordings.identified import IdentifiedPart, identified_parts
from opamc_cli.stages.recordings.sessions import Sessions, lie_in_folders, sessions_of
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import MOTIONS, SWEEP
from opamc_cli.storage.sources import check_comparable, read_sources
from opamc_cli.storage.tables import read_table, table_input, write_table

Counts = npt.NDArray[np.int64]
Settings = Sequence[tuple[int, int]]
"""Order and delay of each."""


@dataclass(frozen=True)
class SweepOutcome:
    """What `run` did."""

    path: Path
    """The table that was written."""
    table: pa.Table
    """Its rows: one per segment, order and delay."""
    errors: tuple[OpamcError, ...]
    """One for each axis of a run that could not be read."""

    def best(self) -> list[dict[str, Any]]:
        """Return, by axis and order, the delay that separates target from baseline most.

        The separation is the difference of the mean divergences; the Kolmogorov-Smirnov
        statistic stands beside it.
        """
        rows = self.table.to_pydict()
        axis, order, tau = (np.asarray(rows[name]) for name in ("axis", "order", "tau"))
        # unknown divergences are null in the table
        jsd, target = np.asarray(rows["jsd"], dtype=float), np.asarray(rows["role"]) == "target"
        tau_opt = np.asarray(rows["tau_opt"])
        found = []
        for a, o in sorted(set(zip(axis.tolist(), order.tolist(), strict=True))):
            here = (axis == a) & (order == o)
            separation = {}
            for t in np.unique(tau[here]).tolist():
                base = jsd[here & (tau == t) & ~target]
                other = jsd[here & (tau == t) & target]
                base, other = base[np.isfinite(base)], other[np.isfinite(other)]
                if base.size and other.size:
                    gap = float(other.mean() - base.mean())
                    separation[t] = (gap, float(base.mean()), float(other.mean()), base, other)
            if not separation:
                continue
            best = max(separation, key=lambda t: separation[t][0])
            _, base_mean, target_mean, base, other = separation[best]
            found.append(
                {
                    "axis": a,
                    "order": o,
                    "tau": best,
                    "tau_opt": sorted(set(tau_opt[here].tolist())),
                    "jsd_baseline": base_mean,
                    "jsd_target": target_mean,
                    "ks": ks_statistic(base, other),
                }
            )
        return found


@dataclass(frozen=True)
class _Counted:
    """Counts of every segment of one axis of one run, by (order, tau)."""

    rows: tuple[dict[str, Any], ...]
    counts: dict[tuple[int, int], list[Counts]]


def run(
    baseline: Path,
    config: Config,
    out: Path,
    *,
    taus: Sequence[int],
    orders: Sequence[int],
    target: Path | None = None,
    jobs: int = 1,
    watch: Watch = unwatched,
) -> SweepOutcome:
    """Compute the divergence of every segment for every delay and order.

    Parameters
    ----------
    baseline, target
        Tables of stage `identify`; without a target only the baseline's own divergences.
    config
        `patterns.envelope`, `patterns.remove_offset`, `patterns.gamma`, `score.base` and
        `score.day_starts_at` are used.
    out
        Folder of the sweep table.
    taus, orders
        What is swept: samples >= 1, orders 3..7.
    jobs, watch
        As of `segment.run`.

    Raises
    ------
    InputError
        If a table or run cannot be used.
    NotEnoughDataError
        If no motion holds a pattern of any delay.
    """
    tables = {"baseline": baseline} | ({"target": target} if target else {})
    sources = {role: read_sources(path) for role, path in tables.items()}
    check_comparable(sources["baseline"], sources.get("target", ()))
    counted: dict[str, list[_Counted]] = {}
    errors: list[OpamcError] = []
    settings = [(order, tau) for order in orders for tau in taus]
    count = partial(_count, settings=settings, config=config.patterns)
    for role, path in tables.items():
        parts = identified_parts(read_table(path, "identify", MOTIONS), sources[role])
        outcome = map_items(count, parts, jobs, watch)
        counted[role] = list(outcome.results)
        errors += outcome.errors
    own = sources["baseline"]
    sessions = sessions_of(own, config.score.day_starts_at, lie_in_folders(own))
    table = pa.Table.from_pylist(_rows(counted, sessions, config), schema=SWEEP)
    if table.num_rows and table["jsd"].null_count == table.num_rows:
        msg = (
            f"{baseline}: no motion is long enough for a pattern of delay {min(taus)}, or none has "
            "two cycles to compare; sweep smaller delays, or more recordings"
        )
        raise NotEnoughDataError(msg)
    path = out / files.SWEEP
    write_table(
        path,
        table,
        stage="sweep",
        config={
            "patterns": {"envelope": config.patterns.envelope, "gamma": config.patterns.gamma},
            "score": {
                "base": config.score.base,
                "day_starts_at": config.score.day_starts_at,
            },
            "sweep": {"tau": list(taus), "order": list(orders)},
        },
        inputs=[table_input(path) for path in tables.values()],
    )
    return SweepOutcome(path, table, tuple(errors))


def _count(part: IdentifiedPart, settings: Settings, config: PatternsConfig) -> _Counted:
    counts: dict[tuple[int, int], list[Counts]] = {setting: [] for setting in settings}
    for _, current, _ in part.courses(config):
        for tau in dict.fromkeys(tau for _, tau in settings):
            orders = [order for order, other in settings if other == tau]
            for order, values in ordinal_counts(np.abs(course_of(current)), orders, tau).items():
                counts[order, tau].append(values)
    return _Counted(part.rows, counts)


def _rows(
    counted: dict[str, list[_Counted]], sessions: Sessions, config: Config
) -> list[dict[str, Any]]:
    """Turn counts into divergences, motion by motion, as `score` does."""
    found = []
    base = config.score.base
    keys = [key for part in counted["baseline"][:1] for key in part.counts]
    for order, tau in keys:
        groups: dict[tuple[int, int], dict[str, list[tuple[dict[str, Any], Counts]]]] = {}
        for role, parts in counted.items():
            for part in parts:
                for row, values in zip(part.rows, part.counts[order, tau], strict=True):
                    group = groups.setdefault((row["axis"], row["motion"]), {})
                    group.setdefault(role, []).append((row, values))
        for (axis, motion), group in sorted(groups.items()):
            if "baseline" not in group:
                continue
            pool = np.stack([values for _, values in group["baseline"]])
            own = [row for row, _ in group["baseline"]]
            labels = [sessions.of_run[row["run"]] for row in own]
            if len(set(labels)) == 1:
                labels = [f"{row['run']}/{row['cycle']}" for row in own]
            jsd = {"baseline": leave_cycle_out_divergences(pool, np.asarray(labels), base)}
            if "target" in group:
                target = np.stack([values for _, values in group["target"]])
                jsd["target"] = divergences_from_pool(target, pool, base)
            for role, values_of_role in jsd.items():
                for (row, counts), value in zip(group[role], values_of_role, strict=True):
                    f_max_hz = row["reference_f_max_hz"]
                    fs_hz = row["sampling_rate_hz"]
                    found.append(
                        {
                            "role": role,
                            "run": row["run"],
                            "axis": axis,
                            "cycle": row["cycle"],
                            "motion": motion,
                            "order": order,
                            "tau": tau,
                            "n_patterns": int(counts.sum()),
                            "jsd": float(value) if math.isfinite(value) else None,
                            "tau_opt": time_delay(fs_hz, f_max_hz, order, config.patterns.gamma),
                        }
                    )
    return found
