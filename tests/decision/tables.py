"""Pattern tables with the counts of a made-up fleet."""

import hashlib
from pathlib import Path

import pyarrow as pa

from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.schemas.tables import PATTERNS
from opamc_cli.storage.sources import RunSource, sources_record
from opamc_cli.storage.tables import write_table
from tests.decision.fleet import Fleet, cells


def write_patterns(folder: Path, plan: Fleet, seed: int, **info) -> tuple[Path, Path]:
    """Write baseline/patterns.parquet and target/patterns.parquet."""
    drawn = cells(plan, seed)
    paths = []
    for role, n_sessions, month in (
        ("baseline", plan.n_baseline, 1),
        ("target", plan.n_target, 3),
    ):
        rows = []
        for axis, own in drawn.items():
            for cell in own:
                counts = cell.cycles if role == "baseline" else cell.target_cycles
                for place, row in enumerate(counts):
                    session, cycle = divmod(place, plan.n_cycles)
                    rows.append(
                        {
                            "run": f"{role}-{session}",
                            "axis": axis,
                            "cycle": cycle,
                            "motion": cell.motion,
                            "segment": cycle * plan.n_motions + cell.motion,
                            "start": 0,
                            "stop": 1000,
                            "order": cell.order,
                            "tau": cell.tau,
                            "gamma": 2.0,
                            "f_max_hz": 60.0 + cell.motion,
                            "n_patterns": int(row.sum()),
                            "n_masked": 0,
                            "counts": row.astype(int).tolist(),
                            "signal": "phases",
                            "temperature_c": None,
                        }
                    )
        sources = [
            RunSource(
                name=f"{role}-{session}",
                path=folder / "runs" / f"{role}-{session}.parquet",
                sha256=hashlib.sha256(f"{folder}{role}-{session}".encode()).hexdigest(),
                n_samples=100_000,
                info=RunInfo(
                    **{
                        "sampling_rate_hz": 2048.0,
                        "started_at": f"2026-{month:02}-{session + 1:02}T06:00:00+00:00",
                        **(info if role == "target" else {}),
                    }
                ),
            )
            for session in range(n_sessions)
        ]
        path = folder / role / "patterns.parquet"
        write_table(
            path,
            pa.Table.from_pylist(rows, schema=PATTERNS),
            stage="patterns",
            config={"patterns": {}},
            inputs=[],
            extra=sources_record(sources, path.parent),
        )
        paths.append(path)
    return paths[0], paths[1]
