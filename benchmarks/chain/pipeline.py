"""How long a shift of one robot takes from segment to score, and how much memory.

    python benchmarks/chain/pipeline.py --hours 1 2 4 8

A run of the testbed (six axes, 18 phase currents, 2048 Hz) is repeated until it has the length
asked for. Every stage is the public command in a process of its own; beside the whole stands the
time that decoding the same columns takes, which no program that reads them can beat. Times vary
with the machine: read the ratios and the growth from row to row.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES, write_run

ROOT = Path(__file__).parents[2]
OUT = ROOT / "benchmarks" / "out" / "pipeline"
OPAMC = [sys.executable, "-m", "opamc_cli"]


@dataclass(frozen=True)
class Measured:
    """Wall time, processor time and the largest resident memory of a process and its workers."""

    wall_s: float
    cpu_s: float
    peak_mb: float


def measure(command: list[str], threads: int = 1) -> Measured:
    """Run a command to its end; raise if it ends with anything but 0 or 1."""
    environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
    # An installed package has its bytecode; to compile it anew takes 0.2 s.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before = os.times()
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env=environment)
    peak = [0.0]
    watcher = threading.Thread(target=_watch, args=(process.pid, peak))
    watcher.start()
    code = process.wait()
    wall = time.perf_counter() - start
    watcher.join()
    after = os.times()
    if code not in (0, 1):
        msg = f"{' '.join(command)} ended with {code}"
        raise RuntimeError(msg)
    cpu = after.children_user + after.children_system
    cpu -= before.children_user + before.children_system
    return Measured(wall, cpu, peak[0])


def _watch(pid: int, peak: list[float]) -> None:
    """Sum the proportional memory of a process and its descendants until it ends."""
    while True:
        members = _descendants(pid)
        total = sum(_proportional_mb(member) for member in members)
        if not Path(f"/proc/{pid}").exists() or total == 0.0:
            return
        peak[0] = max(peak[0], total)
        time.sleep(0.05)


def _descendants(pid: int) -> list[int]:
    found, queue = [], [pid]
    while queue:
        current = queue.pop()
        found.append(current)
        try:
            for task in Path(f"/proc/{current}/task").iterdir():
                queue += [int(child) for child in (task / "children").read_text().split()]
        except OSError:
            continue
    return found


def _proportional_mb(pid: int) -> float:
    """Memory of a process, pages shared with others counted by their share (0 if it is gone)."""
    try:
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    return 0.0


def make_run(seed_run: Path, path: Path, hours: float) -> None:
    """Repeat a run until it lasts `hours`."""
    with Run(seed_run) as run:
        names = [name for name in run.columns if name.rsplit("_", 1)[1] in "abc"]
        columns = run.read(names)
        n_samples = round(hours * 3600 * run.sampling_rate_hz)
        schema = pa.schema([(name, pa.float32()) for name in names])
        with write_run(path, run.info, schema) as writer:
            for start in range(0, n_samples, ROW_GROUP_SAMPLES):
                index = np.arange(start, min(start + ROW_GROUP_SAMPLES, n_samples)) % run.n_samples
                writer.write_table(pa.table([columns[name][index] for name in names], schema))


def decode_s(path: Path) -> float:
    """Time to decode every column of a run, one row group after the other."""
    start = time.perf_counter()
    file = pq.ParquetFile(path)
    for group in range(file.num_row_groups):
        file.read_row_group(group, use_threads=True)
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, nargs="+", default=[1.0, 2.0, 4.0, 8.0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--keep", action="store_true", help="Keep the runs.")
    arguments = parser.parse_args()

    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    source = OUT / "source"
    simulate = [*OPAMC, "simulate", "--config", str(ROOT / "configs" / "testbed.yaml")]
    simulate += ["--seed", str(arguments.seed), "--sessions", "2", "--cycles", "4"]
    subprocess.run([*simulate, "--out", str(source)], check=True, stdout=subprocess.DEVNULL)
    baseline, target = sorted(source.glob("*.parquet"))

    chain = ["--jobs", str(arguments.jobs), "--quiet"]
    normal = OUT / "baseline"
    for stage in (["segment", str(baseline)], ["identify"], ["patterns"]):
        measure([*OPAMC, *stage, "--out", str(normal), *chain])

    rows = []
    stages = ("segment", "identify", "patterns", "score")
    print(f"{'hours':>6} {'Msamples':>9} {'decode s':>9}", end="")
    print("".join(f"{name + ' s':>12}" for name in stages), end="")
    print(f"{'total s':>9} {'peak MB':>8} {'x decode':>9} {'M/s':>7}")
    for hours in arguments.hours:
        run, out = OUT / f"shift-{hours:g}h.parquet", OUT / f"shift-{hours:g}h"
        make_run(target, run, hours)
        limit = decode_s(run)
        tables = ["--baseline", str(normal / "patterns.parquet")]
        tables += ["--target", str(out / "patterns.parquet")]
        commands = {
            "segment": ["segment", str(run)],
            "identify": ["identify", "--reference", str(normal / "motions.parquet")],
            "patterns": ["patterns"],
            "score": ["score", *tables],
        }
        times = {}
        for name, command in commands.items():
            extra = chain if name != "score" else ["--quiet"]
            times[name] = measure([*OPAMC, *command, "--out", str(out), *extra])
        total = sum(m.wall_s for m in times.values())
        peak = max(m.peak_mb for m in times.values())
        with Run(run) as opened:
            samples = opened.n_samples * len(opened.columns) / 1e6
        print(f"{hours:>6g} {samples:>9.0f} {limit:>9.2f}", end="")
        print("".join(f"{times[name].wall_s:>12.2f}" for name in stages), end="")
        print(f"{total:>9.2f} {peak:>8.0f} {total / limit:>9.2f} {samples / total:>7.1f}")
        rows.append(
            {
                "hours": hours,
                "samples": samples * 1e6,
                "decode_s": limit,
                "stages": {name: vars(m) for name, m in times.items()},
                "total_s": total,
                "peak_mb": peak,
            }
        )
        if not arguments.keep:
            run.unlink()
    (OUT / "pipeline.json").write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
