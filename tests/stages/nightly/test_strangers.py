"""What people who do not know the program do with it, by mistake."""

import json
import os
import shutil
import sqlite3
from dataclasses import replace

import pytest
from cell_logs import night

from opamc_cli.commands.nightly.claim import claim
from opamc_cli.config.cell import load_cell
from opamc_cli.errors import ExitCode, UsageError
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import Event, NightRow

KEY = json.dumps({"version": "1", "config": "", "baseline": "", "files": []})


@pytest.fixture
def small(cell):
    """One robot in the nights of its baseline: nothing is computed."""
    for robot in ("r2", "r3"):
        shutil.rmtree(cell.parent / "logs" / robot)
    for index in (3, 4):
        shutil.rmtree(cell.parent / "logs" / "r1" / night(index))
    return cell


@pytest.mark.parametrize(
    ("out", "runs"),
    [
        ("logs", "logs/{robot}/{night}/*.parquet"),
        ("logs/../logs/", "logs/{robot}/{night}/*.parquet"),
        ("logs", "logs/{robot}/{night}/raw/*.parquet"),
        ("logs", "logs/{robot}/*/*.parquet"),
        ("logs", "logs/{robot}/**/*.parquet"),
        ("logs/nightly", "logs/{robot}/*"),
        ("logs/r1/nightly", "logs/{robot}/**/*"),
    ],
)
def test_logs_are_never_taken_for_results_nor_results_for_logs(small, opamc, out, runs):
    text = small.read_text().replace("logs/{robot}/{night}/*.parquet", runs)
    small.write_text(f"{text}out: {out}\n")
    before = {path: path.read_bytes() for path in small.parent.rglob("*") if path.is_file()}
    for more in ((), ("--dry-run",), ("--quiet",)):
        ended = opamc("nightly", small, *more)
        assert ended.code == ExitCode.USAGE
        assert "name a folder apart from the logs" in ended.err
        assert ended.err.count("\n") == 1
    after = {path: path.read_bytes() for path in small.parent.rglob("*") if path.is_file()}
    assert after == before


def test_a_baseline_of_all_robots_lies_apart_from_the_results(small, opamc):
    text = small.read_text().replace("{nights: 3}", '{runs: "normal/*"}')
    small.write_text(f"{text}robots: {{r1: {{}}}}\nout: normal\n")
    assert "name a folder apart from the logs" in opamc("nightly", small, "--dry-run").err


def test_logs_behind_a_link_are_never_taken_for_results(small, opamc):
    (small.parent / "elsewhere").symlink_to(small.parent / "logs")
    small.write_text(small.read_text() + "out: elsewhere\n")
    before = {path: path.read_bytes() for path in small.parent.rglob("*.parquet")}
    ended = opamc("nightly", small)
    assert ended.code == ExitCode.USAGE
    assert "cycle.parquet: would be removed and is no result; choose another" in ended.err
    assert {path: path.read_bytes() for path in small.parent.rglob("*.parquet")} == before


@pytest.mark.parametrize("out", ["logs/nightly", "logs/r1", "nightly"])
def test_results_that_no_pattern_takes_for_logs_may_lie_beside_them(small, opamc, out):
    small.write_text(f"{small.read_text()}out: {out}\n")
    for _ in range(2):
        assert opamc("nightly", small, "--dry-run").code == ExitCode.DONE
        ended = opamc("nightly", small, "--json")
        assert (ended.code, list(json.loads(ended.out)["robots"])) == (ExitCode.DONE, ["r1"])


@pytest.mark.parametrize(
    ("robots", "said"),
    [
        ("{}", "write auto, or every robot as a key"),
        ("[r1, r2]", "write auto, or every robot as a key"),
        ("{1: {}}", "the name 1 is read as a number; put it in quotes"),
    ],
)
def test_robots_are_named(small, opamc, robots, said):
    small.write_text(small.read_text() + f"robots: {robots}\n")
    ended = opamc("nightly", small)
    assert (ended.code, ended.out) == (ExitCode.USAGE, "")
    assert said in ended.err


