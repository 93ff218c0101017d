"""Reported current of slow logs: whether every axis is judged, and how well.

Virtual robots run their program once a recording, from edge to edge, without standing still
between its motions; the drive reports torque current and position. Three healthy recordings are
held against three of the same robot, healthy or with one damaged joint. Two plain rivals are given
the same motions: how far the sides' mean courses lie apart, and the logarithms of three sizes (root
mean square, that of successive differences, mean), over what the baseline's recordings differ by.

    python benchmarks/decision/slow_logs.py --quick
    python benchmarks/decision/slow_logs.py --seeds 40:52
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import rankdata

from opamc_cli.config import load_config
from opamc_cli.config.testbed import load_testbed
from opamc_cli.errors import OpamcError
from opamc_cli.stages.chain import score
from opamc_cli.stages.chain.compared.side import Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.verdict import verdict
from opamc_cli.stages.verdict.decision import decide
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.schemas import files
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[2]
FINE_HZ = 500.0
RATES_HZ = (25.0, 100.0, 125.0)
SPEEDS_PERCENT = (5.0, 20.0, 100.0)
SEVERITIES = (0.0, 0.5, 1.0)
AXES = (1, 2, 3, 4, 5, 6)
SESSIONS = 3
RIVALS = {
    "course": (files.PROFILES, "current_a"),
    "sizes": (files.AMPLITUDES, "log_amplitude"),
}


def record(seed: int, speed_percent: float) -> dict[tuple[float, int], dict]:
    """Return the channels at `FINE_HZ` by severity and session; sessions count over both sides."""
    config = load_testbed(ROOT / "configs" / "testbed.yaml")
    spread = replace(config.robot.spread, temperature_c=5.0, sensor_gain=0.01)
    robot = replace(config.robot, spread=spread)
    program = replace(
        config.program,
        order="together",
        cycles=1,
        lead_s=0.0,
        dwell_s=0.0,
        dwell_jitter_s=0.0,
        speed_percent=speed_percent,
    )
    faulty = AXES[seed % len(AXES)]
    found = {}
    for session in range(2 * SESSIONS):
        for severity in SEVERITIES if session >= SESSIONS else (0.0,):
            recording = simulate(
                robot,
                program,
                seed=seed,
                session=session,
                axes=[faulty] if severity else AXES,
                faults={faulty: replace(robot.damage, severity=severity)} if severity else {},
                sampling_rate_hz=FINE_HZ,
            )
            found[severity, session] = {
                axis: (signals.reported_a, signals.position_rad)
                for axis, signals in recording.axes.items()
            }
    return found


def judged(channels: dict, rate_hz: float, folder: Path) -> dict:
    """Return the verdict's axes by severity, and how many recordings failed."""
    step = round(FINE_HZ / rate_hz)
    for (severity, session), axes in channels.items():
        side = "baseline" if session < SESSIONS else f"target-{severity:g}"
        columns = {}
        for axis, (current, position) in axes.items():
            columns[f"axis{axis}_current"] = np.ascontiguousarray(current[::step])
            columns[f"axis{axis}_position"] = np.ascontiguousarray(position[::step])
        info = RunInfo(sampling_rate_hz=rate_hz, session=str(session))
        save_run(folder / side / f"{session}.parquet", info, columns)
    config = load_config(None, ["joint.explain=false"])
    baseline = run_chain([folder / "baseline"], config, folder / "out" / "baseline")
    found = {}
    for severity in SEVERITIES:
        name = f"target-{severity:g}"
        out = folder / "out" / name
        target = run_chain([folder / name], config, out, reference=baseline.motions)
        sides = Sides(read_side(baseline.patterns), read_side(target.patterns))
        scored = score.compare_sides(sides, config, out)
        written = verdict.write(decide(sides, config), scored, config, out)
        errors = (*baseline.errors, *target.errors)
        axes = {a["axis"]: a for a in written.verdict["axes"]}
        found[severity] = (axes, errors, plain_distances(sides))
    return found


