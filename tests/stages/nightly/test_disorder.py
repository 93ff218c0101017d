"""Logs as they are: late, lost, closed, half written, with wrong clocks. Nothing is silent."""

import json
import os
import shlex
import shutil
import sqlite3
from datetime import UTC, date, datetime, timedelta

import numpy as np
import pyarrow.parquet as pq
import pytest
from cell_logs import night

from opamc_cli.config.cell import load_cell
from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.alarms.missing import missing
from opamc_cli.stages.nightly.morning import silent
from opamc_cli.stages.nightly.start import run as stage
from opamc_cli.stages.nightly.summary import summarise
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import NightRow
from opamc_cli.storage.logs import LogFile, read_facts
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run
from tests.stages.nightly.changed_logs import add_night, set_clock, states

KEY = json.dumps({"version": "1", "config": "", "baseline": "", "files": []})
GONE = "if they are to have none: opamc nightly acknowledge"


def test_a_clock_that_tells_no_night_is_said_until_it_is_set(cell, logs, opamc):
    for path in sorted(logs.glob("*/*/*.parquet")):
        path.rename(logs / path.parent.parent.name / f"{path.parent.name}.parquet")
    cell.write_text(cell.read_text().replace("{night}/", ""))
    last = logs / "r1" / f"{night(4)}.parquet"
    for year, said in (("1970", "is one of a clock not set"), ("2970", "lies in the future")):
        set_clock(last, f"{year}-03-05T22:00:00+00:00")
        first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
        assert (first.code, second.code) == (ExitCode.PARTIAL, ExitCode.PARTIAL)
        assert f"r1 r1/{last.name}: its night {year}-03-05 {said}; check the clock" in first.out
        assert second.out == ""
        # neither the first night of the baseline, nor a last one that no other can follow
        assert states(cell) == ["failed", "baseline", "baseline", "baseline", "done"]
        assert "could not be judged" in (cell.parent / "nightly" / "index.html").read_text()
    # judged as a night, it had all other robots missed
    set_clock(last, (datetime.now(UTC) + timedelta(hours=26)).isoformat(timespec="seconds"))
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert "which lies in the future; check the clock" in ended.out
    assert "no file of" not in ended.out
    set_clock(last, f"{night(4)}T22:00:00+00:00")
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, ended.out) == (ExitCode.DONE, "")
    assert states(cell) == ["baseline", "baseline", "baseline", "done", "done"]


def test_a_folder_of_a_night_that_no_clock_tells_is_none_of_the_baseline(cell, logs, opamc):
    (logs / "r1" / night(0)).rename(logs / "r1" / "1970-01-01")
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert "its night 1970-01-01 is one of a clock not set" in ended.out
    assert states(cell) == ["failed", "baseline", "baseline", "baseline", "done"]


def test_a_long_streak_that_is_heard_of_late_is_one_line(cell, logs, opamc):
    shutil.rmtree(logs / "r3")
    for index in range(5, 40):
        (logs / "r1" / night(index)).mkdir()
        (logs / "r1" / night(index) / "cycle.parquet").write_text("half a file")
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    (line,) = ended.out.splitlines()
    assert line.startswith(f"r1 {night(5)} to {night(39)} (35 nights in a row): ")
    assert "cannot be opened" in line
    assert opamc("nightly", cell, "--quiet").out == ""


def test_hundreds_of_broken_files_are_one_short_line(cell, logs, opamc):
    for index in range(200):
        (logs / "r1" / night(4) / f"{index:03d}.parquet").write_text("half a file")
    (line,) = (one for one in opamc("nightly", cell, "--quiet").out.splitlines() if "r1" in one)
    names = ", ".join(f"{night(4)}/00{index}.parquet" for index in range(3))
    assert f": 200 recordings ({names} and 197 more): cannot be opened" in line
    assert len(line) < 400


