"""Of the computing of many robots' nights, the share that is spent in the diagnoses themselves.

python benchmarks/nightly_share.py --robots 20 --nights 12     # 200 nights are judged
"""

import argparse
import os
import resource
import tempfile
import time
from pathlib import Path

import cell_logs

from opamc_cli.config.cell import load_cell
from opamc_cli.stages.nightly import run as stage
from opamc_cli.stages.nightly.workers.judge import compute
from opamc_cli.stages.nightly.workers.night import NightJob, ProgramResult


def timed(job: NightJob) -> tuple[ProgramResult, ...]:
    """Judge a night as a worker does, and note what it took."""
    begun = time.process_time()
    try:
        return compute(job)
    finally:
        note = Path(os.environ["OPAMC_NIGHT_TIMES"]) / f"{job.robot}-{job.night}"
        note.write_text(f"{time.process_time() - begun}")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--nights", type=int, default=12, help="two of them are the baseline")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        path = cell_logs.record_cell(Path(name), options.robots, options.nights, {})
        times = Path(name) / "times"
        times.mkdir()
        os.environ["OPAMC_NIGHT_TIMES"] = str(times)
        os.environ["PYTHONPATH"] = os.pathsep.join(
            [str(Path(__file__).resolve().parent), os.environ.get("PYTHONPATH", "")]
        )
        stage.COMPUTE = "nightly_share:timed"
        cell = load_cell(path)
        before, wall = time.process_time(), time.perf_counter()
        with stage.open_history(cell) as history:
            outcome = stage.run(cell, str(path), history, stage.Wanted(), jobs=options.jobs)
        assert not outcome.failed, outcome.failed
        wall = time.perf_counter() - wall
        start = time.process_time() - before
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        workers = ended.ru_utime + ended.ru_stime
        nights = [float(note.read_text()) for note in times.iterdir()]
    total = start + workers
    print(f"{len(nights)} nights, {options.jobs} workers: {wall:.0f} s, {total:.1f} s of computing")
    print(f"in the diagnoses {sum(nights):.1f} s, {sum(nights) / total:.1%} of it")
    print(f"else in the workers {workers - sum(nights):.1f} s, in the start itself {start:.1f} s")


if __name__ == "__main__":
    main()
