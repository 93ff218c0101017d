"""What a new night of one robot costs beside `opamc diagnose` of the same recordings.

Both are whole processes begun cold, in seconds of computing (their workers' too) and of the clock;
six baseline nights, which an earlier night has read, and one target night of one recording. With
several robots also what a night costs among others: the start that judges all but the first, less
the one that judged the first alone, for each robot that it judged more.

    python benchmarks/nightly/nightly_cost.py --rounds 3 --robots 6
"""

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median

import cell_logs
import numpy as np

from opamc_cli.config.testbed import load_testbed
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run
from opamc_cli.testbed.robot import simulate

BASELINE = 6
FAULTY_AXIS = 3
KINDS = ("healthy", "first faulty", "next faulty")
Seconds = tuple[float, float]
"""Of computing and of the clock."""
Costs = tuple[Seconds, Seconds, Seconds]
"""Of a lone night, of one among others (NaN where there are none), and of its diagnosis."""
OPTIONS = {"joint.gear_ratio": 100, "joint.pole_pairs": 5}


def record_short(path: Path, robot: int, index: int, faulty: bool) -> None:
    """Record six channels for 6 s, as in the demo."""
    cell_logs.record(path, 500 + robot, index, severity=1.0 if faulty else 0.0)


def record_long(path: Path, robot: int, index: int, faulty: bool, cycles: int = 4) -> None:
    """Record eighteen channels for 104 s, or 30 s of one cycle."""
    config = load_testbed(cell_logs.ROOT / "configs" / "testbed.yaml")
    damage = {FAULTY_AXIS: config.robot.damage} if faulty else {}
    # the same robot on another day of its own
    program = replace(config.program, cycles=cycles)
    made = simulate(config.robot, program, seed=5 + robot, session=index, faults=damage)
    columns = {
        f"axis{number}_{phase}": np.ascontiguousarray(signals.phases_a[:, k])
        for number, signals in made.axes.items()
        for k, phase in enumerate("abc")
    }
    started = f"{cell_logs.night(index)}T22:00:00+00:00"
    save_run(path, RunInfo(made.sampling_rate_hz, program="cycle", started_at=started), columns)


def seconds(*arguments: object) -> tuple[float, float]:
    """Run opamc and return the seconds that it and its workers computed, and those of the clock."""
    before, begun = os.times(), time.perf_counter()
    command = [sys.executable, "-m", "opamc_cli", *map(str, arguments), "--jobs", "1", "--quiet"]
    # as for who starts it every night: Python's own compiled files are there
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    ended = subprocess.run(command, stdout=subprocess.DEVNULL, check=False, env=kept)
    assert ended.returncode in (0, 1), ended
    took, after = time.perf_counter() - begun, os.times()
    children = (after.children_user, after.children_system)
    return sum(children) - before.children_user - before.children_system, took


def measure(
    folder: Path, record: Callable[[Path, int, int, bool], None], rounds: int, robots: int
) -> dict[str, list[Costs]]:
    """Return a night's and its diagnosis's seconds, by kind of night."""

    def record_all(index: int, faulty: bool) -> str:
        night = cell_logs.night(index)
        for robot in range(robots):
            record(folder / "logs" / f"r{robot}" / night / "run.parquet", robot, index, faulty)
        return night

    for index in range(BASELINE + 1):
        record_all(index, False)
    cell = folder / "cell.yaml"
    options = ", ".join(f"{key}: {value}" for key, value in OPTIONS.items())
    cell.write_text(
        "runs: logs/{robot}/{night}/*.parquet\n"
        f"baseline: {{nights: {BASELINE}}}\nset: {{{options}}}\n"
    )
    seconds("nightly", cell)
    shutil.copytree(folder / "nightly", folder / "before")
    given = [part for key, value in OPTIONS.items() for part in ("--set", f"{key}={value}")]
    for index in range(BASELINE):
        given += ["--baseline", folder / "logs" / "r0" / cell_logs.night(index)]
    found: dict[str, list[Costs]] = {kind: [] for kind in KINDS}
    index = BASELINE + 1
    for _ in range(rounds):
        shutil.rmtree(folder / "nightly")
        shutil.copytree(folder / "before", folder / "nightly")
        for kind in KINDS:
            night = record_all(index, kind != "healthy")
            lone = seconds("nightly", cell, "--night", night, "--robot", "r0")
            among = (math.nan, math.nan)
            if robots > 2:
                others = seconds("nightly", cell, "--night", night)
                more = [(all_ - one) / (robots - 2) for all_, one in zip(others, lone, strict=True)]
                among = more[0], more[1]
            out, target = folder / "diagnosed" / night, folder / "logs" / "r0" / night
            diagnosed = seconds("diagnose", *given, "--target", target, "--out", out)
            found[kind].append((lone, among, diagnosed))
            index += 1
    return found


def main() -> None:
    """Print a line per length and state."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--robots", type=int, default=1, help="of the cell; three for `among`")
    parser.add_argument("--long-only", action="store_true")
    arguments = parser.parse_args()
    lengths = {
        "6 channels, 6 s": record_short,
        "18 channels, 30 s": partial(record_long, cycles=1),
        "18 channels, 104 s": record_long,
    }
    if arguments.long_only:
        del lengths["6 channels, 6 s"]
    for name, record in lengths.items():
        with tempfile.TemporaryDirectory() as folder:
            found = measure(Path(folder), record, arguments.rounds, arguments.robots)
        for kind, costs in found.items():
            for of, which in (("lone", 0), ("among others", 1))[: 1 + (arguments.robots > 2)]:
                for index, measure_of in enumerate(("computing", "clock")):
                    nights = [each[which][index] for each in costs]
                    diagnoses = [each[2][index] for each in costs]
                    shares = [one / other for one, other in zip(nights, diagnoses, strict=True)]
                    print(
                        f"{name}, {kind}, {of}, {measure_of}: {median(nights):.1f} s beside "
                        f"{median(diagnoses):.1f} s; {min(shares):.0%} to {max(shares):.0%}, "
                        f"median {median(shares):.0%}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
