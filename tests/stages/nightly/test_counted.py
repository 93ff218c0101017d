"""What the last line counts, and the exit code: both hold for as long as what they say."""

import json
import shutil
import sqlite3
from dataclasses import replace
from datetime import date, timedelta

import cell_logs
import pyarrow.parquet as pq
import pytest
from cell_logs import night

from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.alarms.missing import missing
from opamc_cli.stages.nightly.summary import summarise
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import NightRow
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run


def add_night(logs, index, *robots, **said):
    for number, robot in enumerate(robots):
        path = logs / robot / night(index) / "cycle.parquet"
        cell_logs.record(path, 500, 100 * number + index, **said)


def counted(cell, opamc):
    """Return the code of a quiet start, that of another, and the last line of that."""
    quiet, loud = opamc("nightly", cell, "--quiet"), opamc("nightly", cell)
    headline = loud.out.splitlines()[-1].rpartition("; ")[0]
    page = (cell.parent / "nightly" / "index.html").read_text()
    assert f"<h1>{headline}</h1>" in page
    return quiet.code, loud.code, headline


def failed(cell):
    """Return the robots that the metrics call failed."""
    lines = (cell.parent / "nightly" / "metrics.prom").read_text().splitlines()
    return [line.split('"')[1] for line in lines if "robot_failed{" in line and line[-1] == "1"]


@pytest.mark.long
def test_a_robot_that_delivers_nothing_is_not_counted_healthy(cell, logs, opamc):
    opamc("nightly", cell)
    for index in (5, 6):
        add_night(logs, index, "r3")
        said = f"1 robot without recordings: r1 since {night(5)}; 1 robot healthy"
        assert counted(cell, opamc) == (ExitCode.PARTIAL, ExitCode.PARTIAL, said)
        assert failed(cell) == ["r1"]
    robots = json.loads(opamc("nightly", cell, "--json").out)["robots"]
    assert (robots["r1"]["state"], robots["r1"]["missing_since"]) == ("missing", night(5))
    assert (robots["r3"]["state"], robots["r3"]["missing_since"]) == ("healthy", None)
    # until somebody says that it is to have none
    why = ("--why", "sold", "--cell", cell)
    assert opamc("nightly", "acknowledge", "r1", *why).code == ExitCode.DONE
    said = "1 robot without recordings, acknowledged; 1 robot healthy"
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, said)
    assert failed(cell) == []
    add_night(logs, 7, "r1", "r3")
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, "2 robots healthy")
    # it was not, after all; the second time is another one
    add_night(logs, 8, "r3")
    assert counted(cell, opamc)[0] == ExitCode.PARTIAL


def test_a_usual_day_of_rest_is_none_without_recordings(tmp_path):
    first = date(2026, 3, 2)  # a Monday
    key = {"version": "1", "config": "", "baseline": ""}

    def rows(name, days):
        dates = [(first + timedelta(day)).isoformat() for day in days]
        return [
            NightRow(name, one, json.dumps({**key, "files": [f"{name} {one}"]}), "done")
            for one in dates
        ]

    for days, state in ((21, "missing"), (35, "healthy"), (36, "missing")):  # 7 n ends on a Sunday
        rests = {"r1": rows("r1", [n for n in range(days) if n % 7 < 6 and n != 35])}
        nights = {**rests, "r2": rows("r2", range(days))}
        with History(tmp_path / f"{days}.sqlite") as history:
            for row in [*nights["r1"], *nights["r2"]]:
                history.record_night(row)
            history.replace_missing(missing(nights, {}, 7))
            (robot, _) = summarise(history).robots
        assert (robot.of_last_night or "healthy", robot.unwatched) == (state, state == "missing")


def test_nights_of_a_baseline_that_dates_give_are_those_of_a_first_one(cell, logs, opamc):
    said = "2 robots recording the baseline"
    by_first_nights = cell.read_text()
    assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
    # though the first three were a complete one before
    cell.write_text(by_first_nights.replace("nights: 3", f"from: {night(2)}, to: {night(4)}"))
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, said)
    # though another program has no recording of the last night
    lift = logs / "r3" / night(0) / "lift.parquet"
    cell_logs.record(lift, 500, 100, program="another")
    cell.write_text(by_first_nights.replace("nights: 3", f"from: {night(0)}, to: {night(4)}"))
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, said)


