"""Recordings that were put under another robot than the one that was recorded."""

import json
import shutil
import sqlite3
from dataclasses import replace

import pyarrow.parquet as pq
import pytest
from cell_logs import night

from opamc_cli.errors import ExitCode
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from tests.marks import long


def states(cell, robot):
    """Return what became of every night of a robot."""
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        query = "SELECT status FROM night WHERE robot = ? ORDER BY night"
        return [status for (status,) in db.execute(query, [robot]).fetchall()]


def run_of(logs, robot, index):
    """Return where a robot's recording of a night lies."""
    return logs / robot / night(index) / "cycle.parquet"


def set_robot(path, robot):
    """Have a recording say that it is of a robot."""
    with Run(path) as run:
        info = replace(run.info, robot=robot)
    table = pq.read_table(path)
    save_run(path, info, {name: table[name].to_numpy() for name in table.column_names})


def short(path):
    """Return a recording's file and folder: the robot stands before it."""
    return "/".join(path.parts[-2:])


GOOD = ["baseline"] * 3 + ["done"] * 2


@pytest.mark.long
def test_of_two_new_copies_neither_is_judged_until_one_is_gone(cell, logs, opamc):
    one, other = run_of(logs, "r1", 4), run_of(logs, "r3", 4)
    other.rename(logs / "kept")
    shutil.copy(one, other)
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    for robot, path, twin, its in (("r1", one, other, "r3"), ("r3", other, one, "r1")):
        said = (
            f"{robot} {night(4)}: {short(path)}: has the same bytes as {twin} of {its}; remove it"
        )
        assert said in ended.out
        assert states(cell, robot) == [*GOOD[:4], "failed"]
    again = opamc("nightly", cell, "--quiet")
    assert (again.code, again.out) == (ExitCode.PARTIAL, "")
    (logs / "kept").replace(other)
    assert opamc("nightly", cell).code == ExitCode.DONE
    assert (states(cell, "r1"), states(cell, "r3")) == (GOOD, GOOD)


@pytest.mark.long
def test_what_was_judged_stays_its_robots_where_a_copy_turns_up(cell, logs, opamc):
    late = run_of(logs, "r3", 4)
    late.rename(logs / "kept")
    opamc("nightly", cell)
    late.parent.mkdir(exist_ok=True)
    shutil.copy(run_of(logs, "r1", 0), late)  # one of a baseline
    ended = opamc("nightly", cell, "--robot", "r3", "--json")
    assert ended.code == ExitCode.PARTIAL
    (failed,) = json.loads(ended.out)["robots"]["r3"]["failed"]
    whose = f"{run_of(logs, 'r1', 0)} of r1, whose it is"
    assert failed == {"night": night(4), "why": f"{short(late)}: has the same bytes as {whose}"}
    (logs / "kept").replace(late)
    assert opamc("nightly", cell).code == ExitCode.DONE
    assert (states(cell, "r1"), states(cell, "r3")) == (GOOD, GOOD)


@pytest.mark.long
def test_one_of_several_files_of_a_night_is_left_out_and_taken_once_it_is_alone(cell, logs, opamc):
    more = run_of(logs, "r1", 4).with_name("more.parquet")
    run_of(logs, "r3", 3).rename(more)
    run_of(logs, "r3", 4).unlink()
    copy = logs / "r3" / night(4) / "more.parquet"
    shutil.copy(more, copy)
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, states(cell, "r1")[-1]) == (ExitCode.PARTIAL, "partial")
    copy.unlink()
    opamc("nightly", cell)
    assert states(cell, "r1")[-1] == "done"


