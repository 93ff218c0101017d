"""Fleets recorded by night: one, four or sixteen files each, three to eight nights.

Each virtual robot has one joint. Its temperature, friction, gain and offset are drawn once a
night; the files of a night share them. One more healthy night is held against the baseline's, and
one with damage. `--by-file` takes each file for a session of its own, as it must not be.

    python benchmarks/nights.py --quick
    python benchmarks/nights.py --robots 140 --first 5000
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from scipy.stats import kstest

from opamc_cli.config import load_config
from opamc_cli.config.testbed import load_testbed
from opamc_cli.decision.judge import judge
from opamc_cli.stages.chain.compared.side import Side, Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.storage.runs import RunInfo, save_run
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[1]
RATE_HZ = 250.0
AXIS = 3
FILES = (1, 4, 16)
SEVERITY = 0.25


def record(seed: int, n_nights: int, n_files: int, folder: Path) -> None:
    """Write one run per night; each of its cycles stands for a file."""
    config = load_testbed(ROOT / "configs" / "testbed.yaml")
    spread = replace(config.robot.spread, temperature_c=5.0)
    robot = replace(config.robot, spread=spread)
    program = replace(
        config.program,
        order="together",
        axes=(AXIS,),
        cycles=n_files,
        lead_s=0.3,
        dwell_s=0.2,
        dwell_jitter_s=0.02,
    )
    for night in range(n_nights + 1):
        for severity in (0.0, SEVERITY) if night == n_nights else (0.0,):
            side = "baseline" if night < n_nights else f"target-{severity:g}"
            damage = {AXIS: replace(robot.damage, severity=severity)} if severity else {}
            signals = simulate(
                robot,
                program,
                seed=seed,
                session=night,
                axes=[AXIS],
                faults=damage,
                sampling_rate_hz=RATE_HZ,
            ).axes[AXIS]
            save_run(
                folder / side / f"{night}.parquet",
                RunInfo(sampling_rate_hz=RATE_HZ),
                {
                    f"axis{AXIS}_current": signals.reported_a,
                    f"axis{AXIS}_position": signals.position_rad,
                },
            )


def by_files(side: Side, by_file: bool) -> Side:
    """Turn each cycle of a night's run into a file of that night."""

    def renamed(table: pa.Table) -> pa.Table:
        pairs = zip(table["run"].to_pylist(), table["cycle"].to_pylist(), strict=True)
        names = pa.array([f"{run}-{cycle}" for run, cycle in pairs])
        return table.set_column(table.column_names.index("run"), "run", names)

    patterns = renamed(side.patterns)
    by_name = {source.name: source for source in side.sources}
    sources = []
    for name in sorted(set(patterns["run"].to_pylist())):
        night = by_name[name.rsplit("-", 1)[0]]
        info = replace(night.info, session=name if by_file else night.name)
        sources.append(replace(night, name=name, info=info))
    witnesses = {name: renamed(table) for name, table in side.witnesses.items()}
    return Side(side.path, tuple(sources), patterns, witnesses)


def judged(seed: int, n_files: int, by_file: bool) -> dict[float, tuple[float, str]]:
    """Return p and state by severity of one robot's target night."""
    n_nights = 3 + seed % 6
    config = load_config()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        record(seed, n_nights, n_files, folder)
        baseline = run_chain([folder / "baseline"], config, folder / "out" / "baseline")
        own = by_files(read_side(baseline.patterns), by_file)
        found = {}
        for severity in (0.0, SEVERITY):
            name = f"target-{severity:g}"
            done = run_chain(
                [folder / name], config, folder / "out" / name, reference=baseline.motions
            )
            sides = Sides(own, by_files(read_side(done.patterns), by_file))
            judgement = judge(bundles(sides))[AXIS]
            found[severity] = (judgement.p_value, judgement.state)
        return found


def main() -> None:
    """Print false alarms, uniformity and detection by files a night."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=40, help="for each number of files")
    parser.add_argument("--first", type=int, default=0, help="seed of the first robot")
    parser.add_argument("--files", type=int, nargs="*", default=list(FILES))
    parser.add_argument("--by-file", action="store_true")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    n_robots = 4 if arguments.quick else arguments.robots
    print("files a night,robots,not judged,healthy alarms,KS p,found at 0.25,p<0.01 at 0.25")
    for n_files in arguments.files:
        results = [
            judged(arguments.first + 1000 * n_files + k, n_files, arguments.by_file)
            for k in range(n_robots)
        ]
        healthy = np.array([one[0.0][0] for one in results])
        known = healthy[np.isfinite(healthy)]
        alarms = sum(one[0.0][1] in ("changed", "fault") for one in results)
        found = sum(one[SEVERITY][1] in ("changed", "fault") for one in results)
        small = sum(one[SEVERITY][0] <= 0.01 for one in results)
        uniform = kstest(known, "uniform").pvalue
        print(
            f"{n_files},{n_robots},{n_robots - len(known)},{alarms},{uniform:.3f},{found},{small}",
            flush=True,
        )


if __name__ == "__main__":
    main()
