"""`opamc nightly` on short recordings, with the true diagnosis: what is done, said and kept."""

import json
import os
import shutil
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import cell_logs
import nightly_kills
import pytest

from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.start import run as stage
from opamc_cli.stages.nightly.workers.workers import run_all
from opamc_cli.storage.logs import Facts

NIGHTS = [cell_logs.night(i) for i in range(7)]
COLUMNS = (
    "robot, program, axis, night, state, health_index, p_value, cause, alarm, temperature_c, "
    "payload_kg, speed_percent, n_runs, report, config_hash, version"
)


def rows(cell: Path, query: str) -> list[tuple]:
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        return db.execute(query).fetchall()


@pytest.mark.long
def test_a_healthy_robot_loads_nothing_that_only_a_sick_one_needs(tmp_path):
    cell = cell_logs.record_cell(tmp_path, 1, 3, {})
    code = (
        "import sys\nfrom opamc_cli.stages import diagnose\nfrom opamc_cli.config import Config\n"
        "from pathlib import Path\nlogs = sorted(Path(sys.argv[1]).iterdir())\n"
        "done = diagnose.run(logs[:2], logs[2:], Config(), Path(sys.argv[2]), "
        "figures_of_healthy=False)\n"
        "heavy = ('scipy.stats', 'scipy.signal', 'scipy.optimize', 'matplotlib.figure')\n"
        "print(int(done.exit_code), [name for name in heavy if name in sys.modules])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, cell.parent / "logs" / "r1", tmp_path / "out"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert ended.stdout.split("\n")[0] == "0 []"


def states(robots: dict) -> dict[str, str]:
    return {name: entry["state"] for name, entry in robots.items()}


@pytest.mark.long
@pytest.mark.usefixtures("undrawn")
def test_a_cell_from_the_first_night_to_the_alarm(cell, opamc):
    ended = opamc("nightly", cell, "--json")
    assert ended.code == ExitCode.UNHEALTHY, ended
    robots = json.loads(ended.out)["robots"]
    assert states(robots) == {"r1": "healthy", "r2": "alarm", "r3": "healthy"}
    assert robots["r1"]["done"] == NIGHTS[:5]
    (alarm,) = robots["r2"]["alarms"]
    assert alarm["axis"] == 2
    assert alarm["since"] == NIGHTS[3]

    # the history, as the design fixes it
    assert rows(cell, f"SELECT count(*) FROM (SELECT {COLUMNS} FROM verdict)") == [(12,)]
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        described = db.execute("PRAGMA table_info(verdict)").fetchall()
        assert ", ".join(column[1] for column in described) == COLUMNS
        key = sorted((column[5], column[1]) for column in described if column[5])
        assert [name for _, name in key] == ["robot", "program", "axis", "night"]
        event = db.execute("PRAGMA table_info(event)").fetchall()
        assert [column[1] for column in event] == ["time", "robot", "axis", "kind", "text"]
    found = rows(cell, "SELECT axis, night, alarm FROM verdict WHERE robot = 'r2' ORDER BY 1, 2")
    assert found == [(1, NIGHTS[3], 0), (1, NIGHTS[4], 0), (2, NIGHTS[3], 1), (2, NIGHTS[4], 1)]
    ((temperature, report),) = rows(
        cell, "SELECT temperature_c, report FROM verdict WHERE robot = 'r1' LIMIT 1"
    )
    assert 10 < temperature < 60
    assert (cell.parent / "nightly" / report).is_file()

    # a night is what a diagnosis of the same runs is
    folder = cell.parent / "by-hand"
    for role, nights in (("baseline", NIGHTS[:3]), ("target", NIGHTS[4:5])):
        for night in nights:
            (folder / role / night).mkdir(parents=True)
            source = cell.parent / "logs" / "r2" / night / "cycle.parquet"
            (folder / role / night / "cycle.parquet").symlink_to(source)
    opamc(
        *("diagnose", "--baseline", folder / "baseline", "--target", folder / "target"),
        *("--set", "joint.explain=false", "--out", folder / "out", "--quiet"),
    )
    by_hand = json.loads((folder / "out" / "verdict.json").read_text())
    of_night = cell.parent / "nightly" / "r2" / NIGHTS[4]
    assert json.loads((of_night / "verdict.json").read_text())["axes"] == by_hand["axes"]
    assert str(cell.parent) not in (of_night / "report.html").read_text()

    # said once, kept in the exit code
    again = opamc("nightly", cell, "--quiet")
    assert (again.code, again.out) == (ExitCode.UNHEALTHY, "")
    skipped = json.loads(opamc("nightly", cell, "--json").out)["robots"]["r1"]["skipped"]
    assert skipped == NIGHTS[:5]

    # silenced by who knows it
    refused = opamc("nightly", "acknowledge", "r1", "--axis", 2, "--why", "x", "--cell", cell)
    assert refused.code == ExitCode.USAGE
    assert "no alarm stands on axis 2 of r1" in refused.err
    opamc("nightly", "acknowledge", "r2", "--axis", 2, "--why", "gear ordered", "--cell", cell)
    assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
    said = opamc("history", "--cell", cell, "--events", "--json")
    kinds = {row["kind"]: row["text"] for row in json.loads(said.out)["event"]}
    assert "gear ordered" in kinds["acknowledged"]

    # a date to come ends no alarm; maintenance does, as soon as there is a night after it
    at = ("--why", "new gear", "--cell", cell)
    opamc("nightly", "rebaseline", "r2", "--from", "2030-01-01", *at)
    assert states(json.loads(opamc("nightly", cell, "--json").out)["robots"])["r2"] == "known"
    opamc("nightly", "rebaseline", "r2", "--from", NIGHTS[4], *at)
    ended = opamc("nightly", cell)
    assert (ended.code, ended.out.split("\n")[0]) == (
        ExitCode.DONE,
        f"r2 axis 2: the alarm of {NIGHTS[3]} is over, by a new baseline",
    )
    assert rows(cell, "SELECT cleared FROM alarm") == [(NIGHTS[4],)]

    # a mistake is taken back: all is as it was
    assert opamc("nightly", "rebaseline", "r2", "--from", NIGHTS[4], "--undo", *at).code == 0
    assert states(json.loads(opamc("nightly", cell, "--json").out)["robots"])["r2"] == "known"
    assert rows(cell, "SELECT cleared FROM alarm") == [(None,)]
    twice = opamc("nightly", "rebaseline", "r2", "--from", NIGHTS[4], "--undo", *at)
    assert twice.code == ExitCode.USAGE
    assert "no baseline of r2 was begun then by `rebaseline`; there is none" in twice.err

    # a new gear, a new baseline: two nights are not enough for it yet
    opamc("nightly", "rebaseline", "r2", "--from", NIGHTS[3], "--why", "new gear", "--cell", cell)
    after = opamc("nightly", cell, "--json")
    assert after.code == ExitCode.DONE
    assert states(json.loads(after.out)["robots"])["r2"] == "baseline"
    assert rows(cell, "SELECT count(*) FROM verdict WHERE robot = 'r2'") == [(0,)]
    assert not of_night.exists()

    # exports
    for ending in ("csv", "parquet", "json"):
        file = cell.parent / f"export.{ending}"
        assert opamc("history", "--cell", cell, "--out", file).code == 0
        assert file.stat().st_size
    assert opamc("history", "--cell", cell, "--out", "x.xlsx").code == ExitCode.USAGE


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_an_alarm_of_a_new_baseline_is_told_though_the_old_one_was_acknowledged(cell, opamc):
    alarm = "r2 axis 2: ALARM"
    at = ("--why", "gear ordered", "--cell", cell)
    begin = ("nightly", "rebaseline", "r2", "--from", NIGHTS[0], *at)
    with nightly_kills.with_stand_in():
        assert alarm in opamc("nightly", cell, "--quiet").out
        opamc("nightly", "acknowledge", "r2", "--axis", 2, *at)
        assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
        opamc(*begin)
        again = opamc("nightly", cell, "--quiet")
        assert (again.code, alarm in again.out) == (ExitCode.UNHEALTHY, True)
        assert opamc("nightly", cell, "--quiet").out == ""
        # who looks into it finds it named, though it was told
        named = opamc("nightly", cell)
        assert named.out.startswith("r2 axis 2: alarm since ")
        assert named.out.count("\n") == 2
        # taken back, the alarm is the one that is known
        opamc(*begin, "--undo")
        assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE


@pytest.mark.usefixtures("here", "undrawn")
def test_a_worn_night_of_the_baseline_is_left_out_and_told_once(cell, opamc):
    """It was what healthy nights differ by: the same fault in the next night was healthy."""
    rule = "alarm: {nights: 1, of: 1}\nrobots: {r2: {}}\n"
    cell.write_text(cell.read_text().replace("nights: 3", "nights: 4") + rule)
    first = opamc("nightly", cell, "--quiet")
    assert first.code == ExitCode.UNHEALTHY
    assert "r2 axis 2: ALARM" in first.out
    told = f"night {NIGHTS[3]} of the baseline differs from the others on axis 2 as no healthy one"
    assert f"r2 its baseline: {told}" in first.out
    assert opamc("nightly", cell, "--quiet").out == ""
    verdict = json.loads((cell.parent / f"nightly/r2/{NIGHTS[4]}/verdict.json").read_text())
    assert [one.get("not_compared") for one in verdict["axes"]] == [
        None,
        {"baseline": [f"{NIGHTS[3]}/cycle"]},
    ]


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_an_alarm_that_is_told_again_is_not_taken_for_a_new_one(cell, opamc):
    cell.write_text(cell.read_text() + "alarm: {nights: 1, of: 1, remind_after: 1}\n")
    late = cell.parent / "logs" / "r2" / NIGHTS[4]
    late.rename(cell.parent / "late")
    with nightly_kills.with_stand_in():
        assert "r2 axis 2: ALARM, not as it was" in opamc("nightly", cell, "--quiet").out
        (cell.parent / "late").rename(late)
        again = opamc("nightly", cell, "--quiet")
    assert again.code == ExitCode.UNHEALTHY
    assert again.out.startswith("r2 axis 2: STILL UNDER ALARM, not as it was since ")


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_an_alarm_does_not_end_without_a_word(cell, opamc):
    with nightly_kills.with_stand_in():
        plain = cell.read_text()
        watched = f"{plain}robots: {{r1: {{}}, r2: {{}}, r3: {{}}}}\n"
        cell.write_text(watched)
        assert opamc("nightly", cell, "--quiet").code == ExitCode.UNHEALTHY
        # its joint is watched no more
        cell.write_text(watched.replace("r2: {}", "r2: {axes: [1]}"))
        ended = opamc("nightly", cell, "--quiet")
        assert f"r2 axis 2: the alarm of {NIGHTS[4]} stands no more: it is not watched" in ended.out
        assert ended.code == ExitCode.PARTIAL
        ended = opamc("nightly", cell, "--quiet")
        assert (ended.code, "stands no more" in ended.out) == (ExitCode.DONE, False)
        # its robot leaves the cell, is back, and leaves it once more
        for _ in range(2):
            cell.write_text(watched)
            again = opamc("nightly", cell, "--quiet")
            assert again.code == ExitCode.UNHEALTHY
            # the last word was that it stands no more
            assert again.out.startswith("r2 axis 2: ALARM, ")
            cell.write_text(watched.replace(" r2: {},", ""))
            ended = opamc("nightly", cell, "--quiet")
            assert f"r2 axis 2: the alarm of {NIGHTS[4]}" in ended.out
            assert ended.code == ExitCode.PARTIAL
            assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
        # other options, another verdict
        cell.write_text(watched)
        assert opamc("nightly", cell, "--quiet").code == ExitCode.UNHEALTHY
        cell.write_text(watched + "alarm: {nights: 3, of: 3, gross: 10}\n")
        ended = opamc("nightly", cell, "--quiet")
        assert "r2 axis 2: the alarm of" in ended.out
        assert "its nights show none now" in ended.out
        assert "not watched" not in ended.out  # which was so before
        cell.write_text(watched)
        assert opamc("nightly", cell, "--quiet").out.startswith("r2 axis 2: ALARM, ")


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_an_alarm_that_is_over_and_stands_again_is_said_again(cell, opamc):
    rule = "alarm: {nights: 1, of: 1, remind_after: 99}\n"
    cell.write_text(cell.read_text().replace("nights: 3", "nights: 2") + rule)
    alarm = "r2 axis 2: ALARM, "
    with nightly_kills.with_stand_in():
        assert alarm in opamc("nightly", cell, "--quiet").out
        whole = {
            path: path.read_bytes() for path in (cell.parent / "logs" / "r2").rglob("*.parquet")
        }
        for path in whole:
            path.write_bytes(b"")
        broken = opamc("nightly", cell, "--quiet")
        assert "r2 axis 2: the alarm of" in broken.out
        assert broken.code == ExitCode.PARTIAL
        for path, content in whole.items():
            path.write_bytes(content)
        mended = opamc("nightly", cell, "--quiet")
        assert (mended.code, alarm in mended.out) == (ExitCode.UNHEALTHY, True)
        assert opamc("nightly", cell, "--quiet").out == ""


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_a_robot_without_any_night_stays_on_page_and_metrics(cell, opamc):
    cell.write_text(cell.read_text() + "robots: {r1: {}, r2: {}, r3: {}, r9: {}}\n")
    metrics = cell.parent / "nightly" / "metrics.prom"
    with nightly_kills.with_stand_in():
        opamc("nightly", cell)
        opamc("nightly", "acknowledge", "r2", "--axis", 2, "--why", "known", "--cell", cell)
        assert 'opamc_robot_failed{robot="r9"} 1' in metrics.read_text()
        assert opamc("nightly", cell, "--robot", "r1").code == ExitCode.DONE
        assert 'opamc_robot_failed{robot="r9"} 1' in metrics.read_text()


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_an_alarm_whose_nights_become_a_baseline_is_over_and_stays_in_the_history(cell, opamc):
    at = ("--why", "new gear", "--cell", cell)
    begin = ("nightly", "rebaseline", "r2", "--from", NIGHTS[3], *at)
    over = f"axis 2: the alarm of {NIGHTS[4]} is over, by a new baseline"
    events = (
        "SELECT time, kind, text FROM event WHERE robot = 'r2' AND kind IN ('alarm', 'cleared') "
        "ORDER BY kind"
    )
    with nightly_kills.with_stand_in():
        opamc("nightly", cell, "--quiet")
        ((time_of_alarm, _, text),) = rows(cell, events)
        opamc(*begin)
        ended = opamc("nightly", cell, "--quiet")
        assert (ended.code, ended.out) == (ExitCode.DONE, f"r2 {over}\n")
        kept = [(time_of_alarm, "alarm", text), (NIGHTS[4], "cleared", over)]
        alarms = "SELECT raised, cleared FROM alarm WHERE robot = 'r2'"
        # it stays, and is no news, when alarms are found anew
        for rule in ("", "alarm: {remind_after: 9}\n"):
            cell.write_text(cell.read_text() + rule)
            assert over not in opamc("nightly", cell, "--quiet").out
            assert rows(cell, events) == kept
            assert rows(cell, alarms) == [(NIGHTS[4], NIGHTS[4])]
        opamc(*begin, "--undo")
        assert opamc("nightly", cell, "--quiet").code == ExitCode.UNHEALTHY
        assert rows(cell, alarms) == [(NIGHTS[4], None)]


def test_facts_of_thousands_of_known_files_are_read_at_once():
    text = Facts("cycle", 100.0, 0.0, 2048.0, "2026-03-01T22:00:00+00:00").to_json()
    begun = time.process_time()
    for _ in range(5000):
        assert Facts.from_json(text).program == "cycle"
    assert time.process_time() - begun < 2.0  # 0.1 s; it was once 35 s


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_what_is_asked_for_and_not_there_is_said(cell, opamc):
    only = ("nightly", cell, "--quiet", "--robot", "r1", "--night", NIGHTS[4])
    assert (opamc(*only).code, opamc(*only).out) == (ExitCode.DONE, "")
    # robots that nobody has asked for so far lack no file
    assert "no file" not in opamc("nightly", cell, "--quiet", "--night", NIGHTS[0]).out
    shutil.rmtree(cell.parent / "logs" / "r3" / NIGHTS[1])
    lost = opamc("nightly", cell, "--quiet", "--night", NIGHTS[1])
    assert (lost.code, lost.out) == (ExitCode.PARTIAL, f"no recording of {NIGHTS[1]} of r3\n")
    for option, word in (("--night", "of"), ("--since", "since")):
        for more in ((), ("--json",)):
            asked = opamc("nightly", cell, "--quiet", option, "2062-03-01", *more)
            assert asked.code == ExitCode.PARTIAL
            why = f"no recording {word} 2062-03-01"
            if more:
                assert json.loads(asked.out)["absent"] == [f"{why} of r1, r2, r3"]
                for robot in json.loads(asked.out)["robots"].values():
                    assert robot["failed"] == [{"night": "2062-03-01", "why": why}]
            else:
                assert asked.out == f"{why} of r1, r2, r3\n"
        planned = opamc("nightly", cell, "--dry-run", option, "2062-03-01")
        assert planned.out.startswith(f"no recording {word} 2062-03-01 of r1, r2, r3\n")
    assert opamc("nightly", cell, "--quiet", "--since", NIGHTS[2], "--dry-run").out == ""

    shown = ("history", "--cell", cell)
    assert opamc(*shown, "--since", "yesterday").code == ExitCode.USAGE
    assert "--robot r9: no night of it is known" in opamc(*shown, "--robot", "r9").err
    assert opamc(*shown, "--robot", "r1", "--since", NIGHTS[0]).code == ExitCode.DONE


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_logs_out_of_reach_and_joints_that_are_not_there_are_said(cell, opamc):
    cell.write_text(cell.read_text() + "robots: {r2: {axes: [2, 7]}}\n")
    for night in NIGHTS[3:4]:
        shutil.rmtree(cell.parent / "logs" / "r2" / night)
    first = opamc("nightly", cell, "--quiet")
    why = "axis 7 of program 'cycle' cannot be judged: recorded were axes 1 and 2 (robots.r2.axes)"
    assert f"r2 {NIGHTS[4]}: in part not judged: {why}" in first.out
    assert first.code == ExitCode.UNHEALTHY  # axis 2 is, by one gross night
    # an alarm does not end because a disk is not mounted
    named = cell.read_text()
    unnamed = named.replace("robots: {r2: {axes: [2, 7]}}\n", "")
    for text, of in ((named, " of r2"), (unnamed, "")):
        cell.write_text(text)
        (cell.parent / "logs").rename(cell.parent / "unmounted")
        for _ in range(2):
            lost = opamc("nightly", cell, "--quiet")
            assert lost.code == ExitCode.UNHEALTHY
            assert f"no file{of} fits this pattern any more; is its folder there?" in lost.out
        (cell.parent / "unmounted").rename(cell.parent / "logs")
    cell.write_text(cell.read_text() + "robots: {r2: {axes: []}}\n")
    assert "robots.r2.axes" in opamc("nightly", cell).err


@pytest.mark.long
def test_new_files_cost_their_night_and_a_bad_one_is_its_robots_line(cell, opamc):
    cell.write_text(cell.read_text() + "robots: {r1: {}, r3: {axes: [1]}, r4: {}}\n")
    logs = cell.parent / "logs"
    last = logs / "r1" / NIGHTS[4]
    shutil.move(last, cell.parent / "later")
    planned = opamc("nightly", cell, "--dry-run", "--json")
    assert len(json.loads(planned.out)["nights"]) == 9
    assert not (cell.parent / "nightly" / "r3").exists()
    first = opamc("nightly", cell, "--quiet", "--jobs", 2)
    assert first.code == ExitCode.PARTIAL
    assert f"r1 no file of {NIGHTS[4]}; others have some" in first.out
    assert "r4 no file at all" in first.out
    assert opamc("nightly", cell, "--quiet").out == ""
    assert rows(cell, "SELECT DISTINCT axis FROM verdict WHERE robot = 'r3'") == [(1,)]

    cell.write_text(cell.read_text().replace(", r4: {}", ""))
    shutil.move(cell.parent / "later", last)
    (logs / "r3" / NIGHTS[5]).mkdir()
    (logs / "r3" / NIGHTS[5] / "cycle.parquet").write_bytes(b"PAR1 half a file")
    second = opamc("nightly", cell, "--json")
    robots = json.loads(second.out)["robots"]
    assert second.code == ExitCode.PARTIAL
    assert robots["r1"]["done"] == [NIGHTS[4]]
    ((failed,),) = [robots["r3"]["failed"]]
    assert failed["night"] == NIGHTS[5]
    assert "cannot be opened as Parquet" in failed["why"]
    # said once; it stays the robot's state until there is something better
    third = opamc("nightly", cell, "--quiet")
    assert (third.code, third.out) == (ExitCode.PARTIAL, "")

    # the same content with another time is not new; another file in the baseline is
    touched = logs / "r1" / NIGHTS[4] / "cycle.parquet"
    os.utime(touched, (time.time(), time.time()))
    assert json.loads(opamc("nightly", cell, "--dry-run", "--json").out)["nights"] == []
    kept = {path for path in (cell.parent / "nightly" / ".kept").rglob("*") if path.is_file()}
    cell_logs.record(logs / "r1" / NIGHTS[1] / "second.parquet", 900, 1)
    planned = json.loads(opamc("nightly", cell, "--dry-run", "--json").out)["nights"]
    assert {entry["why"] for entry in planned} == {
        "the baseline has changed",
        "1 new or changed file",
    }
    said = "r1 its baseline, now of 4 recordings: one is new or has changed; 2 nights judged anew"
    assert said in opamc("nightly", cell, "--quiet").out
    new = {path for path in (cell.parent / "nightly" / ".kept").rglob("*") if path.is_file()} - kept
    # two axes of the one file, three stages and its places; its channels, and what tells it from a
    # copy; of the whole baseline its tables, and how far its cycles scatter
    assert len(new) == 2 * 4 + 2 + 2

    # what was judged stays judged when logs are cleared away
    shutil.rmtree(logs / "r1" / NIGHTS[3])
    assert json.loads(opamc("nightly", cell, "--dry-run", "--json").out)["nights"] == []


def test_a_night_that_is_not_judged_is_said_when_quiet(cell, opamc):
    logs = cell.parent / "logs"
    shutil.rmtree(logs / "r2")
    shutil.rmtree(logs / "r3")
    for index in (3, 4):
        shutil.rmtree(logs / "r1" / NIGHTS[index])
    cell_logs.record(logs / "r1" / NIGHTS[3] / "cycle.parquet", 500, 3, program="another")
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL  # the first night of another program's baseline
    gathered = (
        "r1 nights of program 'another' at 2048 Hz, 100 %, 0 kg are not judged, they have no "
        "baseline yet: 1 of 3 gathered\n"
    )
    assert ended.out == gathered
    again = opamc("nightly", cell, "--quiet")
    assert (again.code, again.out) == (ExitCode.PARTIAL, "")  # said once of each condition
    counted = "1 robot not judged while a baseline is recorded: r1"
    assert opamc("nightly", cell).out.startswith(counted)
    assert counted in (cell.parent / "nightly" / "index.html").read_text()
    metrics = (cell.parent / "nightly" / "metrics.prom").read_text()
    assert 'opamc_robot_failed{robot="r1"} 1' in metrics
    cell.write_text(cell.read_text().replace("nights: 3", f"from: {NIGHTS[0]}, to: {NIGHTS[2]}"))
    ended = opamc("nightly", cell, "--quiet")
    assert ended.code == ExitCode.PARTIAL
    assert "the baseline has no recording of program 'another'" in ended.out


def test_other_conditions_have_a_baseline_of_their_own(cell, opamc):
    logs = cell.parent / "logs"
    shutil.rmtree(logs / "r2")
    shutil.rmtree(logs / "r3")
    for index in (3, 4):
        cell_logs.record(logs / "r1" / NIGHTS[index] / "cycle.parquet", 500, index, payload_kg=2.0)
    entry = json.loads(opamc("nightly", cell, "--json").out)["robots"]["r1"]
    assert (entry["state"], entry["done"]) == ("gathering", NIGHTS[:5])


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("runs: logs/*.parquet", "needs {robot}"),
        ("runs: logs/{robot}/{day}/*.parquet", "{day}'; known are"),
        ("runs: '{robot}/*.parquet'\nrobot: auto", "did you mean 'robots'"),
        ("runs: '{robot}/*.parquet'\nbaseline: {nights: 3, runs: 'x/{robot}'}", "give either"),
        (
            "runs: '{robot}/*.parquet'\nbaseline: {from: 2026-03-02, to: 2026-03-01}",
            "from not after",
        ),
        ("runs: '{robot}/*.parquet'\nalarm: {nights: 4, of: 3}", "could never be reached"),
        ("runs: '{robot}/*.parquet'\nset: {patterns.gama: 1}", "did you mean 'gamma'"),
        ("runs: '{robot}/*.parquet'\nrobots: {../x: {}}", "robots"),
        ("runs: '{robot}/*.parquet'\nrobots: {r1: {axis: [1]}}", "did you mean 'axes'"),
        ("runs: '{robot}/*.parquet'", "no file fits"),
        ("runs: '{robot}/*.parquet'\nout: /", "the root of all folders; name a folder"),
        ("- 1", "a mapping of keys is needed"),
    ],
)
def test_a_cell_that_cannot_be_looked_after_is_one_sentence(tmp_path, opamc, text, part):
    cell = tmp_path / "cell.yaml"
    cell.write_text(text)
    ended = opamc("nightly", cell)
    assert ended.code in (ExitCode.USAGE, ExitCode.BAD_INPUT)
    assert ended.err.startswith("opamc: ")
    assert ended.err.count("\n") == 1
    assert part in ended.err


