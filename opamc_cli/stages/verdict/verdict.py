"""Stage `verdict`: both sides' tables and their scores in, verdict.json out."""

import json
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli import __version__
from opamc_cli.config import Config
from opamc_cli.decision.judge import Bundle
from opamc_cli.decision.witnesses.changed_size import changed_a
from opamc_cli.errors import ExitCode
from opamc_cli.joint.change.search import SMALLEST_WARMTH_C
from opamc_cli.stages.chain.compared.pattern_rows import Key, PatternRows
from opamc_cli.stages.chain.compared.side import Side
from opamc_cli.stages.chain.score import ALL_MOTIONS, ScoreOutcome
from opamc_cli.stages.recordings.sessions import Sessions, started
from opamc_cli.stages.verdict.agreement.common import not_sure
from opamc_cli.stages.verdict.agreement.exchanged_joints import exchanged_joints
from opamc_cli.stages.verdict.agreement.unjudged import with_reasons
from opamc_cli.stages.verdict.decision import Decided
from opamc_cli.stages.verdict.findings import NOTHING_FOUND, Findings
from opamc_cli.stages.verdict.state import (
    among_siblings,
    believed,
    of_friction,
    own_friction,
    with_cause,
)
from opamc_cli.stages.verdict.wording.brief import brief
from opamc_cli.stages.verdict.wording.reasons import is_excused, reasons
from opamc_cli.storage.files.atomic import write_text
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.schemas import files
from opamc_cli.storage.sources import RunSource, current_unit, other_conditions

SCHEMA_VERSION = 1

Divergences = dict[tuple[str, int, int, int, int], list[float]]
"""By role, axis, motion, order and delay."""


@dataclass(frozen=True)
class VerdictOutcome:
    """What `write` did."""

    path: Path
    """The file that was written."""
    verdict: dict[str, Any]
    """Its content."""
    exit_code: ExitCode
    """What it ends with."""


def write(
    decided: Decided,
    scored: ScoreOutcome,
    config: Config,
    out: Path,
    found: Findings = NOTHING_FOUND,
    head: Mapping[str, Any] | None = None,
) -> VerdictOutcome:
    """Write the verdict.

    Parameters
    ----------
    decided
        The decision.
    scored
        Divergences and features of the same tables.
    config
        The verdict carries the hash of the whole.
    out
        Folder of verdict.json.
    found
        From the recordings: causes, empty where one was sought in vain, and joints that cannot be
        judged.
    head
        What the verdict says besides its axes; see `header`.
    """
    judged = content(decided, scored, config, found.causes, found.friction)
    unsure = decided.with_files(not_sure(judged, config.score, found.foreign))
    crossed = exchanged_joints(decided.sides, decided.target_runs(), judged)
    verdict = with_reasons(judged, {**unsure, **crossed, **found.unjudged}) | dict(head or {})
    path = out / files.VERDICT
    write_text(path, json.dumps(verdict, indent=2, allow_nan=False) + "\n")
    return VerdictOutcome(path, verdict, exit_code(verdict))


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


def exit_code(verdict: Mapping[str, Any]) -> ExitCode:
    """Return the exit code of a verdict: an unhealthy joint makes it 1, else a doubtful one 5."""
    states = {axis["state"] for axis in verdict["axes"]}
    if states & {"changed", "fault"}:
        return ExitCode.UNHEALTHY
    excused = any(axis["excused"] for axis in verdict["axes"])
    sure = states == {"healthy"} and not excused
    return ExitCode.DONE if sure else ExitCode.NOT_ENOUGH_DATA


