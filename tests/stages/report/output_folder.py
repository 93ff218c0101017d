"""A made-up output folder with every file that a report reads, columns and keys as the chain's."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.decision.divergence.features import compare
from opamc_cli.decision.divergence.jensen_shannon import (
    divergences_from_pool,
    leave_cycle_out_divergences,
)
from opamc_cli.signal.ordinal.patterns import ordinal_counts
from opamc_cli.signal.transform.analytic import clarke, envelope
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.schemas.tables import (
    FEATURES,
    MOTIONS,
    ORDER_SPECTRUM,
    PATTERNS,
    RESIDUALS,
    SCORES,
)
from opamc_cli.storage.sources import RunSource, sources_record
from opamc_cli.storage.tables import table_input, write_table

RATE_HZ = 1024.0
MOVE = 900
PAUSE = 300
N_MOTIONS = 4
SPEEDS_HZ = (70.0, 70.0, 55.0, 90.0)
ORDERS = (4, 5)
TAU = 4


@dataclass(frozen=True)
class Plan:
    """What to make up."""

    n_axes: int = 3
    n_runs: int = 2
    n_cycles: int = 3
    faulty: int | None = 3
    names: tuple[str, str] = ("normal", "fault")
    signal: str = "phases"


def make(out: Path, plan: Plan = Plan(), seed: int = 0) -> Path:
    """Write runs beside `out` and tables, verdict and loop into it."""
    rng = np.random.default_rng(seed)
    motions: dict[str, list[dict[str, Any]]] = {}
    patterns: dict[str, list[dict[str, Any]]] = {}
    for role, name in zip(("baseline", "target"), plan.names, strict=True):
        sources, motions[role], patterns[role] = [], [], []
        for index in range(plan.n_runs):
            run_name = f"{name}-{index}"
            path = out.parent / role / f"run{index}.parquet"
            columns = _run(rng, plan, faulty=role == "target")
            started = f"2026-0{1 if role == 'baseline' else 3}-1{index}T06:00:00+00:00"
            save_run(
                path,
                RunInfo(
                    RATE_HZ,
                    robot="cell 4",
                    program="pick",
                    speed_percent=50.0,
                    payload_kg=1.0,
                    started_at=started,
                ),
                columns,
            )
            with Run(path, run_name) as run:
                sources.append(RunSource.of(run))
            _rows(motions[role], patterns[role], run_name, columns, plan, role, index)
        _write(out / role / "motions.parquet", motions[role], MOTIONS, "identify", sources)
        _write(out / role / "patterns.parquet", patterns[role], PATTERNS, "patterns", sources)
    scores, features, verdict = _score(patterns, plan)
    _write_plain(out / "scores.parquet", scores, "score", SCORES)
    _write_plain(out / "features.parquet", features, "score", FEATURES)
    (out / "verdict.json").write_text(json.dumps(verdict))
    return out


def add_loop(out: Path, axis: int = 3, seed: int = 0) -> None:
    """Write loop.json and its two tables."""
    rng = np.random.default_rng(seed)
    n = 20_000
    time = np.arange(n) / 1000.0
    speed = np.where(np.sin(time) > 0, 0.6, -0.4)
    angle = np.cumsum(speed) / 1000.0
    noise = 0.02 * rng.standard_normal(n)
    ripple = 0.06 * np.sin(200 * angle) * (1 + speed)
    order = np.arange(0.0, 32.0, 0.02)
    floor = 0.002 + 0.001 * rng.random(order.size)
    table = {
        "axis": np.full(n, axis, np.int16),
        "time_s": time,
        "position_rad": angle,
        "velocity_rad_s": speed,
        "residual_before_a": ripple + noise,
        "residual_after_a": noise,
    }
    _write_plain(out / "residuals.parquet", table, "model", RESIDUALS)
    peak = 0.05 * np.exp(-(((order - 2) / 0.03) ** 2)) + 0.02 * np.exp(
        -(((order - 14) / 0.03) ** 2)
    )
    _write_plain(
        out / "order_spectrum.parquet",
        {
            "axis": np.full(order.size, axis, np.int16),
            "order": order,
            "before_a": floor + peak,
            "after_a": floor,
        },
        "model",
        ORDER_SPECTRUM,
    )
    step = {
        "effect": "ripple",
        "domain": "motor-angle",
        "parameters": {"order": 2.0},
        "interpretation": "kinematic error, twice per wave generator turn",
        "gain": 0.61,
        "p_value": 3e-6,
        "decoy_gain": 0.02,
        "ties": [],
        "rmse_before_a": 0.065,
        "rmse_after_a": 0.031,
        "curve": {
            "covariate": "angle within the period",
            "unit": "turns",
            "x": (phase := np.linspace(0.0, 1.0, 40)).tolist(),
            "residual_a": (0.06 * np.cos(2 * np.pi * phase) + 0.002).tolist(),
            "named_a": (0.06 * np.cos(2 * np.pi * phase)).tolist(),
        },
    }
    loop = {
        "axes": [
            {
                "axis": axis,
                "declared": ["inertia", "gravity", "coulomb", "viscous"],
                "sealed": ["fault-1 cycle 2"],
                "before": {"rmse_a": 0.065, "r2": 0.91},
                "steps": [
                    step,
                    {
                        **step,
                        "parameters": {"order": 14.0},
                        "gain": 0.2,
                        "ties": ["elasticity"],
                        "separating_experiment": "move at two more speeds",
                        "interpretation": "unknown periodic source, order 14",
                        "rmse_before_a": 0.031,
                        "rmse_after_a": 0.021,
                    },
                ],
                "after": {"rmse_a": 0.021, "r2": 0.99},
                "floor_a": 0.02,
                "explained_share": 0.97,
                "rejected": [{"effect": "stribeck", "why": "held-out gain 0.2 %, 1 % is needed"}],
                "untestable": [{"effect": "thermal_viscous", "why": "no temperature channel"}],
                "verdict": "closed",
            }
        ]
    }
    (out / "loop.json").write_text(json.dumps(loop))


def _run(rng: np.random.Generator, plan: Plan, *, faulty: bool) -> dict[str, Any]:
    columns = {}
    shape = np.minimum(1.0, np.minimum(np.arange(MOVE), np.arange(MOVE)[::-1]) / 150.0)
    for axis in range(1, plan.n_axes + 1):
        speed = np.zeros(PAUSE)
        load = np.zeros(PAUSE)
        for _ in range(plan.n_cycles):
            for motion in range(N_MOTIONS):
                sign = 1.0 if motion % 2 == 0 else -1.0
                speed = np.concatenate([speed, sign * SPEEDS_HZ[motion] * shape, np.zeros(PAUSE)])
                weight = (2.0 + 0.3 * axis + 0.6 * motion) * (0.4 + 0.6 * shape)
                load = np.concatenate([load, weight, np.zeros(PAUSE)])
        angle = 2 * np.pi * np.cumsum(speed) / RATE_HZ
        amplitude = load * (1 + 0.06 * np.sin(2 * angle / 5 + axis))
        if faulty and axis == plan.faulty:
            amplitude *= 1 + 0.25 * np.maximum(np.sin(2.02 * angle), 0) ** 3
        amplitude = amplitude + 0.04 * rng.standard_normal(amplitude.size)
        if plan.signal == "reported":
            columns[f"axis{axis}_current"] = (np.sign(speed) * amplitude).astype(np.float32)
            columns[f"axis{axis}_velocity"] = speed / 10
            continue
        for phase, shift in zip("abc", (0, 1, 2), strict=True):
            current = amplitude * np.cos(angle - 2 * np.pi * shift / 3)
            columns[f"axis{axis}_{phase}"] = (
                current + 0.02 * rng.standard_normal(current.size)
            ).astype(np.float32)
    return columns


def _rows(
    motions: list[dict[str, Any]],
    patterns: list[dict[str, Any]],
    run: str,
    columns: dict[str, Any],
    plan: Plan,
    role: str,
    index: int,
) -> None:
    for axis in range(1, plan.n_axes + 1):
        if plan.signal == "reported":
            whole = np.abs(columns[f"axis{axis}_current"])
        else:
            whole = envelope(clarke(*(columns[f"axis{axis}_{p}"] for p in "abc")))
        for segment in range(plan.n_cycles * N_MOTIONS):
            cycle, motion = divmod(segment, N_MOTIONS)
            start = PAUSE + segment * (MOVE + PAUSE)
            stop = start + MOVE
            shared = {
                "run": run,
                "axis": axis,
                "segment": segment,
                "start": start,
                "stop": stop,
                "cycle": cycle,
                "motion": motion,
                "f_max_hz": SPEEDS_HZ[motion],
                "signal": plan.signal,
                "temperature_c": None,
            }
            motions.append(
                shared
                | {
                    "sampling_rate_hz": RATE_HZ,
                    "direction": 1 if motion % 2 == 0 else -1,
                    "variance": float(np.mean(whole[start:stop] ** 2) / 2),
                    "edge": False,
                    "kind": "motion",
                    "similarity": 0.999,
                    "lag": 0,
                    "reference": role == "baseline" and index == 0 and cycle == 0,
                    "reference_f_max_hz": SPEEDS_HZ[motion],
                    "reference_samples": MOVE,
                }
            )
            for order, counts in ordinal_counts(whole[start:stop], ORDERS, TAU).items():
                patterns.append(
                    shared
                    | {
                        "order": order,
                        "tau": TAU,
                        "gamma": 2.0,
                        "n_patterns": int(counts.sum()),
                        "n_masked": 0,
                        "counts": counts.tolist(),
                    }
                )


def _score(patterns: dict[str, list[dict[str, Any]]], plan: Plan) -> tuple[Any, Any, Any]:
    scores: list[dict[str, Any]] = []
    features: list[dict[str, Any]] = []
    axes = []
    for axis in range(1, plan.n_axes + 1):
        entry: dict[str, Any] = {"axis": axis, "motions": []}
        for order in ORDERS:
            pooled: dict[str, list[float]] = {"baseline": [], "target": []}
            for motion in range(N_MOTIONS):
                rows = {
                    role: [
                        r
                        for r in patterns[role]
                        if (r["axis"], r["order"], r["motion"]) == (axis, order, motion)
                    ]
                    for role in pooled
                }
                counts = {role: np.array([r["counts"] for r in rows[role]]) for role in rows}
                cycle = [10 * int(r["run"][-1]) + r["cycle"] for r in rows["baseline"]]
                jsd = {
                    "baseline": leave_cycle_out_divergences(counts["baseline"], cycle),
                    "target": divergences_from_pool(counts["target"], counts["baseline"]),
                }
                for role in rows:
                    pooled[role] += jsd[role].tolist()
                    for row, value in zip(rows[role], jsd[role], strict=True):
                        keys = ("run", "axis", "cycle", "motion", "order", "tau", "n_patterns")
                        scores.append(
                            {"role": role} | {k: row[k] for k in keys} | {"jsd": float(value)}
                        )
                if order == max(ORDERS):
                    entry["motions"].append(
                        {
                            "motion": motion,
                            "order": order,
                            "tau": TAU,
                            "jsd_baseline": jsd["baseline"].tolist(),
                            "jsd_target": jsd["target"].tolist(),
                        }
                    )
            found = compare(pooled["baseline"], pooled["target"])
            values = {"delta_mu": found.delta_mu, "delta_var": found.delta_var, "ks": found.ks}
            features.append(
                {
                    "axis": axis,
                    "motion": -1,
                    "order": order,
                    **values,
                    "n_baseline": len(pooled["baseline"]),
                    "n_target": len(pooled["target"]),
                    "lda": None,
                }
            )
            entry["features"] = values
            entry["health_index"] = values["delta_mu"] / float(np.std(pooled["baseline"]))
        bad = axis == plan.faulty
        entry |= {
            "state": "fault" if bad else "healthy",
            "p_value": 2.1e-5 if bad else 0.4,
            "cause": None,
            "reasons": [
                "order 5: mean divergence 0.31 against 0.06 in the baseline",
                "all four motions changed",
            ]
            if bad
            else [],
        }
        if bad:
            entry["cause"] = {
                "effect": "ripple",
                "parameters": {"order": 2.02},
                "interpretation": "flexspline tooth damage, 2(N+1)/N per motor turn",
                "share": 0.83,
            }
        axes.append(entry)
    return _columns(scores), _columns(features), {"axes": axes, "config_hash": "0" * 64}


def _columns(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    return {name: [row[name] for row in rows] for name in rows[0]}


def _write(
    path: Path, rows: list[dict[str, Any]], schema: pa.Schema, stage: str, sources: list[RunSource]
) -> None:
    write_table(
        path,
        pa.Table.from_pylist(rows, schema=schema),
        stage=stage,
        config={stage: {}, "patterns": {"envelope": "auto"}},
        inputs=[table_input(source.path) for source in sources],
        extra=sources_record(sources, path.parent),
    )


def _write_plain(path: Path, columns: dict[str, Any], stage: str, schema: pa.Schema) -> None:
    size = len(next(iter(columns.values())))
    blank = {field.name: "" if field.type == pa.string() else 2 for field in schema}
    columns = {name: columns.get(name, [value] * size) for name, value in blank.items()}
    table = pa.table({f.name: pa.array(columns[f.name], f.type) for f in schema}, schema=schema)
    write_table(path, table, stage=stage, config={"score": {"base": 2.0}}, inputs=[])
