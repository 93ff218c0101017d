"""A Dask cluster in the place of this machine's processes."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import night_stand_in
import nightly_kills
import pytest

from opamc_cli.config.cell import load_cell
from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.start import run as stage
from opamc_cli.stages.nightly.workers.cluster import SchedulerLostError, run_all

distributed = pytest.importorskip("distributed", reason="Dask is not installed: opamc[cluster]")


@pytest.fixture
def cluster(monkeypatch):
    paths = [str(Path(night_stand_in.__file__).parent), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, memory_limit=0
    ) as made:
        yield made


def nightly(cell: Path, scheduler: str | None) -> stage.CellOutcome:
    loaded = load_cell(cell)
    with stage.open_history(loaded) as history:
        return stage.run(loaded, str(cell), history, stage.Wanted(), scheduler=scheduler)


@pytest.mark.long
def test_a_cluster_with_a_killed_worker_ends_with_the_same_bytes(cell, cluster):
    """The bookkeeping, with a stand-in; the true diagnosis in benchmarks/nightly/cluster.py."""
    with nightly_kills.with_stand_in():
        nightly(cell, None)
        plain = nightly_kills.end_state(cell.parent / "nightly")
        shutil.rmtree(cell.parent / "nightly")
        victim = next(iter(cluster.workers.values())).process.pid

        def kill() -> None:
            time.sleep(0.3)
            os.kill(victim, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        outcome = nightly(cell, cluster.scheduler_address)
        killer.join()
    assert not outcome.failed
    assert nightly_kills.end_state(cell.parent / "nightly") == plain


def test_a_scheduler_that_is_not_there_is_a_sentence(cell, opamc, monkeypatch):
    monkeypatch.setattr("opamc_cli.stages.nightly.workers.cluster.CONNECT_S", 0.5)
    ended = opamc("nightly", cell, "--scheduler", "tcp://127.0.0.1:9")
    assert ended.code == ExitCode.USAGE
    assert "does not answer" in ended.err


@pytest.mark.long
def test_a_scheduler_that_is_lost_ends_with_a_sentence_and_what_was_done(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), *sys.path]))
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    common = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    host, port = address.removeprefix("tcp://").split(":")
    scheduler = subprocess.Popen([*common, "--host", host, "--port", port], **quiet)
    worker = subprocess.Popen(
        [
            *(sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard"),
            *("--nworkers", "1", "--nthreads", "1", "--no-nanny", "--death-timeout", "20"),
        ],
        **quiet,
    )
    done = []
    try:
        answers = run_all("worker_jobs:behave", ["nap"] * 40, address, seconds=60)
        done.append(next(answers))
        scheduler.kill()
        with pytest.raises(SchedulerLostError, match=r"is lost; \d+ of 40 nights are done"):
            done += answers
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.wait()
    assert done[0] == ("nap", "NAP")