def test_a_name_that_fits_no_file_is_said_and_the_others_leave_the_page(small, opamc):
    opamc("nightly", small)
    assert "r1" in (small.parent / "nightly" / "metrics.prom").read_text()
    small.write_text(small.read_text() + "robots: {r7: {}}\n")
    ended = opamc("nightly", small)
    assert ended.code == ExitCode.PARTIAL
    assert "no file of r7 fits this pattern" in ended.out
    for page in ("metrics.prom", "index.html"):
        assert "r1" not in (small.parent / "nightly" / page).read_text()


def test_names_that_are_no_text_are_their_robots_line(small, opamc):
    logs = small.parent / "logs"
    (logs / "r1").rename(logs / "Röbot 1")
    shutil.copytree(logs / "Röbot 1", logs / os.fsdecode(b"\xff2"))
    shutil.copytree(logs / "Röbot 1", logs / "a\nb\x1b[31m")
    ended = opamc("nightly", small, "--json")
    assert ended.code == ExitCode.PARTIAL
    robots = json.loads(ended.out)["robots"]
    assert robots["Röbot 1"]["failed"] == []
    for name in ("\ufffd2", "a\ufffdb\ufffd[31m"):
        why = robots[name]["failed"][0]["why"]
        assert why.endswith("its name holds control characters or is not UTF-8; rename it")
        assert why.isprintable()
    again = opamc("nightly", small)
    assert all(line.isprintable() for line in again.out.splitlines())


@pytest.mark.long
def test_joints_that_are_not_there_stay_a_failure(cell, opamc):
    for robot in ("r2", "r3"):
        shutil.rmtree(cell.parent / "logs" / robot)
    shutil.rmtree(cell.parent / "logs" / "r1" / night(4))
    cell.write_text(cell.read_text() + "robots: {r1: {axes: [7]}}\n")
    first, second = opamc("nightly", cell), opamc("nightly", cell)
    assert (first.code, second.code) == (ExitCode.PARTIAL, ExitCode.PARTIAL)
    assert "axis 7 of program 'cycle' cannot be judged" in first.out
    assert "could not be judged" in second.out


def test_two_cells_in_one_folder_are_refused(small, opamc):
    assert opamc("nightly", small).code == ExitCode.DONE
    other = small.with_name("other.yaml")
    shutil.copytree(small.parent / "logs", small.parent / "logs2")
    other.write_text(small.read_text().replace("logs", "logs2"))
    ended = opamc("nightly", other)
    assert ended.code == ExitCode.USAGE
    assert "holds the results of" in ended.err
    assert "give each cell an `out` of its own" in ended.err
    # a copy of the file, or one that took its place, is no other cell
    copy = shutil.copy(small, small.with_name("copy.yaml"))
    claim(load_cell(copy), copy)
    copy.unlink()
    claim(load_cell(other), other)
    with pytest.raises(UsageError, match="looks after other recordings"):
        claim(load_cell(small), small)


def test_a_database_of_something_else_is_left_alone(small, opamc):
    path = small.parent / "nightly" / "history.sqlite"
    path.parent.mkdir()
    with sqlite3.connect(path) as made:
        made.execute("CREATE TABLE mine (x)")
    made.close()
    assert "holds no history" in opamc("history", "--cell", small).err
    ended = opamc("nightly", small)
    assert ended.code == ExitCode.BAD_INPUT
    assert "is a database of something else; move it away" in ended.err
    with sqlite3.connect(path) as left:
        assert left.execute("SELECT name FROM sqlite_master").fetchall() == [("mine",)]


@pytest.mark.parametrize("open_elsewhere", [False, True])
def test_a_history_of_somebody_else_is_read(tmp_path, monkeypatch, open_elsewhere):
    path = tmp_path / "history.sqlite"
    writer = History(path)
    writer.record_night(NightRow("r1", "2026-03-01", KEY, "done", 0, "", ""))
    if not open_elsewhere:
        writer._db.close()
    monkeypatch.setattr("opamc_cli.storage.history.history._writable", lambda path: False)
    with History(path, read_only=True) as opened:
        assert list(opened.nights()) == [("r1", "2026-03-01")]
    writer._db.close()