def test_a_night_that_is_judged_in_part_is_counted_until_the_next(cell, logs, opamc):
    (logs / "r1" / night(4) / "empty.parquet").touch()
    assert "in part not judged" in opamc("nightly", cell, "--quiet").out
    said = "1 robot judged in part: r1; 1 robot healthy"
    assert counted(cell, opamc) == (ExitCode.PARTIAL, ExitCode.PARTIAL, said)
    assert failed(cell) == ["r1"]
    add_night(logs, 5, "r1", "r3")
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, "2 robots healthy")


@pytest.mark.long
def test_a_night_with_fewer_recordings_than_those_of_the_baseline_is_judged_in_part(
    cell, logs, opamc
):
    for number, robot in enumerate(("r1", "r3")):
        for index in range(5):
            second = logs / robot / night(index) / "second.parquet"
            cell_logs.record(second, 500, 100 * number + 50 + index)
    (logs / "r1" / night(4) / "second.parquet").unlink()
    said = f"r1 {night(4)}: in part not judged: 1 recording"
    why = f"{said} of program 'cycle' where each night of the baseline has 2"
    assert why in opamc("nightly", cell, "--quiet").out
    assert counted(cell, opamc)[0] == ExitCode.PARTIAL
    # the file comes late
    cell_logs.record(logs / "r1" / night(4) / "second.parquet", 500, 54)
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, "2 robots healthy")


@pytest.mark.long
def test_a_night_without_a_program_that_each_night_of_the_baseline_has_is_judged_in_part(
    cell, logs, opamc
):
    for index in range(4):
        cell_logs.record(logs / "r1" / night(index) / "lift.parquet", 7, index, program="lift")
    said = f"r1 {night(4)}: in part not judged: no recording of program 'lift' where each night"
    assert said in opamc("nightly", cell, "--quiet").out
    assert counted(cell, opamc)[0] == ExitCode.PARTIAL
    assert failed(cell) == ["r1"]
    cell_logs.record(logs / "r1" / night(4) / "lift.parquet", 7, 4, program="lift")
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, "2 robots healthy")


@pytest.mark.long
def test_what_is_over_and_comes_again_is_said_again(cell, logs, opamc):
    lacking, of_baseline = logs / "r3" / night(4), logs / "r1" / night(0)
    shutil.rmtree(lacking)
    assert f"r3 no file of {night(4)}" in opamc("nightly", cell, "--quiet").out
    lacking.mkdir()
    (lacking / "cycle.parquet").touch()
    assert f"r3 {night(4)}: " in opamc("nightly", cell, "--quiet").out
    shutil.rmtree(lacking)
    again = opamc("nightly", cell, "--quiet")
    assert (again.code, f"r3 no file of {night(4)}" in again.out) == (ExitCode.PARTIAL, True)
    for _ in range(2):
        of_baseline.rename(cell.parent / "kept")
        assert f"r1 the recordings of the baseline's nights {night(0)} are gone" in (
            opamc("nightly", cell, "--quiet").out
        )
        assert opamc("nightly", cell, "--quiet").out == ""
        (cell.parent / "kept").rename(of_baseline)
        assert opamc("nightly", cell, "--quiet").out == ""


@pytest.mark.long
def test_a_night_that_was_judged_joins_one_that_failed_with_a_word(cell, logs, opamc):
    for index in (3, 4):
        path = logs / "r3" / night(index) / "cycle.parquet"
        path.write_bytes(b"PAR1 half a file")
        assert f"r3 {night(3)}" in opamc("nightly", cell, "--quiet").out
        again = opamc("nightly", cell, "--quiet")
        assert (again.code, again.out) == (ExitCode.DONE if index == 3 else ExitCode.PARTIAL, "")


@pytest.mark.long
def test_a_robot_that_is_gone_is_back_with_files_that_tell_no_night(cell, logs, opamc):
    shutil.rmtree(logs / "r3" / night(4))
    opamc("nightly", cell)
    opamc("nightly", "acknowledge", "r3", "--why", "scrapped", "--cell", cell)
    assert counted(cell, opamc)[0] == ExitCode.DONE
    shutil.copytree(logs / "r3" / night(3), logs / "r3" / "2061-01-01")
    assert "lies in the future" in opamc("nightly", cell, "--quiet").out
    assert counted(cell, opamc)[0] == ExitCode.PARTIAL


