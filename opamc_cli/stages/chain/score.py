"""Stage `score`: patterns of baseline and target in, divergences and features out (thesis 4.3)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import factorial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.decision.divergence.features import compare
from opamc_cli.decision.divergence.jensen_shannon import (
    chance_divergence,
    divergences_from_pool,
    leave_cycle_out_divergences,
)
from opamc_cli.errors import InputError
from opamc_cli.stages.chain.compared.pattern_rows import Key, PatternRows, common_keys
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import FEATURES, SCORES
from opamc_cli.storage.sources import check_comparable
from opamc_cli.storage.tables import check_current, record_at, table_input, write_table

if TYPE_CHECKING:
    from opamc_cli.stages.chain.compared.discriminants import LatentModels

FILES = (files.SCORES, files.FEATURES)
ALL_MOTIONS = -1


@dataclass(frozen=True)
class ScoreOutcome:
    """What `run` did."""

    scores_path: Path
    features_path: Path
    """With `scores_path`: the tables that were written."""
    scores: pa.Table
    features: pa.Table
    """With `scores`: their rows."""
    notes: tuple[str, ...]
    """What is worth knowing: conditions that differ, motions that one side lacks, orders with more
    possible patterns than a segment holds."""
    doubts: tuple[str, ...] = ()
    """Why what is not found changed may have been compared with something else."""


def run(
    baseline: Path,
    target: Path,
    config: Config,
    out: Path,
    *,
    models: "LatentModels | None" = None,
) -> ScoreOutcome:
    """Compare the target's patterns with the baseline's.

    Parameters
    ----------
    baseline, target
        Tables of stage `patterns`.
    config
        Section `score` is used.
    out
        Folder of the two tables.
    models
        Trained discriminants; None leaves the column `lda` empty.

    Raises
    ------
    InputError
        If a table cannot be used, the two cannot be compared, or a discriminant was trained
        under other conditions.
    """
    sides = Sides(read_side(baseline), read_side(target), config.score.day_starts_at)
    for side in (baseline, target):
        check_current(side)
    return compare_sides(sides, config, out, models=models)


def compare_sides(
    sides: Sides, config: Config, out: Path, *, models: "LatentModels | None" = None
) -> ScoreOutcome:
    """Compare the target's patterns with the baseline's, both read before; see `run`."""
    notes = check_comparable(sides.baseline.sources, sides.target.sources)
    own, other = sides.rows
    common = common_keys(own, other)
    _refuse_unequal_options(sides, may_differ=("orders",) if common else ())
    if not common:
        msg = (
            f"{sides.target.path}: has no axis, motion, order and delay in common with "
            f"{sides.baseline.path}; make both "
            "with the same configuration and identify the target by the baseline's reference"
        )
        raise InputError(msg)
    base = config.score.base
    scores = score_table(sides, base)
    features = feature_table(scores, other, base, models)
    inputs = [table_input(sides.baseline.path), table_input(sides.target.path)]
    used = config.canonical("score")
    for name, table in ((files.SCORES, scores), (files.FEATURES, features)):
        write_table(out / name, table, stage="score", config=used, inputs=inputs)
    notes += (*sides.notes(), *_missing_notes(own, other), *_short_notes(own))
    return ScoreOutcome(
        out / files.SCORES,
        out / files.FEATURES,
        scores,
        features,
        notes,
        _other_reference(sides, common),
    )


def _refuse_unequal_options(sides: Sides, may_differ: Sequence[str]) -> None:
    """Refuse tables that were made with other options, naming the first option and both values.

    Of unequal orders those in common can be compared; an envelope, an offset or frames of another
    kind make other numbers of the same current.
    """
    own, other = (record_at(side.path)["config"] for side in (sides.baseline, sides.target))
    for section in sorted(own.keys() & other.keys()):
        for key in sorted(own[section].keys() | other[section].keys()):
            values = own[section].get(key), other[section].get(key)
            if values[0] != values[1] and key not in may_differ:
                msg = (
                    f"{sides.target.path}: was made with {section}.{key} {values[1]!r} where "
                    f"{sides.baseline.path} has {values[0]!r}; make both with the same options"
                )
                raise InputError(msg)


def _other_reference(sides: Sides, common: Sequence[Key]) -> tuple[str, ...]:
    """Say where motions were told by another cycle: the first of one may be the other's second.

    Each segment has the largest frequency of its motion in the reference cycle.
    """
    for key in common:
        own, other = (rows[key].rows["f_max_hz"].astype(float)[0] for rows in sides.rows)
        if own != other and np.isfinite([own, other]).all():
            doubt = (
                f"{sides.target.path}: its motions were told by another cycle than those of "
                f"{sides.baseline.path}, and may be others of the same number; identify it with "
                "--reference, naming the baseline's motions.parquet, and make its patterns anew"
            )
            return (doubt,)
    return ()


def score_table(sides: Sides, base: float) -> pa.Table:
    """Divergence of every segment from the baseline's pool.

    A baseline segment meets the pool without its own session, or without its own cycle where
    there is one session only; a target segment meets the whole pool. `chance` is what finite,
    overlapping patterns would show by themselves, `excess` the rest.
    """
    baseline, target = sides.rows
    parts = []
    for key in common_keys(baseline, target):
        own, other = baseline[key], target[key]
        several = len(np.unique(own.sessions)) > 1
        label = own.sessions if several else own.cycles
        pool = own.counts.sum(axis=0)
        n_own = own.counts.sum(axis=1)
        _, place = np.unique(label, return_inverse=True)
        n_rest = pool.sum() - np.bincount(place, n_own)[place]
        inflation = sides.inflations[key]
        parts.append(
            _score_rows(
                "baseline",
                own,
                leave_cycle_out_divergences(own.counts, label, base),
                n_rest,
                "session" if several else "cycle",
                _chance(pool, n_own, n_rest, inflation, base),
                base,
            )
        )
        n_other = other.counts.sum(axis=1)
        parts.append(
            _score_rows(
                "target",
                other,
                divergences_from_pool(other.counts, pool, base),
                np.full(len(n_other), pool.sum()),
                "none",
                _chance(pool, n_other, np.full(len(n_other), pool.sum()), inflation, base),
                base,
            )
        )
    if not parts:
        return SCORES.empty_table()
    # to make a table of each and put these together takes most of a comparison
    columns = {
        name: pa.array(np.concatenate([part[name] for part in parts]), from_pandas=True)
        for name in SCORES.names
    }
    return pa.table(columns).cast(SCORES)


def feature_table(
    scores: pa.Table,
    target: Mapping[Key, PatternRows],
    base: float,
    models: "LatentModels | None" = None,
) -> pa.Table:
    """Δμ, Δσ² and KS of every axis and order: for each motion, and for all pooled (motion -1)."""
    columns = {
        name: scores[name].to_numpy(zero_copy_only=False)
        for name in ("role", "axis", "motion", "order", "jsd")
    }
    speeds: dict[tuple[int, int], list[float]] = {}
    for (axis, motion, _, _), part in target.items():
        speeds.setdefault((axis, motion), []).append(float(np.median(part.rows["f_max_hz"])))
    rows = []
    for axis in np.unique(columns["axis"]).tolist():
        of_axis = columns["axis"] == axis
        for order in np.unique(columns["order"][of_axis]).tolist():
            chosen = of_axis & (columns["order"] == order)
            motions = np.unique(columns["motion"][chosen]).tolist()
            for motion in [ALL_MOTIONS, *motions]:
                mask = chosen & ((columns["motion"] == motion) | (motion == ALL_MOTIONS))
                jsd = {
                    role: columns["jsd"][mask & (columns["role"] == role)]
                    for role in ("baseline", "target")
                }
                jsd = {role: values[np.isfinite(values)] for role, values in jsd.items()}
                features = compare(jsd["baseline"], jsd["target"])
                used = motions if motion == ALL_MOTIONS else [motion]
                row: dict[str, Any] = {
                    "axis": axis,
                    "motion": motion,
                    "order": order,
                    "delta_mu": _known(features.delta_mu),
                    "delta_var": _known(features.delta_var),
                    "ks": _known(features.ks),
                    "n_baseline": len(jsd["baseline"]),
                    "n_target": len(jsd["target"]),
                    "f_max_hz": max(max(speeds[axis, each]) for each in used),
                    "lda": None,
                    "base": base,
                }
                if models is not None and motion == ALL_MOTIONS:
                    row["lda"] = models.project(row)
                rows.append(row)
    return pa.Table.from_pylist(rows, schema=FEATURES)


def _score_rows(
    role: str,
    part: PatternRows,
    jsd: npt.NDArray[np.float64],
    n_pool: npt.NDArray[np.float64],
    left_out: str,
    chance: npt.NDArray[np.float64],
    base: float,
) -> dict[str, npt.NDArray[Any]]:
    n = len(jsd)
    return {
        "role": np.full(n, role),
        **{
            name: part.rows[name]
            for name in ("run", "axis", "cycle", "motion", "segment", "order", "tau", "n_patterns")
        },
        "n_pool": n_pool.astype(np.int64),
        "left_out": np.full(n, left_out),
        "jsd": jsd,
        "chance": chance,
        "excess": jsd - chance,
        "base": np.full(n, base),
    }


def _chance(
    pool: npt.NDArray[np.float64],
    n_segment: npt.NDArray[np.float64],
    n_pool: npt.NDArray[np.float64],
    inflation: float,
    base: float,
) -> npt.NDArray[np.float64]:
    result = np.full(len(n_segment), np.nan)
    known = n_pool > 0
    if known.any():
        result[known] = chance_divergence(
            pool, n_segment[known] / inflation, n_pool[known] / inflation, base
        )
    return result


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _missing_notes(
    baseline: Mapping[Key, PatternRows], target: Mapping[Key, PatternRows]
) -> Sequence[str]:
    notes = []
    have = {role: {key[:2] for key in side} for role, side in (("b", baseline), ("t", target))}
    for axis, motion in sorted(have["b"] - have["t"]):
        notes.append(f"axis {axis}: motion {motion} of the baseline does not occur in the target")
    for axis, motion in sorted(have["t"] - have["b"]):
        notes.append(f"axis {axis}: motion {motion} of the target does not occur in the baseline")
    return notes


def _short_notes(baseline: Mapping[Key, PatternRows]) -> Sequence[str]:
    shortest: dict[int, tuple[float, int]] = {}
    for (axis, _, order, _), part in baseline.items():
        typical = float(np.median(part.counts.sum(axis=1)))
        shortest[order] = min(shortest.get(order, (np.inf, axis)), (typical, axis))
    return [
        f"order {order}: axis {axis} has segments of {typical:.0f} patterns for "
        f"{factorial(order)} possible ones; its divergence is mostly chance, use a lower order"
        for order, (typical, axis) in sorted(shortest.items())
        if typical < factorial(order)
    ]
