"""Fleets recorded by night: one, four or sixteen files each, three to eight nights.

Each virtual robot has one joint. Its temperature, friction, gain and offset are drawn once a
night; the files of a night share them. One more healthy night is held against the baseline's, and
others with damage, or with more friction. `--by-file` takes each file for a session of its own, as
it must not be. Tables are kept in `benchmarks/out/nights`, so that another decision is tried in
seconds: remove them when anything before the decision changes.

    python benchmarks/decision/nights.py --quick
    python benchmarks/decision/nights.py --robots 140 --first 5000
"""

import argparse
import pickle
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from scipy.stats import kstest

from opamc_cli.config import load_config
from opamc_cli.config.testbed import TestbedConfig, load_testbed
from opamc_cli.decision.sessions.odd_session import judge_without_odd
from opamc_cli.stages.chain.compared.side import Side, Sides, read_side
from opamc_cli.stages.chain.to_patterns import run_chain
from opamc_cli.stages.verdict.evidence import bundles
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.storage.sources import RunSource
from opamc_cli.testbed.parameters import Robot
from opamc_cli.testbed.robot import simulate

ROOT = Path(__file__).resolve().parents[2]
CACHE = Path(__file__).resolve().parents[1] / "out" / "nights"
RATE_HZ = 250.0
AXIS = 3
FILES = (1, 4, 16)
SEVERITIES = (0.1, 0.25, 0.5)


@dataclass(frozen=True)
class Night:
    """What is wrong in a target night: damage of the gear, or friction that has grown evenly."""

    severity: float = 0.0
    friction: float = 1.0

    @property
    def name(self) -> str:
        """Name of its tables."""
        return f"{self.severity:g}" if self.friction == 1 else f"friction {self.friction:g}"


HEALTHY = Night()


@cache
def testbed() -> TestbedConfig:
    """Return the shipped robot and program."""
    return load_testbed(ROOT / "configs" / "testbed.yaml")


def rubbed(robot: Robot, factor: float) -> Robot:
    """Return the robot with more friction in its joints."""
    joints = []
    for joint in robot.joints:
        own = joint.friction
        more = {
            name: factor * getattr(own, name)
            for name in (
                *("coulomb_nm", "viscous_nms_per_rad"),
                *("output_coulomb_nm", "output_viscous_nms_per_rad"),
            )
        }
        joints.append(replace(joint, friction=replace(own, **more)))
    return replace(robot, joints=tuple(joints))


def record(seed: int, n_nights: int, n_files: int, targets: Sequence[Night], folder: Path) -> None:
    """Write one run per night; each of its cycles stands for a file."""
    config = testbed()
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
        for one in targets if night == n_nights else (HEALTHY,):
            damage = {AXIS: replace(robot.damage, severity=one.severity)} if one.severity else {}
            signals = simulate(
                robot if one.friction == 1 else rubbed(robot, one.friction),
                program,
                seed=seed,
                session=night,
                axes=[AXIS],
                faults=damage,
                sampling_rate_hz=RATE_HZ,
            ).axes[AXIS]
            name = f"target/{one.name}" if night == n_nights else f"baseline/{night}"
            save_run(
                folder / f"{name}.parquet",
                RunInfo(sampling_rate_hz=RATE_HZ),
                {
                    f"axis{AXIS}_current": signals.reported_a,
                    f"axis{AXIS}_position": signals.position_rad,
                },
            )