@pytest.mark.long
def test_robots_without_files_are_one_line_and_reminded_of(cell, logs, opamc):
    for name in ("r4", "r5"):
        shutil.copytree(logs / "r1", logs / name)
        for path in (logs / name).glob("*/*.parquet"):
            set_clock(path, f"{path.parent.name}T22:00:0{name[1]}+00:00")
    for name in ("r1", "r4", "r5"):
        shutil.rmtree(logs / name / night(4))
    said = opamc("nightly", cell, "--quiet").out
    end = f"{GONE} ROBOT --why TEXT --cell {cell}"
    assert said == f"r1, r4, r5 no file of {night(4)}; others have some; {end}\n"
    for index in range(5, 15):
        path = shutil.copytree(logs / "r3" / night(4), logs / "r3" / night(index))
        set_clock(path / "cycle.parquet", f"{night(index)}T22:00:00+00:00")
        said = opamc("nightly", cell, "--quiet").out
        gone = f"r1, r4, r5 no file of {night(4)} to {night(index)}; others have some"
        # the first weekday that they are known to have had, then the alarm's remind_after
        assert (gone in said) == (index in (7, 14))


def lacks(own, days=70):
    """Return what is said of a robot with files of some days, beside one that has files of all."""

    def nights(name, of):
        first = date(2026, 3, 1)  # a Sunday
        dates = [(first + timedelta(day)).isoformat() for day in of]
        key = {"version": "1", "config": "", "baseline": ""}
        return [
            NightRow(name, one, json.dumps({**key, "files": [f"{name} {one}"]}), "done")
            for one in dates
        ]

    rows = {"r1": nights("r1", own), "r2": nights("r2", range(days))}
    return [(event.time, event.text) for event in missing(rows, {}, 7)]


def test_the_weekday_on_which_a_robot_rests_is_not_said_for_ever():
    rests = [day for day in range(1, 70) if day % 7]
    said = lacks(rests)
    assert [time for time, _ in said] == [f"2026-03-{day:02d}" for day in (8, 15, 22, 29)]
    habit = "others have some, as in the 3 weeks before; this weekday is not said again"
    assert said[-1][1] == f"no file of 2026-03-29; {habit}"
    # so with weekends, but not with what goes on after them, nor with another day
    weekends = [day for day in range(1, 70) if day % 7 not in (0, 6)]
    assert [time for time, _ in lacks(weekends)] == [f"2026-03-{n:02d}" for n in (7, 14, 21, 28)]
    assert len({text for _, text in lacks([day for day in rests if day != 57])}) == 5
    assert len(lacks([day for day in rests if day != 53])) == 5
    # weeks without any file are no habit
    back = [day for day in range(1, 70) if not 7 <= day < 42 and day != 49]
    assert lacks(back)[-1] == ("2026-04-19", "no file of 2026-04-19; others have some")


def test_a_robot_that_is_dead_after_its_free_day_is_said_again_once():
    """Off on Saturday 7 March, dead from Monday on: nothing was said until Saturday 14."""

    def times(own):
        return [time[-2:] for time, _ in lacks(own, days=17)]

    assert times(range(1, 6)) == ["07", "09", "16"]
    # dead from Friday on is said once, whatever days follow
    assert times([*range(1, 6), *range(8, 12)]) == ["07", "13"]
    assert times([*range(1, 6), *range(8, 13)]) == ["07", "14", "16"]
    # of a Saturday that used to have files it is said that there are none, and no more then
    assert times([*range(7), *range(8, 13)]) == ["08", "14"]


@pytest.mark.long
def test_a_renamed_robot_is_reminded_of_until_somebody_says_that_it_is_gone(cell, logs, opamc):
    shutil.rmtree(logs / "r1" / night(4))
    assert "r1 no file of" in opamc("nightly", cell, "--quiet").out
    why = ("--why", "is called r7 now", "--cell", cell)
    assert opamc("nightly", "acknowledge", "r3", *why).code == ExitCode.USAGE
    assert opamc("nightly", "acknowledge", "r1", *why).code == ExitCode.DONE
    for index in range(5, 14):
        path = shutil.copytree(logs / "r3" / night(4), logs / "r3" / night(index))
        set_clock(path / "cycle.parquet", f"{night(index)}T22:00:00+00:00")
    assert "r1" not in opamc("nightly", cell, "--quiet").out
    # it was not, after all
    path = shutil.copytree(logs / "r1" / night(3), logs / "r1" / night(12))
    set_clock(path / "cycle.parquet", f"{night(12)}T22:00:00+00:00")
    assert f"r1 no file of {night(13)}" in opamc("nightly", cell, "--quiet").out