def content(
    decided: Decided,
    scored: ScoreOutcome,
    config: Config,
    causes: Mapping[int, Mapping[str, Any]],
    friction: Mapping[int, float],
) -> dict[str, Any]:
    """Return the content of verdict.json."""
    own = own_friction(friction, config.score.fault_effect)
    jsd = _divergences(scored.scores)
    pooled = _pooled_features(scored.features)
    sides = (decided.sides.baseline, decided.sides.target)
    unit = current_unit([source for side in sides for source in side.sources])
    unlike = other_conditions(*(side.sources for side in sides))
    warmer = {axis: _warmer_c(axis, *decided.sides.rows) for axis in decided.judgements}
    axes = []
    for axis, judgement in decided.judgements.items():
        in_vain = causes.get(axis) == {}
        cause = believed(judgement, causes.get(axis) or None, config.score)
        cause = among_siblings(axis, cause, decided.judgements, warmer)
        if axis in own and is_excused(judgement, config.score):
            cause, judgement = (
                of_friction(*own[axis], judgement.p_value),
                replace(judgement, state="fault"),
            )
        final = with_cause(judgement, cause, config.score, len(decided.judgements))
        if final.state == "healthy":
            cause = None
        if final.state == "insufficient-data":
            final = replace(final, health_index=math.nan, p_value=math.nan, p_adjusted=math.nan)
        bundle = decided.bundles[axis]
        motions = _motions(axis, bundle, jsd)
        runs = _compared(axis, decided)
        lacking = _not_compared(axis, decided)
        which = decided.sessions_at_fault(axis)
        excused = is_excused(final, config.score)
        others = sum(math.isfinite(one.p_value) for one in decided.judgements.values()) - 1
        said = reasons(
            *(final, bundle, motions, runs, cause, config.score),
            in_vain=in_vain, siblings=others, warmer_c=warmer[axis],
        )  # fmt: skip
        files = decided.files_apart(axis)
        for told in (files, which):  # after what the state does not tell
            if told:
                said.insert(int(excused), told)
        axes.append(
            {
                "axis": axis,
                "state": final.state,
                "excused": excused,
                **({"session": decided.named(axis)} if axis in decided.alone else {}),
                **({"not_compared": lacking} if lacking else {}),
                **({"warmer_c": warmer[axis]} if warmer[axis] else {}),
                "health_index": _finite(final.health_index),
                "p_value": _finite(final.p_value),
                "p_adjusted": _finite(final.p_adjusted),
                "witnesses": {name: _finite(p) for name, p in final.witnesses.items()},
                "distance": {
                    "ratio": _finite(final.distance_ratio),
                    "common": _finite(math.exp(final.common_log_ratio)),
                    "allowed": _finite(math.exp(final.allowed_log_ratio)),
                    "effect": _finite(final.effect),
                    "changed_a": _finite(changed_a(bundle.witnesses)),
                },
                "features": pooled.get(axis, {"delta_mu": None, "delta_var": None, "ks": None}),
                "motions": motions,
                "cause": None if cause is None else dict(cause),
                "brief": brief(
                    *(final, bundle, cause, unit, which or files), in_vain=in_vain, unlike=unlike
                ),
                "reasons": said,
            }
        )
    return {
        "axes": axes,
        **{
            role: _summary(side, sessions)
            for role, side, sessions in zip(
                ("baseline", "target"), sides, decided.sides.sessions, strict=True
            )
        },
        "base": config.score.base,
        "config_hash": config.digest(),
    }


def _summary(side: Side, sessions: Sessions) -> dict[str, Any]:
    """Say which runs a side is of, how many sessions they make, and from when to when."""
    times = sorted(t for s in side.sources if (t := started(s.info.started_at)) is not None)
    return {
        "runs": [source.name for source in side.sources],
        "sessions": len(sessions),
        "sessions_by": list(sessions.told_by),
        "from": times[0].isoformat() if times else None,
        "to": times[-1].isoformat() if times else None,
    }


def _runs_of(axis: int, part: Mapping[Key, PatternRows]) -> set[str]:
    return {str(run) for key, rows in part.items() if key[0] == axis for run in rows.runs}


def _warmer_c(
    axis: int, before: Mapping[Key, PatternRows], after: Mapping[Key, PatternRows]
) -> float | None:
    """Return how much warmer a joint was than ever in its baseline; None where nothing tells."""
    usual, now = (
        np.concatenate(
            [[], *(one.rows["temperature_c"] for key, one in part.items() if key[0] == axis)]
        ).astype(float)
        for part in (before, after)
    )
    usual, now = usual[np.isfinite(usual)], now[np.isfinite(now)]
    if not usual.size or not now.size:
        return None
    warmer = float(np.mean(now) - np.mean(usual))
    usual_too = usual.min() <= np.mean(now) <= usual.max() or abs(warmer) < SMALLEST_WARMTH_C
    return 0.0 if usual_too else warmer


def _motions(axis: int, bundle: Bundle, jsd: Divergences) -> list[dict[str, Any]]:
    """Return the divergences of both sides' segments by motion, order and delay."""
    return [
        {
            "motion": cell.motion,
            "order": cell.order,
            "tau": cell.tau,
            **{
                f"jsd_{role}": jsd.get((role, axis, cell.motion, cell.order, cell.tau), [])
                for role in ("baseline", "target")
            },
        }
        for cell in bundle.cells
    ]


def _compared(axis: int, decided: Decided) -> dict[str, list[RunSource]]:
    """Return, by role, the recordings by which an axis is judged."""
    of_both = (decided.baseline_sources(axis), decided.target_sources(axis))
    sides = zip(("baseline", "target"), of_both, decided.sides.rows, strict=True)
    return {
        role: [source for source in sources if source.name in there]
        for role, sources, rows in sides
        for there in [_runs_of(axis, rows)]
    }


def _not_compared(axis: int, decided: Decided) -> dict[str, list[str]]:
    """Return, by role, the runs of a side that have no part in what is said of an axis."""
    found, sides = {}, decided.sides
    held = {source.name for source in (*decided.baseline_sources(axis), *sides.target.sources)}
    for role, side, rows in zip(
        ("baseline", "target"), (sides.baseline, sides.target), sides.rows, strict=True
    ):
        there = _runs_of(axis, rows) & held
        found[role] = [source.name for source in side.sources if source.name not in there]
    return {role: names for role, names in found.items() if names}


def _divergences(scores: pa.Table) -> Divergences:
    found: Divergences = {}
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
