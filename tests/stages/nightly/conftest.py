"""A small cell of virtual robots, recorded once."""

import pickle
import shutil
from collections.abc import Iterator
from datetime import date
from pathlib import Path

import cell_logs
import night_stand_in
import nightly_kills
import pytest

from opamc_cli.stages.nightly.start import run as stage
from opamc_cli.stages.nightly.workers.workers import _attempt, called


@pytest.fixture(autouse=True, scope="module")
def in_time() -> Iterator[None]:
    """Have no cell's last night lie days ago: a cell that is silent has a line of its own."""
    with pytest.MonkeyPatch.context() as patch:
        of = "opamc_cli.commands.nightly.nightly._today"
        patch.setattr(of, lambda: date.fromisoformat(cell_logs.night(0)))
        yield


@pytest.fixture(scope="session")
def recorded(tmp_path_factory) -> Path:
    """Three robots, five nights; axis 2 of r2 is damaged from the fourth on."""
    folder = tmp_path_factory.mktemp("recorded")
    cell_logs.record_cell(folder, 3, 5, {1: [0.0, 0.0, 0.0, 1.0, 1.0]})
    return folder


@pytest.fixture
def cell(recorded, tmp_path) -> Path:
    """A cell of its own for a test, with links to the recordings; two nights are the baseline."""
    shutil.copytree(recorded / "logs", tmp_path / "logs")
    path = tmp_path / "cell.yaml"
    path.write_text(
        "runs: logs/{robot}/{night}/*.parquet\nbaseline: {nights: 3}\nset: {joint.explain: false}\n"
    )
    return path


@pytest.fixture
def here(monkeypatch):
    """Judge nights in this process: a worker takes longer to start than to judge one.

    For who asks what becomes of a night, not who judges it; what is patched holds for it, too.
    """

    def run_all(function, works, _, **limits):
        assert limits.keys() == {"seconds", "memory_gb"}
        for work in works:
            sent = pickle.loads(pickle.dumps(work))
            yield work, pickle.loads(pickle.dumps(_attempt(called(function), sent, None)))

    monkeypatch.setattr(stage, "run_all", run_all)
    monkeypatch.setattr(night_stand_in, "PAUSE_S", 0.0)


@pytest.fixture
def logs(cell, here):
    """The logs of two robots of a cell whose nights are all healthy."""
    shutil.rmtree(cell.parent / "logs" / "r2")
    with nightly_kills.with_stand_in():
        yield cell.parent / "logs"