def test_a_robot_that_never_had_a_file_is_acknowledged_by_the_line_that_says_so(cell, logs, opamc):
    """The command of the morning's line works as it stands, whatever the robot is called."""
    cell.write_text(cell.read_text() + "robots: {r1: {}, r3: {}, KR 6 Süd: {}}\n")
    first = opamc("nightly", cell, "--quiet")
    assert first.code == ExitCode.PARTIAL
    command = f"opamc nightly acknowledge 'KR 6 Süd' --why TEXT --cell {cell}"
    assert first.out == f"KR 6 Süd no file at all; if they are to have none: {command}\n"
    ended = opamc(*shlex.split(command)[1:])
    assert (ended.code, ended.out) == (0, "KR 6 Süd no file at all, acknowledged: TEXT\n")
    for _ in range(2):
        again = opamc("nightly", cell)
        assert again.code == ExitCode.DONE
        assert again.out.startswith("1 robot without recordings, acknowledged; 2 robots healthy")
    # until it has some
    shutil.copytree(logs / "r1" / night(3), logs / "KR 6 Süd" / night(3))
    set_clock(logs / "KR 6 Süd" / night(3) / "cycle.parquet", f"{night(3)}T22:00:06+00:00")
    shutil.copytree(logs / "KR 6 Süd" / night(3), logs / "KR 6 Süd" / night(5))
    set_clock(logs / "KR 6 Süd" / night(5) / "cycle.parquet", f"{night(5)}T22:00:06+00:00")
    assert "acknowledged" not in opamc("nightly", cell).out


def test_a_robot_that_is_none_of_the_cell_s_is_not_acknowledged(cell, logs, opamc):
    opamc("nightly", cell, "--quiet")
    said = {
        ("r7",): "r7 is none of the cell's robots; it has r1, r3",
        ("r7", "--axis", 1): "r7 is none of the cell's robots; it has r1, r3",
        ("r1",): "r1 lacks no file of the last night; name the joint by --axis",
    }
    for of, sentence in said.items():
        ended = opamc("nightly", "acknowledge", *of, "--why", "x", "--cell", cell)
        assert (ended.code, ended.sentences) == (ExitCode.USAGE, [f"opamc: {sentence}"])
    shutil.copytree(logs / "r3" / night(4), logs / "r4" / "2061-01-01")
    opamc("nightly", cell, "--quiet")
    ended = opamc("nightly", "acknowledge", "r4", "--why", "x", "--cell", cell)
    assert "r4 has files that tell no night; there is nothing to acknowledge" in ended.err


def test_a_silent_cell_is_said_again(tmp_path):
    with History(tmp_path / "history.sqlite") as history:
        history.record_night(NightRow("r1", "2026-03-01", KEY, "done", 0, "", ""))
        times = [
            [event.time for event in silent(history, date(2026, 3, day), 7)]
            for day in (4, 5, 11, 12, 19)
        ]
    assert times == [[], ["2026-03-01"], ["2026-03-01"], ["2026-03-08"], ["2026-03-15"]]


@pytest.mark.long
def test_a_baseline_that_loses_nights_is_said_before_it_is_too_late(cell, logs, opamc):
    opamc("nightly", cell)
    shutil.move(logs / "r1" / night(1), cell.parent / "aside")
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert first.code == ExitCode.DONE
    assert first.out == (
        f"r1 the recordings of the baseline's nights {night(1)} are gone, 2 nights are left; put "
        "them back, with fewer than 2 nothing is judged\n"
    )
    assert second.out == ""
    # no verdict of before is another one now, though its baseline is not whole or even gone
    shutil.rmtree(logs / "r1" / night(0))
    for robot in ("r1", "r3"):
        add_night(logs, 5, robot)
    gone = opamc("nightly", cell, "--quiet")
    assert gone.code == ExitCode.PARTIAL
    assert f"r1 {night(5)}: the recordings of the baseline's nights" in gone.out
    assert states(cell) == ["baseline"] * 3 + ["done"] * 2 + ["failed"]
    shutil.move(cell.parent / "aside", logs / "r1" / night(1))
    assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
    assert states(cell) == ["baseline"] * 3 + ["done"] * 3