def test_a_folder_that_cannot_be_written_is_called_as_the_cell_calls_it(small, opamc):
    small.write_text(small.read_text() + "out: cell.yaml\n")
    ended = opamc("nightly", small)
    assert ended.code == ExitCode.USAGE
    assert "choose another with `out` in the cell's file" in ended.err


def test_declarations_are_checked(small, opamc):
    begin = ("nightly", "rebaseline", "r1", "--cell", small, "--from")
    logs = small.parent / "logs"
    logs.rename(small.parent / "unmounted")
    opamc("nightly", small)
    assert "no night is known yet" in opamc(*begin, night(1), "--why", "oil").err
    (small.parent / "unmounted").rename(logs)
    opamc("nightly", small)
    assert "--why is blank" in opamc(*begin, night(1), "--why", " \n ").err
    assert "more than a month ahead" in opamc(*begin, "3026-03-01", "--why", "oil").err
    told = opamc(*begin, night(1), "--why", "new\n oil \x1b[31m")
    assert told.code == ExitCode.DONE
    assert told.out == f"r1 new baseline from {night(1)} on: new oil \ufffd[31m\n"
    both = opamc("nightly", small, "--night", night(1), "--since", night(2))
    assert both.code == ExitCode.USAGE
    assert "is before --since" in both.err


def test_a_robot_called_as_a_file_of_the_results_is_its_own_line(small, opamc):
    logs = small.parent / "logs"
    names = ("index.html", "Metrics.prom", "history.sqlite-wal")
    for name in names:
        shutil.copytree(logs / "r1", logs / name)
    ended = opamc("nightly", small, "--json")
    assert ended.code == ExitCode.PARTIAL
    robots = json.loads(ended.out)["robots"]
    assert robots["r1"]["done"] == [night(0), night(1), night(2)]
    for name in names:
        assert {one["night"] for one in robots[name]["failed"]} == {night(0), night(1), night(2)}
        assert f"cannot be called {name}" in robots[name]["failed"][0]["why"]
    assert "r1" in (small.parent / "nightly" / "index.html").read_text()


@pytest.mark.long
def test_a_file_that_tells_no_night_costs_no_report(small, opamc):
    logs = small.parent / "logs"
    for place in sorted((logs / "r1").glob("*/*.parquet")):
        place.rename(logs / "r1" / f"{place.parent.name}.parquet")
    small.write_text(small.read_text().replace("{night}/", "").replace("nights: 3", "nights: 2"))
    opamc("nightly", small)
    report = small.parent / "nightly" / "r1" / night(2) / "report.html"
    assert report.is_file()
    (logs / "r2").mkdir()
    for robot in ("r1", "r2"):
        (logs / robot / "a.parquet").write_text("x")
    first, second = opamc("nightly", small, "--quiet"), opamc("nightly", small, "--quiet")
    assert report.is_file()
    assert (first.code, second.code) == (ExitCode.PARTIAL, ExitCode.PARTIAL)
    assert "r1 r1/a.parquet: cannot be opened" in first.out
    assert "r2 r2/a.parquet: cannot be opened" in first.out
    assert second.out == ""
    (logs / "r2" / "b.parquet").write_text("x")
    assert "r2/b.parquet): cannot be opened" in opamc("nightly", small, "--quiet").out


def test_a_night_that_fails_for_another_reason_is_told_anew(tmp_path):
    failed = NightRow("r1", night(0), KEY, "broken", 1, "took longer than 5 s (limits.seconds)")
    told = [Event(night(0), "r1", None, "failed", "")]
    with History(tmp_path / "history.sqlite") as history:
        history.record_night(failed)
        history.tell(told)
        history.record_night(replace(failed, attempts=2))
        assert history.untold(told) == []
        history.record_night(replace(failed, status="failed", why="cannot be opened"))
        assert history.untold(told) == told