def tables(seed: int, n_files: int, targets: Sequence[Night]) -> dict[str, dict[str, pa.Table]]:
    """Return one robot's tables by side and name; what was recorded before is read."""
    path = CACHE / f"{n_files}-files-{seed}.pickle"
    if path.exists():
        kept: dict[str, dict[str, pa.Table]] = pickle.loads(path.read_bytes())
        if all(f"target-{one.name}" in kept for one in targets):
            return kept
    config = load_config()
    found: dict[str, dict[str, pa.Table]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        record(seed, 3 + seed % 6, n_files, targets, folder)
        reference = None
        for side in ("baseline", "target"):
            done = run_chain([folder / side], config, folder / "out" / side, reference=reference)
            reference = done.motions
            made = read_side(done.patterns)
            found[side] = {
                name: table.replace_schema_metadata(None)
                for name, table in {"patterns": made.patterns, **made.witnesses}.items()
            }
    for one in targets:
        found[f"target-{one.name}"] = {
            name: table.filter(pc.equal(table["run"], one.name))
            for name, table in found["target"].items()
        }
    del found["target"]
    CACHE.mkdir(parents=True, exist_ok=True)
    path.with_suffix(".tmp").write_bytes(pickle.dumps(found))
    path.with_suffix(".tmp").rename(path)
    return found


def by_files(of_side: dict[str, pa.Table], by_file: bool) -> Side:
    """Turn each cycle of a night's run into a file of that night."""

    def renamed(table: pa.Table) -> pa.Table:
        pairs = zip(table["run"].to_pylist(), table["cycle"].to_pylist(), strict=True)
        names = pa.array([f"{run}-{cycle}" for run, cycle in pairs])
        return table.set_column(table.column_names.index("run"), "run", names)

    made = {name: renamed(table) for name, table in of_side.items()}
    patterns = made.pop("patterns")
    sources = []
    for name in sorted(set(patterns["run"].to_pylist())):
        night = name if by_file else name.rsplit("-", 1)[0]
        info = RunInfo(sampling_rate_hz=RATE_HZ, session=night)
        sources.append(RunSource(name, Path(name), "", 0, info))
    return Side(Path("patterns.parquet"), tuple(sources), patterns, made)


def judged(
    seed: int,
    n_files: int,
    targets: Sequence[Night],
    *,
    by_file: bool = False,
    without: frozenset[str] = frozenset(),
) -> dict[Night, tuple[float, str]]:
    """Return p and state of one robot's target nights."""
    made = tables(seed, n_files, targets)
    own = by_files(made["baseline"], by_file)
    found = {}
    for one in targets:
        bundle = bundles(Sides(own, by_files(made[f"target-{one.name}"], by_file)))[AXIS]
        kept = {name: kind for name, kind in bundle.witnesses.items() if name not in without}
        judgement = judge_without_odd({AXIS: replace(bundle, witnesses=kept)})[1][AXIS]
        found[one] = (judgement.p_value, judgement.state)
    return found


def main() -> None:
    """Print false alarms, uniformity and detection by files a night."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=40, help="for each number of files")
    parser.add_argument("--first", type=int, default=0, help="seed of the first robot")
    parser.add_argument("--files", type=int, nargs="*", default=list(FILES))
    parser.add_argument("--severities", type=float, nargs="*", default=list(SEVERITIES))
    parser.add_argument("--friction", type=float, nargs="*", default=[], help="1.3: 30 %% more")
    parser.add_argument("--by-file", action="store_true")
    parser.add_argument("--without", nargs="*", default=[], help="witnesses that are not asked")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    n_robots = 4 if arguments.quick else arguments.robots
    faulty = [*(Night(s) for s in arguments.severities), *(Night(0, f) for f in arguments.friction)]
    each = ",".join(f"found at {one.name},AUC {one.name}" for one in faulty)
    print(f"files a night,robots,not judged,healthy alarms,KS p,{each}")
    for n_files in arguments.files:
        results = []
        for k in range(n_robots):
            seed = arguments.first + 1000 * n_files + k
            results.append(
                judged(
                    seed,
                    n_files,
                    (HEALTHY, *faulty),
                    by_file=arguments.by_file,
                    without=frozenset(arguments.without),
                )
            )
            print(
                seed,
                {one.name: p for one, (p, _) in results[-1].items()},
                file=sys.stderr,
                flush=True,
            )
        print(row(n_files, results), flush=True)


def row(n_files: int, results: list[dict[Night, tuple[float, str]]]) -> str:
    """Summarise the robots of one number of files."""
    healthy = np.array([one[HEALTHY][0] for one in results])
    known = healthy[np.isfinite(healthy)]
    alarms = sum(one[HEALTHY][1] in ("changed", "fault") for one in results)
    uniform = kstest(known, "uniform").pvalue
    cells = [f"{n_files},{len(results)},{len(results) - len(known)},{alarms},{uniform:.3f}"]
    for night in list(results[0])[1:]:
        found = sum(one[night][1] in ("changed", "fault") for one in results)
        p = np.array([one[night][0] for one in results])
        above = (p[:, np.newaxis] < known) + 0.5 * (p[:, np.newaxis] == known)
        cells.append(f"{found},{above.mean():.3f}")
    return ",".join(cells)


if __name__ == "__main__":
    main()