@pytest.mark.parametrize(
    "rule", ["from: 2026-03-01, to: 2026-03-03", "runs: 'good/{robot}/*.parquet'"]
)
def test_a_baseline_of_dates_or_files_that_loses_nights_leaves_verdicts(cell, logs, opamc, rule):
    shutil.rmtree(logs / "r3")
    good = cell.parent / "good" / "r1"
    good.mkdir(parents=True)
    for index in (0, 1, 2):
        shutil.copy(logs / "r1" / night(index) / "cycle.parquet", good / f"{index}.parquet")
    cell.write_text(cell.read_text().replace("nights: 3", rule))
    assert opamc("nightly", cell).code == ExitCode.DONE
    before = states(cell)
    for index, lost in ((1, "2 nights are left"), (0, "")):
        shutil.rmtree(logs / "r1" / night(index))
        (good / f"{index}.parquet").unlink()
        assert "0 nights to be done" in opamc("nightly", cell, "--dry-run").out
        first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
        assert (first.code, second.code, second.out) == (ExitCode.DONE, ExitCode.DONE, "")
        assert lost in first.out
        assert states(cell) == before
    add_night(logs, 5)
    failed = opamc("nightly", cell, "--quiet")
    assert failed.code == ExitCode.PARTIAL
    assert "are gone; put them back" in failed.out


