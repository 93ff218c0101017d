"""What a start costs that finds nothing new: the time and the memory of looking.

python benchmarks/nightly/nightly_known.py --robots 50 --nights 106  # 5000 judged nights are known
"""

import argparse
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cell_logs
import nightly_kills
import numpy as np

from opamc_cli.config.cell import load_cell
from opamc_cli.stages.nightly.start import run as stage
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run

RUNS = 4
BASELINE = 6
STARTS = 3
NOBODY = "r???"


def record_cell(folder: Path, robots: int, nights: int) -> Path:
    """Write the runs of every night once, and copy them with each robot's name in them."""
    rng = np.random.default_rng(1)
    for n in range(nights):
        night = cell_logs.night(n)
        for k in range(RUNS):
            source = folder / "source" / night / f"run-{k}.parquet"
            info = RunInfo(500.0, NOBODY, "cycle", started_at=f"{night}T22:0{k}:00+00:00")
            save_run(source, info, {f"axis1_{p}": rng.normal(size=500) for p in "abc"})
            written = source.read_bytes()
            assert NOBODY.encode() in written
            for robot in range(robots):
                place = folder / f"logs/r{robot:03d}/{night}" / source.name
                place.parent.mkdir(parents=True, exist_ok=True)
                # the same bytes under two robots would be one robot's recording
                place.write_bytes(written.replace(NOBODY.encode(), f"r{robot:03d}".encode()))
    cell = folder / "cell.yaml"
    pattern = "logs/{robot}/{night}/*.parquet"
    cell.write_text(f"runs: {pattern}\nbaseline: {{nights: {BASELINE}}}\n")
    return cell


def judge_all(path: Path) -> None:
    """Have every night judged by the stand-in."""
    cell = load_cell(path)
    with nightly_kills.with_stand_in(), stage.open_history(cell) as history:
        done = stage.run(cell, str(path), history, stage.Wanted(), jobs=2).done
    print(f"{len(done)} nights are known")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=50)
    parser.add_argument("--nights", type=int, default=106, help="six of them are the baseline")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        path = record_cell(Path(name), options.robots, options.nights)
        # in a process of its own: what is started from one counts its memory as its own
        before = multiprocessing.Process(target=judge_all, args=(path,))
        before.start()
        before.join()
        for _ in range(STARTS):
            begun = time.perf_counter()
            command = [sys.executable, "-m", "opamc_cli", "nightly", str(path), "--quiet"]
            started = subprocess.Popen(command, stdout=subprocess.DEVNULL)
            _, status, used = os.wait4(started.pid, 0)
            wall, computing = time.perf_counter() - begun, used.ru_utime + used.ru_stime
            memory = f"{used.ru_maxrss / 1024:.0f} MB"
            code = os.waitstatus_to_exitcode(status)
            print(f"exit {code}: {wall:.1f} s, {computing:.1f} s of computing, {memory}")


if __name__ == "__main__":
    main()