def plain_distances(sides: Sides) -> dict[str, dict[int, float]]:
    """Distance of both sides' means by rival and axis, over the baseline's own scatter."""
    found: dict[str, dict[int, float]] = {}
    for rival, (file_name, column) in RIVALS.items():
        by_side: list[dict[int, dict[str, dict[int, list[float]]]]] = []
        for side in (sides.baseline, sides.target):
            rows: dict[int, dict[str, dict[int, list[float]]]] = {}
            for row in side.witnesses[file_name].to_pylist():
                of_run = rows.setdefault(row["axis"], {}).setdefault(row["run"], {})
                of_run[row["motion"]] = row[column]
            by_side.append(rows)
        found[rival] = {}
        for axis in by_side[0].keys() & by_side[1].keys():
            runs = [list(rows[axis].values()) for rows in by_side]
            motions = sorted(set.intersection(*(set(run) for side in runs for run in side)))
            own, other = (
                np.array([np.concatenate([run[m] for m in motions]) for run in side])
                for side in runs
            )
            apart = own.mean(axis=0) - other.mean(axis=0)
            found[rival][axis] = float(np.sqrt((apart**2).mean() / own.var(axis=0, ddof=1).mean()))
    return found


def auc(healthy: list[float], faulty: list[float]) -> float:
    """Probability that a faulty joint's p is below a healthy one's."""
    ranks = rankdata([*healthy, *faulty])[len(healthy) :]
    n = len(faulty)
    return 1 - (float(ranks.sum()) - n * (n + 1) / 2) / (n * len(healthy))


def main() -> None:
    """Print one row per speed and rate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="0:8")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    first, last = (int(part) for part in arguments.seeds.split(":"))
    seeds = range(first, first + 1 if arguments.quick else last)
    rivals = ",".join(f"{rival} AUC {s:g}" for rival in RIVALS for s in SEVERITIES[1:])
    print(
        "speed %,rate Hz,axes,not judged,failed,false alarms,AUC 0.5,AUC 1,found 0.5,found 1,"
        + rivals
    )
    for speed in SPEEDS_PERCENT:
        rows: dict[float, list] = {rate: [] for rate in RATES_HZ}
        for seed in seeds:
            channels = record(seed, speed)
            for rate in RATES_HZ:
                with tempfile.TemporaryDirectory() as folder:
                    try:
                        rows[rate].append((seed, judged(channels, rate, Path(folder))))
                    except OpamcError as error:
                        print(f"seed {seed}, {speed:g} %, {rate:g} Hz: {error}")
        for rate, results in rows.items():
            print(row(speed, rate, results, len(seeds)))


def row(speed: float, rate: float, results: list, n_seeds: int) -> str:
    """Summarise one speed and rate."""
    healthy, n_unjudged, n_failed, alarms = [], 0, n_seeds - len(results), 0
    faulty: dict[float, list[float]] = {severity: [] for severity in SEVERITIES[1:]}
    found: dict[float, int] = dict.fromkeys(SEVERITIES[1:], 0)
    plain: dict[tuple[str, float], list[float]] = {}
    for seed, by_severity in results:
        bad = AXES[seed % len(AXES)]
        for severity, (_, _, distances) in by_severity.items():
            for rival, of_axis in distances.items():
                chosen = [bad] if severity else AXES
                # as p-values: the smaller, the worse
                own = [-of_axis[axis] for axis in chosen if axis in of_axis]
                plain.setdefault((rival, severity), []).extend(own)
        axes, errors, _ = by_severity[0.0]
        n_failed += len(errors)
        for axis in AXES:
            p = axes.get(axis, {}).get("p_value")
            n_unjudged += p is None
            if p is not None:
                healthy.append(p)
            alarms += axes.get(axis, {}).get("state") in ("changed", "fault")
        for severity in SEVERITIES[1:]:
            axis = by_severity[severity][0].get(bad, {})
            faulty[severity].append(1.0 if axis.get("p_value") is None else axis["p_value"])
            found[severity] += axis.get("state") in ("changed", "fault")
    scores = ",".join(f"{auc(healthy, faulty[s]):.3f}" for s in faulty) if healthy else ","
    shares = ",".join(f"{found[s]}/{len(results)}" for s in found)
    n_axes = len(AXES) * n_seeds
    rivals = ",".join(
        f"{auc(plain[rival, 0.0], plain[rival, severity]):.3f}"
        for rival in RIVALS
        for severity in SEVERITIES[1:]
        if results
    )
    return (
        f"{speed:g},{rate:g},{n_axes},{n_unjudged},{n_failed},{alarms},{scores},{shares},{rivals}"
    )


if __name__ == "__main__":
    main()