@pytest.mark.long
@pytest.mark.parametrize("rule", ["nights: 3", "runs: 'good/{robot}/*.parquet'"])
def test_a_baseline_that_loses_one_recording_of_a_night_leaves_verdicts(cell, logs, opamc, rule):
    shutil.rmtree(logs / "r3")
    cell.write_text(cell.read_text().replace("nights: 3", rule))
    good = cell.parent / "good" / "r1"
    good.mkdir(parents=True)
    places = {}
    for index in (0, 1, 2):
        folder = logs / "r1" / night(index)
        # nights that differ in number: none lacks any
        for name in ("second", "third")[: 1 + (index < 2)]:
            set_clock(folder / "cycle.parquet", f"{night(index)}T23:0{len(name) - 5}:00+00:00")
            places[index, name] = folder / f"{name}.parquet"
            if "runs" in rule:
                places[index, name] = good / f"{index}-{name}.parquet"
            shutil.copy(folder / "cycle.parquet", places[index, name])
        set_clock(folder / "cycle.parquet", f"{night(index)}T22:00:00+00:00")
        shutil.copy(folder / "cycle.parquet", good / f"{index}-first.parquet")
    aside = cell.parent / "aside.parquet"

    def to_do():
        return opamc("nightly", cell, "--dry-run").out.splitlines()[-1].split()[0]

    assert opamc("nightly", cell).code == ExitCode.DONE
    assert to_do() == "0"
    shutil.move(places[0, "second"], aside)
    assert to_do() == "0"
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert first.out.startswith("r1 its baseline has lost ")
    assert f"{places[0, 'second'].name}; what was judged stays" in first.out
    assert (first.code, second.code, second.out) == (ExitCode.DONE, ExitCode.DONE, "")
    add_night(logs, 5)
    opamc("nightly", cell)
    places[0, "third"].unlink()  # one more, which all nights were judged with
    again = opamc("nightly", cell, "--quiet")
    assert again.out.count(places[0, "third"].name) == 1
    assert to_do() == "0"
    shutil.move(aside, places[0, "second"])  # the last night was judged without it
    assert to_do() == "1"
    opamc("nightly", cell)
    # another recording in the place of one that is gone is another baseline
    places[1, "second"].rename(places[1, "second"].with_name("other.parquet"))
    set_clock(places[1, "second"].with_name("other.parquet"), f"{night(1)}T22:30:00+00:00")
    assert int(to_do()) >= 3


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_a_baseline_s_recording_of_which_a_part_is_lost_is_said_once(cell, opamc):
    logs = cell.parent / "logs"
    for robot in ("r2", "r3"):
        shutil.rmtree(logs / robot)
    path = logs / "r1" / night(1) / "cycle.parquet"
    with Run(path) as run:
        info = run.info
    table = pq.read_table(path)
    columns = {name: table[name].to_numpy().copy() for name in table.column_names}
    columns["axis1_a"][: len(table) // 5] = np.nan
    save_run(path, info, columns)
    first, second = _baseline_first(cell, opamc)
    assert (first.code, second.code, second.out) == (ExitCode.DONE, ExitCode.DONE, "")
    assert f"r1 its baseline: {night(1)}/cycle.parquet: 20% of the current of axis 1" in first.out
    assert states(cell) == ["baseline"] * 3 + ["done"] * 2


def _baseline_first(cell, opamc):
    """Start once before the last night is there, and once with it."""
    last, aside = cell.parent / "logs" / "r1" / night(4), cell.parent / "aside"
    last.rename(aside)
    first = opamc("nightly", cell, "--quiet")
    aside.rename(last)
    return first, opamc("nightly", cell, "--quiet")


@pytest.mark.usefixtures("here", "undrawn")
def test_a_joint_s_baseline_that_lacks_one_night_is_said_once_and_no_night_is_partial(cell, opamc):
    """Each night of a healthy robot was judged in part, exit code 4, for as long as it lasted."""
    logs = cell.parent / "logs"
    for robot in ("r2", "r3"):
        shutil.rmtree(logs / robot)
    _freeze(logs / "r1" / night(1) / "cycle.parquet")
    first, second = _baseline_first(cell, opamc)
    assert (first.code, second.code, second.out) == (ExitCode.DONE, ExitCode.DONE, "")
    assert first.out.count("Only axis 2 of this recording is left out") == 1
    assert first.out.startswith("r1 its baseline: ")
    assert f"{night(1)}/cycle.parquet: axis2_b keeps one value" in first.out
    assert states(cell) == ["baseline"] * 3 + ["done"] * 2


@pytest.mark.usefixtures("here", "undrawn")
def test_joints_that_a_lost_part_is_not_of_are_healthy(cell, opamc):
    logs = cell.parent / "logs"
    for robot in ("r2", "r3"):
        shutil.rmtree(logs / robot)
    place = logs / "r1" / night(4)
    shutil.copy(place / "cycle.parquet", place / "more.parquet")
    set_clock(place / "more.parquet", f"{night(4)}T23:00:00+00:00", scale=1.001)
    _freeze(place / "more.parquet")
    broken = shutil.copy(place / "cycle.parquet", place / "none.parquet")
    set_clock(broken, f"{night(4)}T23:10:00+00:00", scale=1.002)
    with Run(broken) as run:
        info, columns = run.info, run.read(run.columns)
    save_run(broken, info, columns | {"axis2_a": np.full_like(columns["axis2_a"], 0.5)})
    robot = json.loads(opamc("nightly", cell, "--json").out)["robots"]["r1"]
    (reason,) = robot["reasons"]
    assert "axis2_a is constant" in reason["text"]
    assert (robot["state"], reason["kind"], reason["night"]) == ("partial", "partial", night(4))
    assert "Only axis 2 of this recording is left out" in reason["text"]
    with History(cell.parent / "nightly" / "history.sqlite") as history:
        (found,) = summarise(history).robots
    assert [found.shown_of(joint) for joint in found.joints] == ["healthy", "partial"]
    of_night = ("history", "--cell", cell, "--since", night(4), "--json")
    rows = json.loads(opamc(*of_night).out)["verdict"]
    assert [(row["excused"], row["in_part"]) for row in rows] == [(False, False), (False, True)]
    assert all("healthy sessions" in row["reason"] or "too" in row["reason"] for row in rows)


def _freeze(path):
    """Have one current of axis 2 stand still half way."""
    with Run(path) as run:
        info, columns = run.info, run.read(run.columns)
    values = columns["axis2_b"].copy()
    values[len(values) // 2 :] = values[len(values) // 2]
    save_run(path, info, columns | {"axis2_b": values})


@pytest.mark.long
def test_verdicts_that_change_afterwards_are_said(cell, logs, opamc):
    opamc("nightly", cell)
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        db.execute("UPDATE verdict SET state = 'fault' WHERE robot = 'r1' AND axis = 1")
    cell.write_text(cell.read_text().replace("joint.explain: false", "score.seed: 1"))
    said = [f"{night(n)} axis 1 healthy, was fault (other options)" for n in (3, 4)]
    # a start that is killed before it says so leaves it to the next one
    loaded = load_cell(cell)
    with stage.open_history(loaded) as history:
        stage.run(loaded, str(cell), history, stage.Wanted())
    assert opamc("nightly", cell, "--quiet").out == f"r1 judged anew: {', '.join(said)}\n"
    assert opamc("nightly", cell, "--quiet").out == ""


def test_a_robot_that_the_last_line_counts_is_named_and_judged_by_what_is_in_force(
    cell, logs, opamc
):
    opamc("nightly", cell)
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        db.execute(
            f"UPDATE verdict SET state = 'fault' WHERE robot = 'r3' AND night = '{night(4)}'"
        )
    headline = "1 robot with a fault in the last night, no alarm yet: r3; 1 robot healthy"
    assert opamc("nightly", cell).out.startswith(headline)
    add_night(logs, 5, "r3")
    begin = ("nightly", "rebaseline", "r3", "--from", night(5), "--why", "x", "--cell", cell)
    assert opamc(*begin).code == ExitCode.DONE
    ended = opamc("nightly", cell)
    missing = f"1 robot without recordings: r1 since {night(5)}"
    assert f"{missing}; 1 robot recording the baseline; " in ended.out
    assert 'opamc_joint_state{robot="r3"' not in (cell.parent / "nightly/metrics.prom").read_text()


@pytest.mark.long
def test_joints_that_could_not_be_judged_are_no_good_night(cell, logs, opamc):
    assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
    unjudged = "UPDATE verdict SET state = 'insufficient-data' WHERE robot = 'r1' AND axis = 2"
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        db.execute(f"{unjudged} AND night = '{night(4)}'")
        db.execute("INSERT INTO stale VALUES ('r1')")
    first, second = (opamc("nightly", cell, "--quiet") for _ in range(2))
    assert first.out.startswith(f"r1 axis 2: not judged since {night(4)}:")
    assert (first.code, second.code, second.out) == (ExitCode.PARTIAL, ExitCode.PARTIAL, "")
    assert "1 robot with a joint that was not judged: r1" in opamc("nightly", cell).out
    # until the next night
    for robot in ("r1", "r3"):
        add_night(logs, 5, robot)
    assert opamc("nightly", cell).code == ExitCode.DONE


@pytest.mark.long
def test_a_longer_or_shorter_baseline_is_taken_from_the_cell_s_file(cell, logs, opamc):
    opamc("nightly", cell)
    for nights, done in ((4, 1), (6, 1), (2, 3)):  # six nights are not there yet
        cell.write_text(
            "runs: logs/{robot}/{night}/*.parquet\n" + f"baseline: {{nights: {nights}}}\n"
        )
        assert opamc("nightly", cell).code == ExitCode.DONE
        assert states(cell) == ["baseline"] * (5 - done) + ["done"] * done
    # a night that is filled in moves nothing
    path = shutil.copytree(logs / "r1" / night(0), logs / "r1" / "2026-02-28")
    set_clock(path / "cycle.parquet", "2026-02-28T22:00:00+00:00")
    opamc("nightly", cell)
    assert states(cell) == ["done", "baseline", "baseline", "done", "done", "done"]


def test_a_robot_whose_only_night_is_gone_lacks_what_others_have(cell, logs, opamc):
    (logs / "r1" / night(5)).mkdir()
    (logs / "r1" / night(5) / "cycle.parquet").write_text("half a file")
    assert "r3 no file of" in opamc("nightly", cell, "--quiet").out  # r1 was there


def test_a_robot_that_left_the_cell_is_none_of_the_others_with_files(cell, logs, opamc):
    (logs / "r1" / night(5)).mkdir()
    (logs / "r1" / night(5) / "cycle.parquet").write_text("half a file")
    rows = (cell.read_text(), "robots: {r1: {}, r2: {}, r3: {}}\n", "robots: {r2: {}, r3: {}}\n")
    lacking = []
    for named in rows[1:]:
        cell.write_text(rows[0] + named)
        opamc("nightly", cell, "--quiet")
        with History(cell.parent / "nightly" / "history.sqlite") as history:
            said = [one for one in history.events() if one.kind == "missing"]
        lacking.append({one.robot for one in said if night(5) in one.text})
    assert lacking == [{"r3"}, set()]


def test_a_robot_that_the_cell_does_not_name_is_said_once(cell, logs, opamc):
    """Its recordings lay there for ever, and nobody said that nothing watches it."""
    cell.write_text(cell.read_text() + "robots: {r1: {}}\n")
    (logs / "lost+found").mkdir()
    planned = opamc("nightly", cell, "--dry-run")
    said = f"r3 not named by the cell's file: recordings in {logs / 'r3'} are not judged; name"
    assert said in planned.out
    assert json.loads(opamc("nightly", cell, "--dry-run", "--json").out)["unnamed"] == ["r3"]
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert (first.code, second.code, second.out) == (ExitCode.PARTIAL, ExitCode.DONE, "")
    assert first.out.startswith(said)
    # another one is news, and one line
    for robot in ("r4", "r5"):
        shutil.copytree(logs / "r3", logs / robot)
    third = opamc("nightly", cell, "--quiet")
    assert (third.code, third.out.count("\n")) == (ExitCode.PARTIAL, 1)
    assert third.out.startswith(f"r4, r5 not named by the cell's file: recordings in {logs / 'r4'}")


@pytest.mark.long
def test_recordings_of_a_folder_that_is_no_night_are_said(cell, logs, opamc):
    opamc("nightly", cell)
    odd = logs / "r1" / "mar-06"
    shutil.copytree(logs / "r1" / night(4), odd)
    shutil.copytree(logs / "r1" / night(4), logs / "r9" / "mar-06")
    said = f"r1 {odd}: no night by name"
    planned = opamc("nightly", cell, "--dry-run")
    assert said in planned.out
    assert json.loads(opamc("nightly", cell, "--dry-run", "--json").out)["strays"] == [
        str(odd),
        str(logs / "r9" / "mar-06"),
    ]
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert (first.code, second.code, second.out) == (ExitCode.PARTIAL, ExitCode.DONE, "")
    assert said in first.out
    assert f"r9 {logs / 'r9' / 'mar-06'}: no night by name" in first.out
    # one more is said, too
    odd.rename(logs / "r1" / "mar-07")
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, "mar-07: no night by name" in ended.out) == (ExitCode.PARTIAL, True)
    # those of the baseline are named
    text = cell.read_text().replace("{nights: 3}", '{runs: "logs/{robot}/mar-07/*.parquet"}')
    cell.write_text(text + "robots: {r1: {}, r3: {}}\n")
    assert "no night by name" not in opamc("nightly", cell, "--dry-run").out
    shutil.rmtree(cell.parent / "nightly")
    for name in ("r1", "r3"):
        shutil.rmtree(logs / name)
    shutil.copytree(logs / "r9", logs / "r1")
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.BAD_INPUT
    assert f"{logs / 'r1' / 'mar-06'}: no night by name" in ended.err


@pytest.mark.long
def test_results_that_were_removed_are_made_again_or_said_to_be_gone(cell, logs, opamc):
    opamc("nightly", cell)
    results = cell.parent / "nightly" / "r1"
    for index in (3, 4):
        shutil.rmtree(results / night(index))
    planned = opamc("nightly", cell, "--dry-run").out
    assert f"r1 {night(4)}: its results were removed" in planned
    shutil.rmtree(logs / "r1" / night(3))  # of which nothing can be made any more
    # a start that is killed before it says so leaves it to the next one
    loaded = load_cell(cell)
    with stage.open_history(loaded) as history:
        stage.run(loaded, str(cell), history, stage.Wanted())
    ended = opamc("nightly", cell, "--quiet")
    assert (results / night(4) / "report.html").is_file()
    assert ended.out.count("\n") == 1
    assert (
        f"r1 the results of {night(3)} are gone, and not all that they were made from is left"
        in ended.out
    )
    assert f"r1/{night(3)}/report.html" not in (results.parent / "index.html").read_text()
    again = opamc("nightly", cell, "--quiet")
    assert (again.code, again.out) == (ExitCode.DONE, "")
    assert states(cell) == ["baseline"] * 3 + ["done"] * 2


@pytest.mark.long
def test_what_may_not_be_read_is_read_when_it_may(cell, logs, opamc, monkeypatch):
    closed = [str(logs / "r1" / night(4))]
    file = logs / "r1" / night(4) / "cycle.parquet"
    file.rename(cell.parent / "aside")
    allowed = os.access
    monkeypatch.setattr(os, "access", lambda at, mode: at not in closed and allowed(at, mode))
    (logs / "lost+found").mkdir()
    closed.append(str(logs / "lost+found"))  # no robot's
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert (first.code, second.code) == (ExitCode.PARTIAL, ExitCode.PARTIAL)
    assert f"r1 {night(4)}: {closed[0]}: cannot be read" in first.out
    assert "lost+found" not in first.out
    closed.clear()
    (cell.parent / "aside").rename(file)
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, ended.out) == (ExitCode.DONE, "")