def test_dates_and_names_are_checked(cell, opamc):
    assert "is no date" in opamc("nightly", cell, "--night", "yesterday").err
    assert "is none of the cell's robots" in opamc("nightly", cell, "--robot", "r9").err
    assert "nothing of that kind" in opamc("history", "--cell", cell).out
    shutil.rmtree(cell.parent / "nightly")
    assert "no history here yet" in opamc("history", "--cell", cell).err


def test_a_start_that_is_under_way_holds_the_folder(cell, opamc):
    from opamc_cli.storage.files.lock import output_lock

    with output_lock(cell.parent / "nightly"):
        assert opamc("nightly", cell).code == ExitCode.LOCKED


@pytest.mark.long
def test_limits_are_the_robots_own(cell, opamc):
    shutil.rmtree(cell.parent / "logs" / "r3")
    cell.write_text(cell.read_text() + "limits: {seconds: 0.01}\n")
    ended = opamc("nightly", cell, "--json", "--robot", "r1")
    assert ended.code == ExitCode.PARTIAL
    why = {entry["why"] for entry in json.loads(ended.out)["robots"]["r1"]["failed"]}
    assert why == {"took longer than 0.01 s (limits.seconds)"}
    cell.write_text(cell.read_text().replace("seconds: 0.01", "seconds: 600"))
    mended = opamc("nightly", cell, "--json", "--robot", "r1")
    assert mended.code == ExitCode.DONE
    assert json.loads(mended.out)["robots"]["r1"]["done"] == NIGHTS[3:5]


