"""Stage `verdict`: patterns, scores and features in, verdict.json out."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.config import Config
from opamc_cli.config.models import ScoreConfig
from opamc_cli.errors import ExitCode
from opamc_cli.stages.cells import cells_by_axis, session_names, spectrum_cells
from opamc_cli.stages.reasons import reasons
from opamc_cli.stages.score import (
    ALL_MOTIONS,
    FEATURES,
    SCORES,
    Key,
    PatternRows,
    read_patterns,
)
from opamc_cli.stats.decision import Judgement, Policy, judge
from opamc_cli.storage.atomic import write_text
from opamc_cli.storage.sources import RunSource, read_sources
from opamc_cli.storage.tables import SPECTRA, read_table

FILE_NAME = "verdict.json"

MAIN_SHARE = 0.5
"""Share of the change from which causes decide between changed and fault."""


@dataclass(frozen=True)
class VerdictOutcome:
    """What `run` did.

    Attributes
    ----------
    path
        The file that was written.
    verdict
        Its content.
    exit_code
        What it ends with.
    """

    path: Path
    verdict: dict[str, Any]
    exit_code: ExitCode


def run(
    baseline: Path,
    target: Path,
    scores: Path,
    features: Path,
    config: Config,
    out: Path,
    *,
    spectra: tuple[Path, Path] | None = None,
    causes: Mapping[int, Mapping[str, Any]] | None = None,
) -> VerdictOutcome:
    """Decide about every joint and write the verdict.

    Parameters
    ----------
    baseline, target
        Tables of stage `patterns`.
    scores, features
        Tables of stage `score`, made from the same two.
    config
        Section `score` is used; the verdict carries the hash of the whole.
    out
        Folder of verdict.json.
    spectra
        Spectrum tables of stage `patterns`, of the same runs; None: patterns alone decide.
    causes
        Cause of the change by axis, from closing the loop of the joint's model.

    Raises
    ------
    InputError
        If a table cannot be used.
    """
    verdict = decide(
        (read_patterns(baseline), read_patterns(target)),
        (read_sources(baseline), read_sources(target)),
        read_table(scores, "score", SCORES),
        read_table(features, "score", FEATURES),
        config,
        causes or {},
        spectra
        and (
            read_table(spectra[0], "patterns", SPECTRA),
            read_table(spectra[1], "patterns", SPECTRA),
        ),
    )
    path = out / FILE_NAME
    write_text(path, json.dumps(verdict, indent=2, allow_nan=False) + "\n")
    return VerdictOutcome(path, verdict, exit_code(verdict))


def exit_code(verdict: Mapping[str, Any]) -> ExitCode:
    """Return the exit code of a verdict: one unhealthy joint makes it 1, none judged 5."""
    states = [axis["state"] for axis in verdict["axes"]]
    if any(state in ("changed", "fault") for state in states):
        return ExitCode.UNHEALTHY
    return ExitCode.DONE if "healthy" in states else ExitCode.NOT_ENOUGH_DATA


def decide(
    patterns: tuple[Mapping[Key, PatternRows], Mapping[Key, PatternRows]],
    sources: tuple[tuple[RunSource, ...], tuple[RunSource, ...]],
    scores: pa.Table,
    features: pa.Table,
    config: Config,
    causes: Mapping[int, Mapping[str, Any]],
    spectra: tuple[pa.Table, pa.Table] | None = None,
) -> dict[str, Any]:
    """Return the content of verdict.json.

    Parameters
    ----------
    patterns, sources
        Of baseline and target.
    scores, features
        Tables of stage `score`.
    config
        Section `score` is used.
    causes
        Cause by axis.
    spectra
        Spectrum tables of baseline and target, if there are any.
    """
    cells = cells_by_axis(*patterns)
    by_spectrum = {
        axis: spectrum_cells(*spectra, axis, session_names(axis, *patterns))
        for axis in cells
        if spectra is not None
    }
    judgements = judge(cells, policy_of(config.score), by_spectrum)
    jsd = _divergences(scores)
    pooled = _pooled_features(features)
    axes = []
    for axis, judgement in judgements.items():
        cause = causes.get(axis)
        decided = _with_cause(judgement, cause, config.score)
        if decided.state == "healthy":
            cause = None
        motions = [
            {
                "motion": cell.motion,
                "order": cell.order,
                "tau": cell.tau,
                "jsd_baseline": jsd.get(("baseline", axis, cell.motion, cell.order, cell.tau), []),
                "jsd_target": jsd.get(("target", axis, cell.motion, cell.order, cell.tau), []),
            }
            for cell in cells[axis]
        ]
        runs = {
            role: [source for source in side if source.name in _runs_of(axis, part)]
            for role, side, part in zip(("baseline", "target"), sources, patterns, strict=True)
        }
        axes.append(
            {
                "axis": axis,
                "state": decided.state,
                "health_index": _finite(decided.health_index),
                "p_value": _finite(decided.p_value),
                "p_adjusted": _finite(decided.p_adjusted),
                "distance": {
                    "ratio": _finite(decided.distance_ratio),
                    "common": _finite(math.exp(decided.common_log_ratio)),
                    "effect": _finite(decided.effect),
                },
                "features": pooled.get(axis, {"delta_mu": None, "delta_var": None, "ks": None}),
                "motions": motions,
                "cause": None if cause is None else dict(cause),
                "reasons": reasons(
                    decided, cells[axis], motions, runs, cause, by_spectrum.get(axis, ())
                ),
            }
        )
    return {"axes": axes, "base": config.score.base, "config_hash": config.digest()}


def policy_of(config: ScoreConfig) -> Policy:
    """Return the decision's limits from the configuration."""
    return Policy(
        false_alarm_rate=config.false_alarm_rate,
        minimum_effect=config.minimum_effect,
        fault_effect=config.fault_effect,
        permutations=config.permutations,
        seed=config.seed,
    )