@pytest.mark.long
def test_a_link_to_a_disk_that_is_not_there_is_said_and_read_when_it_is(cell, logs, opamc):
    file = logs / "r1" / night(4) / "cycle.parquet"
    disk = cell.parent / "disk.parquet"
    file.symlink_to(file.rename(disk))
    disk.rename(cell.parent / "aside")
    first, second = opamc("nightly", cell, "--quiet"), opamc("nightly", cell, "--quiet")
    assert (
        f"r1 {night(4)}: {night(4)}/{file.name}: cannot be read (No such file or directory)"
        in first.out
    )
    assert (first.code, second.code, second.out) == (ExitCode.PARTIAL, ExitCode.PARTIAL, "")
    (cell.parent / "aside").rename(disk)
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, ended.out) == (ExitCode.DONE, "")


def test_a_file_that_the_system_refuses_to_read_is_not_remembered(tmp_path):
    sha256, facts = read_facts(LogFile(str(tmp_path), "r1", None, 0, 0), tmp_path)
    assert sha256 == ""
    assert "cannot be read" in facts.error


def test_a_robot_without_files_whose_clock_is_a_year_off_is_told_so():
    """Its night was judged, and kept as one of last year's, without a word."""
    told = "; it has files of 2025-03-11: is its clock a year off?"
    said = lacks([-355, *range(10), *range(11, 70)])
    assert said == [("2026-03-11", f"no file of 2026-03-11; others have some{told}")]
    # one that recorded about that day, too, was there a year ago
    said = lacks([*range(-370, -340), *range(10), *range(11, 70)])
    assert ("2026-03-11", "no file of 2026-03-11; others have some") in said
    # and one that has no other night is no reason to give up
    assert lacks([-355])[0][1].startswith("no file of 2026-03-01")


