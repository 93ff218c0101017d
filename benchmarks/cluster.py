"""A Dask cluster beside this machine's processes: the same bytes, one worker killed, at what cost.

python benchmarks/cluster.py              # a stand-in for the diagnosis: the overhead
python benchmarks/cluster.py --real       # the true diagnosis
"""

import argparse
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from contextlib import nullcontext
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import cell_logs
import distributed
import nightly_kills

from opamc_cli.config.cell import load_cell
from opamc_cli.stages.nightly import run as stage


def nightly(cell: Path, scheduler: str | None) -> float:
    """Do all nights; return the seconds that it took."""
    loaded = load_cell(cell)
    begun = time.perf_counter()
    with stage.open_history(loaded) as history:
        outcome = stage.run(loaded, str(cell), history, stage.Wanted(), jobs=2, scheduler=scheduler)
    assert not outcome.failed, outcome.failed
    return time.perf_counter() - begun


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--real", action="store_true")
    parser.add_argument("--robots", type=int, default=3)
    parser.add_argument("--nights", type=int, default=12)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        cell = cell_logs.record_cell(Path(name), options.robots, options.nights, {})
        out = cell.parent / "nightly"
        n = options.robots * (options.nights - 2)
        with nullcontext() if options.real else nightly_kills.with_stand_in():
            took = nightly(cell, None)
            plain = nightly_kills.end_state(out)
            print(f"two processes: {took / n * 1000:.0f} ms a night ({n} nights)", flush=True)
            with distributed.LocalCluster(2, threads_per_worker=1, memory_limit=0) as cluster:
                for kill in (False, True):
                    shutil.rmtree(out)
                    victim = next(iter(cluster.workers.values())).process.pid
                    killer = threading.Timer(0.4 * took, os.kill, (victim, signal.SIGKILL))
                    if kill:
                        killer.start()
                    took = nightly(cell, cluster.scheduler_address)
                    killer.cancel()
                    found = nightly_kills.end_state(out)
                    same = found == plain
                    differing = [key for key in plain if found.get(key) != plain[key]]
                    if differing:
                        print("differing:", differing)
                    print(
                        f"cluster of two{', one killed' if kill else ''}: "
                        f"{took / n * 1000:.0f} ms a night, same bytes: {same}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