def is_excused(p_adjusted: float | None, state: str, config: ScoreConfig) -> bool:
    """Tell whether a joint is called healthy although it differs: others may differ as much."""
    return state == "healthy" and p_adjusted is not None and p_adjusted <= config.false_alarm_rate


def _with_cause(
    judgement: Judgement, cause: Mapping[str, Any] | None, config: ScoreConfig
) -> Judgement:
    """Call a change of known cause a fault only if that cause harms the joint."""
    if cause is None:
        return judgement
    if is_excused(judgement.p_adjusted, judgement.state, config):
        matters = judgement.effect >= config.minimum_effect
        return replace(judgement, state="fault") if matters and cause.get("clear") else judgement
    if judgement.state not in ("changed", "fault"):
        return judgement
    if float(cause.get("explained", cause.get("share", 1.0))) < MAIN_SHARE:
        return judgement
    if cause.get("harmless"):
        return replace(judgement, state="changed")
    # A fault is named first if there is one.
    at_fault = cause.get("origin", "joint") == "joint"
    return replace(judgement, state="fault") if at_fault else judgement


def _runs_of(axis: int, part: Mapping[Key, PatternRows]) -> set[str]:
    return {str(run) for key, rows in part.items() if key[0] == axis for run in rows.sessions}


def _divergences(scores: pa.Table) -> dict[tuple[str, int, int, int, int], list[float]]:
    found: dict[tuple[str, int, int, int, int], list[float]] = {}
    names = ["role", "axis", "motion", "order", "tau", "jsd"]
    for row in scores.select(names).to_pylist():
        if row["jsd"] is not None and math.isfinite(row["jsd"]):
            key = (row["role"], row["axis"], row["motion"], row["order"], row["tau"])
            found.setdefault(key, []).append(row["jsd"])
    return found


def _pooled_features(features: pa.Table) -> dict[int, dict[str, float | None]]:
    """Pick the features over all motions of the highest order, the thesis's better one (5.2)."""
    pooled = [row for row in features.to_pylist() if row["motion"] == ALL_MOTIONS]
    best = {row["axis"]: row for row in sorted(pooled, key=lambda row: row["order"])}
    return {
        axis: {name: _finite(row[name]) for name in ("delta_mu", "delta_var", "ks")}
        for axis, row in best.items()
    }


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