@pytest.mark.usefixtures("here", "undrawn")
def test_an_old_alarm_is_not_told_again_before_its_nights_are_the_new_baseline_s(cell, opamc):
    """A mail about a gear that was exchanged, from a start that took none of its nights."""
    assert opamc("nightly", cell, "--quiet").code == ExitCode.UNHEALTHY
    opamc("nightly", "rebaseline", "r2", "--from", night(3), "--why", "gear", "--cell", cell)
    for _ in range(2):
        elsewhere = opamc("nightly", cell, "--quiet", "--night", night(1))
        assert (elsewhere.code, elsewhere.out) == (ExitCode.UNHEALTHY, "")
    ended = opamc("nightly", cell, "--quiet")
    assert ended.out == f"r2 axis 2: the alarm of {night(3)} is over, by a new baseline\n"
    assert ended.code == ExitCode.DONE


@pytest.mark.usefixtures("here", "undrawn")
def test_a_dry_run_says_what_is_odd_though_it_is_quiet(cell, opamc):
    assert opamc("nightly", cell, "--dry-run", "--quiet").out == ""
    cell.write_text(cell.read_text() + "robots: {r1: {}, r9: {}}\n")
    said = opamc("nightly", cell, "--dry-run", "--quiet").out
    assert "r9: no recording\n" in said
    assert "r2 not named by the cell's file" in said
