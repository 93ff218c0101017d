"""Of the computing of many robots' nights, the share that is spent in the diagnoses themselves.

python benchmarks/nightly/nightly_share.py --robots 20 --nights 12     # 200 nights are judged
"""

import argparse
import multiprocessing
import os
import resource
import tempfile
import time
from pathlib import Path

from opamc_cli.config.cell import load_cell
from opamc_cli.stages.nightly.workers.night import NightJob, ProgramResult
from opamc_cli.stages.nightly.workers.workers import can_fork
from opamc_cli.stages.processes.parallel import one_thread_each


def record(folder: Path, robots: int, nights: int) -> None:
    """Record the cell, in a process of its own: threads that write would keep ours from forking."""
    import cell_logs

    cell_logs.record_cell(folder, robots, nights, {})


def timed(job: NightJob) -> tuple[ProgramResult, ...]:
    """Judge a night as a worker does, and note what it took."""
    from opamc_cli.stages.nightly.workers.judge import compute

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
        shape = (Path(name), options.robots, options.nights)
        recorder = multiprocessing.get_context("spawn").Process(target=record, args=shape)
        recorder.start()
        recorder.join()
        before = time.process_time()
        with one_thread_each():  # as `opamc nightly` does
            from opamc_cli.stages.nightly.start import run as stage
        times = Path(name) / "times"
        times.mkdir()
        os.environ["OPAMC_NIGHT_TIMES"] = str(times)
        os.environ["PYTHONPATH"] = os.pathsep.join(
            [str(Path(__file__).resolve().parent), os.environ.get("PYTHONPATH", "")]
        )
        stage.COMPUTE = "nightly_share:timed"
        path = Path(name) / "cell.yaml"
        cell = load_cell(path)
        wall = time.perf_counter()
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        recorded = children.ru_utime + children.ru_stime
        with stage.open_history(cell) as history:
            outcome = stage.run(cell, str(path), history, stage.Wanted(), jobs=options.jobs)
        assert not outcome.failed, outcome.failed
        wall = time.perf_counter() - wall
        start = time.process_time() - before
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        workers = ended.ru_utime + ended.ru_stime - recorded
        forked = "forked" if can_fork() else "spawned"
        nights = [float(note.read_text()) for note in times.iterdir()]
    total = start + workers
    print(f"{len(nights)} nights, {options.jobs} {forked} workers: {wall:.0f} s")
    print(f"{total:.1f} s of computing")
    print(f"in the diagnoses {sum(nights):.1f} s, {sum(nights) / total:.1%} of it")
    print(f"else in the workers {workers - sum(nights):.1f} s, in the start itself {start:.1f} s")


if __name__ == "__main__":
    main()
