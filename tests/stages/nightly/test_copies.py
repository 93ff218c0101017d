"""Recordings of an earlier night, written again: a logger that is stuck."""

import json
import shutil
import sqlite3

import cell_logs
import numpy as np
import pytest
from cell_logs import night

from opamc_cli.errors import ExitCode
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from tests.stages.nightly.changed_logs import set_clock, states


def test_a_logger_that_repeats_a_recording_is_no_healthy_robot(cell, logs, opamc):
    stuck = logs / "r1" / night(4) / "cycle.parquet"
    shutil.copy(logs / "r1" / night(3) / "cycle.parquet", stuck)
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert (
        f"r1 {night(4)}: {night(4)}/{stuck.name}: is a copy of {logs / 'r1' / night(3)}"
        in ended.out
    )
    assert states(cell) == ["baseline", "baseline", "baseline", "done", "failed"]


def test_a_file_that_was_copied_is_no_loss_and_hides_none(cell, logs, opamc):
    """Four copies were four sentences "in part not judged", though all was judged."""
    for index in (2, 4):
        path = logs / "r1" / night(index)
        shutil.copy(path / "cycle.parquet", path / "cycle (copy).parquet")
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, ended.out) == (ExitCode.DONE, "")

    def runs(robot):
        with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
            return db.execute(
                "SELECT n_runs, notes FROM verdict JOIN night USING (robot, night) "
                "WHERE robot = ? AND night = ? LIMIT 1",
                (robot, night(4)),
            ).fetchone()

    count, notes = runs("r1")
    assert (count, "nothing is missing by it" in notes) == (1, True)
    # beside a baseline of two recordings a night a copy is no second one
    for index in range(4):
        cell_logs.record(logs / "r1" / night(index) / "second.parquet", 500, 50 + index)
    assert f"r1 {night(4)}: in part not judged: 1 recording" in opamc("nightly", cell).out
    # one that says to have begun at another time stays, for the diagnosis to say what is missing
    stuck = logs / "r3" / night(4) / "stuck.parquet"
    shutil.copy(stuck.with_name("cycle.parquet"), stuck)
    set_clock(stuck, f"{night(4)}T23:00:00+00:00", scale=1)
    opamc("nightly", cell)
    assert runs("r3") == (2, "[]")


def test_a_logger_that_writes_its_samples_anew_is_stuck_all_the_same(cell, logs, opamc):
    again = logs / "r1" / night(4) / "cycle.parquet"
    shutil.copy(logs / "r1" / night(1) / "cycle.parquet", again)
    set_clock(again, f"{night(4)}T22:00:00+00:00", scale=1)
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert (first.code, second.code) == (ExitCode.PARTIAL, ExitCode.PARTIAL)
    assert (
        f"r1 {night(4)}: {night(4)}/{again.name}: is a copy of {logs / 'r1' / night(1)}"
        in first.out
    )
    assert second.out == ""
    assert states(cell) == ["baseline", "baseline", "baseline", "done", "failed"]


def test_recordings_of_a_sensor_that_is_dead_are_alike_and_no_copies(cell, logs, opamc):
    for index in (3, 4):
        path = logs / "r1" / night(index) / "cycle.parquet"
        set_clock(path, f"{night(index)}T22:00:00+00:00", scale=2 + index)
        with Run(path) as run:
            assert run.currents_sha256
            still = {name: np.zeros_like(values) for name, values in run.read(run.columns).items()}
            save_run(path, run.info, still)
        with Run(path) as run:
            assert run.currents_sha256 == ""
    assert "is a copy" not in opamc("nightly", cell, "--quiet").out


def test_a_copy_of_what_an_older_history_knows_is_one(cell, logs, opamc):
    opamc("nightly", cell)
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        for path, facts in db.execute("SELECT path, facts FROM file").fetchall():
            known = json.loads(facts)
            assert known.pop("samples")
            db.execute("UPDATE file SET facts = ? WHERE path = ?", (json.dumps(known), path))
    assert opamc("nightly", cell, "--quiet").out == ""
    shutil.copytree(logs / "r1" / night(4), logs / "r1" / night(5))
    assert "is a copy of" in opamc("nightly", cell, "--quiet").out


@pytest.mark.long
def test_a_copy_is_no_night_of_the_cell_and_is_forgotten_once_it_is_removed(cell, logs, opamc):
    opamc("nightly", cell)
    shutil.copytree(logs / "r1" / night(4), logs / "r1" / night(5))
    ended = opamc("nightly", cell, "--quiet")
    assert f"r1 {night(5)}: " in ended.out
    assert "no file of" not in ended.out
    assert "1 robot could not be judged" in opamc("nightly", cell).out
    aside = cell.parent / "aside"
    logs.rename(aside)  # a disk that is not mounted mends nothing
    assert opamc("nightly", cell, "--quiet").code == ExitCode.PARTIAL
    aside.rename(logs)
    assert opamc("nightly", cell, "--quiet").code == ExitCode.PARTIAL
    shutil.rmtree(logs / "r1" / night(5))
    ended = opamc("nightly", cell, "--json")
    assert (ended.code, json.loads(ended.out)["robots"]["r1"]["state"]) == (
        ExitCode.DONE,
        "healthy",
    )
    assert "could not be judged" not in (cell.parent / "nightly" / "index.html").read_text()
    # the same file again is told again
    shutil.copytree(logs / "r1" / night(4), logs / "r1" / night(5))
    assert f"r1 {night(5)}: " in opamc("nightly", cell, "--quiet").out