@pytest.mark.long
def test_a_robot_whose_next_baseline_is_recorded_is_not_watched(cell, logs, opamc):
    for index in (5, 6, 7, 8):
        add_night(logs, index, "r1", program="pick_v2")
        add_night(logs, index, "r3")
        ended = counted(cell, opamc)
        if index < 8:
            said = "1 robot not judged while a baseline is recorded: r1; 1 robot healthy"
            assert ended == (ExitCode.PARTIAL, ExitCode.PARTIAL, said)
            assert failed(cell) == ["r1"]
    assert ended == (ExitCode.DONE, ExitCode.DONE, "2 robots healthy")


def test_a_first_baseline_is_no_concern(cell, logs, opamc):
    for index in (2, 3, 4):
        for robot in ("r1", "r3"):
            shutil.rmtree(logs / robot / night(index))
    said = "2 robots recording the baseline"
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, said)
    add_night(logs, 2, "r1", "r3")  # the baseline is complete
    assert counted(cell, opamc) == (ExitCode.DONE, ExitCode.DONE, said)


def test_a_key_that_metadata_had_not_is_named_with_the_condition_that_it_makes(cell, logs, opamc):
    for path in (logs / "r1").glob("*/*.parquet"):
        with Run(path) as run:
            info = replace(run.info, speed_percent=None)
        table = pq.read_table(path)
        save_run(path, info, {name: table[name].to_numpy() for name in table.column_names})
    add_night(logs, 5, "r1")
    add_night(logs, 5, "r3", payload_kg=2.0)
    said = opamc("nightly", cell, "--quiet").out
    (line,) = (line for line in said.splitlines() if line.startswith("r1"))
    assert line.endswith("no baseline yet: 1 of 3 gathered; its metadata now say speed 100 %")
    # another value than before is no new key
    (line,) = (line for line in said.splitlines() if line.startswith("r3"))
    assert line.endswith("1 of 3 gathered")


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_a_history_that_is_lost_is_said_with_what_its_results_tell(cell, opamc):
    why = (
        "alarms of before are not known, nor what was acknowledged and which baselines were begun "
        "anew: put history.sqlite back from a copy, or declare that again\n"
    )
    nightly = cell.parent / "nightly"
    assert opamc("nightly", cell, "--quiet").code == ExitCode.UNHEALTHY
    (nightly / "r1" / night(4) / "verdict.json").write_text("half a")
    for path in nightly.glob("history.sqlite*"):
        path.unlink()
    for index in (3, 4):
        shutil.rmtree(cell.parent / "logs" / "r2" / night(index))
    assert opamc("nightly", cell, "--dry-run").code == ExitCode.DONE  # which tells nobody
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    faults = f"2 with a fault: r2 {night(4)}, r2 {night(3)}"
    lost = f"the cell: no history here, but results of 6 earlier nights, {faults}; {why}"
    assert first.out.startswith(lost)
    assert first.code == ExitCode.PARTIAL
    assert "no history" not in second.out
    assert json.loads((nightly / "r2" / night(4) / "verdict.json").read_text())["axes"]


def test_results_of_a_start_that_was_killed_are_no_lost_history(cell, logs, opamc):
    opamc("nightly", cell)
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        for table in ("night", "verdict", "measure", "baseline", "event"):
            db.execute(f"DELETE FROM {table}")
    assert opamc("nightly", cell, "--quiet").out == ""


def test_a_joint_of_which_nothing_is_known_is_no_empty_history(cell, logs, opamc):
    opamc("nightly", cell)
    for option, value in (("--axis", "9"), ("--robot", "zz")):
        ended = opamc("history", "--cell", cell, option, value)
        assert ended.code == ExitCode.BAD_INPUT
        assert f"{option} {value}: no" in ended.err
    assert "there are 1, 2" in opamc("history", "--cell", cell, "--axis", 9).err
    for more in ((), ("--events",), ("--since", "2062-03-01"), ("--robot", "r1")):
        assert opamc("history", "--cell", cell, "--axis", 1, *more).code == ExitCode.DONE