def answers(function: str, jobs: list, **limits) -> dict:
    chosen = {"seconds": 60.0, "memory_gb": None, **limits}
    return dict(run_all(f"worker_jobs:{function}", jobs, 2, **chosen))


def test_a_worker_does_not_wait_for_who_takes_its_answers(monkeypatch, tmp_path):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    marks = [str(tmp_path / name) for name in "ab"]
    answers = run_all("worker_jobs:leave_a_mark", marks, 1, seconds=60.0, memory_gb=None)
    assert next(answers) == (marks[0], marks[0])
    until = time.monotonic() + 30.0
    while not Path(marks[1]).exists() and time.monotonic() < until:
        time.sleep(0.01)
    assert Path(marks[1]).exists()
    assert [answer for _, answer in answers] == [marks[1]]


@pytest.mark.long
def test_workers_that_die_are_a_sentence(monkeypatch):
    here = str(Path(__file__).parent)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([here, os.environ.get("PYTHONPATH", "")]))
    found = answers("behave", ["fine", "die", "raise", "refuse", "also fine"])
    assert found["fine"] == "FINE"
    assert found["also fine"] == "ALSO FINE"
    assert found["die"].text == "its worker was ended by SIGKILL"
    assert found["raise"].text.startswith("a bug: ZeroDivisionError")
    assert (found["refuse"].kind, found["refuse"].text) == ("refused", "the disk is full")
    greedy = answers("behave", ["eat", "fine"], memory_gb=0.2)
    assert greedy["eat"].text == "needed more than 0.2 GB (limits.memory_gb)"
    assert greedy["fine"] == "FINE"
    slow = answers("behave", ["sleep", "fine"], seconds=4.0)
    assert slow["sleep"].kind == "time"
    assert slow["fine"] == "FINE"