def test_the_metadata_tells_whose_a_recording_is(cell, logs, opamc):
    opamc("nightly", cell)
    one, other = run_of(logs, "r1", 4), run_of(logs, "r3", 4)
    set_robot(one, "r3")
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert f"{short(one)}: is of r3 by its metadata; move it there" in ended.out
    assert states(cell, "r1")[-1] == "failed"
    shutil.copy(one, other)
    ended = opamc("nightly", cell, "--quiet")
    assert f"{short(one)}: has the same bytes as {other} of r3, whose it is" in ended.out
    assert states(cell, "r3") == GOOD
    set_robot(one, "UR10 20195500123")  # no robot of the cell: a name of its own
    assert opamc("nightly", cell).code == ExitCode.DONE


def test_a_baseline_that_names_several_robots_is_said_once(cell, logs, opamc):
    for index, name in enumerate(("UR-1", "UR-2", "UR-1")):
        set_robot(run_of(logs, "r1", index), name)
    first, second = (opamc("nightly", cell, "--quiet") for _ in range(2))
    assert (first.code, second.code, second.out) == (ExitCode.DONE, ExitCode.DONE, "")
    several = f"({run_of(logs, 'r1', 0)} UR-1, {run_of(logs, 'r1', 1)} UR-2); it is of one"
    assert f"r1 its baseline: its recordings name several robots {several}" in first.out


def lay_apart(cell, logs):
    """Lay the baselines of both robots apart, and have the cell's file name them."""
    for robot in ("r1", "r3"):
        for index in range(3):
            place = cell.parent / "normal" / robot / f"{index}.parquet"
            place.parent.mkdir(parents=True, exist_ok=True)
            run_of(logs, robot, index).rename(place)
    text = cell.read_text().replace("{nights: 3}", '{runs: "normal/{robot}/*.parquet"}')
    cell.write_text(text)
    return text


@pytest.mark.parametrize("asked", [(), long(("--robot", "r3"))])
def test_a_night_that_is_a_copy_of_another_robots_baseline_is_not_judged(cell, logs, opamc, asked):
    lay_apart(cell, logs)
    late = run_of(logs, "r3", 4)
    late.rename(logs / "kept")
    opamc("nightly", cell)
    late.parent.mkdir(exist_ok=True)
    shutil.copy(cell.parent / "normal/r1/0.parquet", late)
    ended = opamc("nightly", cell, *asked, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert f"{short(late)}: has the same bytes as" in ended.out
    assert "normal/r1/0.parquet of r1; remove it where it was not recorded" in ended.out
    assert states(cell, "r3")[-1] == "failed"
    (logs / "kept").replace(late)
    assert opamc("nightly", cell).code == ExitCode.DONE


@pytest.mark.long
def test_a_baseline_that_is_a_copy_of_another_robots_night_is_said_once(cell, logs, opamc):
    lay_apart(cell, logs)
    opamc("nightly", cell)
    shutil.copy(run_of(logs, "r1", 4), cell.parent / "normal/r3/0.parquet")
    first, second = (opamc("nightly", cell, "--quiet") for _ in range(2))
    copied = f"has the same bytes as {run_of(logs, 'r1', 4)} of r1"
    assert f"r3 its baseline: {cell.parent / 'normal/r3/0.parquet'} {copied}" in first.out
    assert states(cell, "r1")[-1] == "done"
    assert second.out == ""


@pytest.mark.long
def test_a_baseline_that_another_robot_has_as_well_is_said_once(cell, logs, opamc):
    text = lay_apart(cell, logs)
    shutil.copy(cell.parent / "normal/r1/0.parquet", cell.parent / "normal/r3/0.parquet")
    first, second = (opamc("nightly", cell, "--quiet") for _ in range(2))
    assert "normal/r1/0.parquet of r1" in first.out
    assert "normal/r3/0.parquet of r3" in first.out
    assert (first.code, second.code, second.out) == (ExitCode.DONE, ExitCode.DONE, "")
    # a file that is named for all robots is no copy
    cell.write_text(
        text.replace("normal/{robot}", "normal/r1").replace(
            "runs: logs", "robots: {r1: {}, r3: {}}\nruns: logs"
        )
    )
    assert "same bytes" not in opamc("nightly", cell, "--quiet").out
