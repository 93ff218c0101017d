"""Short recordings of small virtual robots, laid out as a logger would: for trials and the demo.

python benchmarks/nightly/cell_logs.py opamc-cell  # three robots, ten nights, one joint that wears
"""

import argparse
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from opamc_cli.config.testbed import load_testbed
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[2]
FIRST_NIGHT = date(2026, 3, 1)


def night(index: int) -> str:
    """Return the name of a night."""
    return (FIRST_NIGHT + timedelta(days=index)).isoformat()


def record(
    path: Path,
    seed: int,
    index: int,
    *,
    severity: float = 0.0,
    axis: int = 2,
    axes: int = 2,
    program: str = "cycle",
    payload_kg: float = 0.0,
    started: bool = True,
) -> Path:
    """Record two short motions, three times, of the joints of one robot in one night."""
    config = load_testbed(ROOT / "configs" / "samples.yaml")
    robot = replace(
        config.robot,
        joints=config.robot.joints[:axes],
        spread=replace(config.robot.spread, remount=False),
    )
    taught = replace(
        config.program,
        axes=tuple(range(1, axes + 1)),
        waypoints_rad=(0.0, 0.8),
        cycles=3,
        lead_s=0.3,
        dwell_s=0.2,
        payload_kg=payload_kg,
    )
    damage = {axis: replace(robot.damage, severity=severity)} if severity else {}
    made = simulate(robot, taught, seed=seed, session=index, faults=damage)
    columns = {
        f"axis{number}_{phase}": np.ascontiguousarray(signals.phases_a[:, k])
        for number, signals in made.axes.items()
        for k, phase in enumerate("abc")
    }
    columns |= {
        f"axis{number}_temperature": signals.temperature_c for number, signals in made.axes.items()
    }
    info = RunInfo(
        made.sampling_rate_hz,
        program=program,
        speed_percent=100.0,
        payload_kg=payload_kg,
        started_at=f"{night(index)}T22:00:00+00:00" if started else None,
    )
    save_run(path, info, columns)
    return path


def record_cell(folder: Path, robots: int, nights: int, worn: dict[int, list[float]]) -> Path:
    """Record a cell and write its cell.yaml.

    Parameters
    ----------
    folder
        Where to.
    robots, nights
        How many.
    worn
        Severity of axis 2 of some robots, by night.
    """
    for robot in range(robots):
        for index in range(nights):
            path = folder / "logs" / f"r{robot + 1}" / night(index) / "cycle.parquet"
            record(path, 500 + robot, index, severity=worn.get(robot, [0.0] * nights)[index])
    cell = folder / "cell.yaml"
    cell.write_text("runs: logs/{robot}/{night}/*.parquet\nbaseline: {nights: 2}\n")
    return cell


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("out", type=Path)
    out = parser.parse_args().out
    written = record_cell(out, 3, 10, {1: [0.0] * 6 + [0.4, 0.6, 0.8, 1.0]})
    written.write_text(
        "runs: logs/{robot}/{night}/*.parquet\n"
        "robots: auto\n"
        "baseline: {nights: 6}\n"
        "set: {joint.gear_ratio: 100, joint.pole_pairs: 5}\n"
        "out: nightly/\n"
    )
    print(written)