FORKING = """
import json, sys
import worker_jobs
from opamc_cli.stages.nightly.workers.workers import can_fork, run_all

worker_jobs.LOADED = True
held = open(__file__)
assert can_fork()
found = {}
for kinds, seconds, memory_gb in json.loads(sys.argv[1]):
    answers = run_all(
        "worker_jobs:behave", kinds, 2, seconds=seconds, memory_gb=memory_gb
    )
    found |= {job: answer if isinstance(answer, str) else answer.text for job, answer in answers}
print(json.dumps(found))
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux only")
def test_workers_that_are_forked_hold_nothing_and_keep_the_limits(tmp_path):
    script = tmp_path / "start.py"
    script.write_text(FORKING)
    rounds = [
        (["loaded", "files", "die", "raise", "refuse", "fine"], 60.0, None),
        (["eat"], 60.0, 0.2),
        (["sleep", "nap"], 2.0, None),
    ]
    ended = subprocess.run(
        [sys.executable, script, json.dumps(rounds)],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent), "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout) == {
        "loaded": "True",
        "files": "1",  # its pipe
        "die": "its worker was ended by SIGKILL",
        "raise": "a bug: ZeroDivisionError: division by zero",
        "refuse": "the disk is full",
        "fine": "FINE",
        "eat": "needed more than 0.2 GB (limits.memory_gb)",
        "sleep": "took longer than 2 s (limits.seconds)",
        "nap": "NAP",
    }


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux only")
def test_a_start_loads_no_pandas_and_can_be_copied(cell):
    asked = (
        "import sys\n"
        "def hear(event, _):\n"
        "    if event == 'os.fork': print(event, 'pandas' in sys.modules)\n"
        "sys.addaudithook(hear)\n"
        "from opamc_cli.__main__ import main\n"
        f"main(['nightly', {str(cell)!r}, '--robot', 'r1', '--night', {NIGHTS[3]!r}, '--quiet'])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=False
    )
    assert ended.stdout.split() == ["os.fork", "False"], ended.stderr


@pytest.mark.long
def test_what_follows_is_the_same_in_whatever_order_nights_come(cell, opamc):
    cell.write_text(cell.read_text() + "keep: {reports: 1}\n")
    with nightly_kills.with_stand_in():
        opamc("nightly", cell, "--night", NIGHTS[4], "--quiet")
        opamc("nightly", cell, "--quiet")
        piecewise = nightly_kills.dump(cell.parent / "nightly" / "history.sqlite")
        shutil.rmtree(cell.parent / "nightly")
        opamc("nightly", cell, "--jobs", 2, "--quiet")
        assert nightly_kills.dump(cell.parent / "nightly" / "history.sqlite") == piecewise

    # old folders are pruned, the history is not
    folders = sorted(path.name for path in (cell.parent / "nightly" / "r2").iterdir())
    assert folders == [NIGHTS[4]]
    kept = rows(cell, "SELECT DISTINCT night, report IS NULL FROM verdict WHERE robot = 'r2'")
    assert sorted(kept) == [(NIGHTS[3], 1), (NIGHTS[4], 0)]


def test_compute_is_loaded_by_workers_only():
    assert stage.COMPUTE == "opamc_cli.stages.nightly.workers.judge:compute"


@pytest.mark.long
@pytest.mark.usefixtures("here", "undrawn")
def test_logs_in_a_store_are_fetched_once_and_baselines_kept(cell, opamc):
    """A store by the path that object stores take, `file://` in the place of `s3://`."""
    shutil.rmtree(cell.parent / "logs" / "r1" / NIGHTS[4])
    cell.write_text(cell.read_text() + "robots: {r1: {}}\n")
    here = opamc("nightly", cell, "--json")
    axes = {
        path.relative_to(cell.parent / "nightly"): json.loads(path.read_text())["axes"]
        for path in (cell.parent / "nightly").glob("r*/*/verdict.json")
    }
    shutil.rmtree(cell.parent / "nightly")
    logs = cell.parent / "logs"
    cell.write_text(cell.read_text().replace("runs: logs", f"runs: {logs.as_uri()}"))
    store = opamc("nightly", cell, "--json")
    assert store == here
    out = cell.parent / "nightly"
    found = {path.relative_to(out): path for path in out.glob("r*/*/verdict.json")}
    assert {name: json.loads(path.read_text())["axes"] for name, path in found.items()} == axes
    assert len(list((out / ".copies").iterdir())) == 3
    # nothing is fetched again, and a store that is gone is a sentence
    before = sorted((path.name, path.stat().st_mtime_ns) for path in (out / ".copies").iterdir())
    assert opamc("nightly", cell, "--quiet").out == ""
    assert before == sorted((p.name, p.stat().st_mtime_ns) for p in (out / ".copies").iterdir())
    cell.write_text(cell.read_text().replace("runs: file", "runs: nowhere"))
    gone = opamc("nightly", cell)
    assert gone.code == ExitCode.BAD_INPUT
    assert "cannot be listed" in gone.err
