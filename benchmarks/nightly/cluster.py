"""A Dask cluster beside this machine's processes: the same bytes, one worker killed, at what cost.

python benchmarks/nightly/cluster.py              # a stand-in for the diagnosis: the overhead
python benchmarks/nightly/cluster.py --real       # the true diagnosis
"""

import argparse
import multiprocessing
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

import nightly_kills
import nightly_share

from opamc_cli.config.cell import load_cell
from opamc_cli.stages.nightly.start import run as stage


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
        shape = (Path(name), options.robots, options.nights)
        recorder = multiprocessing.get_context("spawn").Process(
            target=nightly_share.record, args=shape
        )
        recorder.start()
        recorder.join()
        cell = Path(name) / "cell.yaml"
        out = cell.parent / "nightly"
        n = options.robots * (options.nights - 2)
        with nullcontext() if options.real else nightly_kills.with_stand_in():
            nightly(cell, None)  # what a process loads first is nobody's overhead
            shutil.rmtree(out)
            took = nightly(cell, None)
            plain = nightly_kills.end_state(out)
            print(f"two processes: {took / n * 1000:.0f} ms a night ({n} nights)", flush=True)
            import distributed  # its threads would keep workers of this machine from forking

            with distributed.LocalCluster(2, threads_per_worker=1, memory_limit=0) as cluster:
                for kill in (False, False, True):  # its workers load first, too
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
