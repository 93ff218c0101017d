"""Robots that are recorded at several conditions, of which each has a baseline of its own."""

import json
import shutil
import sqlite3

import cell_logs
import nightly_kills
import pytest
from cell_logs import night

from opamc_cli.errors import ExitCode

LOADED = (3, 6, 7, 9, 10)
"""Nights with another payload."""

RAISED = night(5)
"""Night in which the alarm of the stand-in's joint is raised: the second after the baseline."""


@pytest.fixture(scope="module")
def nights(tmp_path_factory):
    """Nights of r2, whose axis 2 the stand-in calls faulty."""
    folder = tmp_path_factory.mktemp("conditions")
    for index in range(11):
        path = folder / night(index) / "cycle.parquet"
        cell_logs.record(path, 500, index, payload_kg=2.0 if index in LOADED else 0.0)
    return folder


@pytest.fixture
def cell(tmp_path, here):
    """A cell without a recording yet."""
    path = tmp_path / "cell.yaml"
    path.write_text("runs: logs/{robot}/{night}/*.parquet\nbaseline: {nights: 3}\n")
    with nightly_kills.with_stand_in():
        yield path


def add(cell, nights, *indices):
    for index in indices:
        shutil.copytree(nights / night(index), cell.parent / "logs" / "r2" / night(index))


def rows(cell, query):
    with sqlite3.connect(cell.parent / "nightly" / "history.sqlite") as db:
        return db.execute(query).fetchall()


@pytest.mark.long
def test_nights_under_alarm_are_part_of_no_other_condition_s_baseline(cell, nights, opamc):
    said = {}
    for index in range(11):
        add(cell, nights, index)
        said[index] = opamc("nightly", cell, "--quiet").out
    gathered = "r2 nights at 2048 Hz, 100 %, 2 kg are not judged, they have no baseline yet: "
    assert f"{gathered}1 of 3 gathered\n" in said[3]
    assert [index for index, text in said.items() if gathered in text] == [3]
    why = (
        f"r2 {night(6)}: the alarm of {RAISED} stands on axis 2: no night under it becomes part of "
        "a baseline, and that of 2048 Hz, 100 %, 2 kg is not complete"
    )
    assert why in said[6]
    failed = rows(cell, "SELECT night FROM night WHERE status = 'failed'")
    assert failed == [(night(index),) for index in (6, 7, 9, 10)]
    assert rows(cell, "SELECT raised, cleared FROM alarm") == [(RAISED, None)]
    assert len(rows(cell, "SELECT * FROM baseline")) == 3

    # one start over all nights finds the same, though it knows of no alarm when it begins
    each = nightly_kills.dump(cell.parent / "nightly" / "history.sqlite")
    shutil.rmtree(cell.parent / "nightly")
    once = opamc("nightly", cell, "--json")
    assert once.code == ExitCode.UNHEALTHY
    entry = json.loads(once.out)["robots"]["r2"]
    assert entry["done"] == [night(index) for index in (0, 1, 2, 3, 4, 5, 8)]
    assert [one["night"] for one in entry["failed"]] == [night(index) for index in (6, 7, 9, 10)]
    whole = nightly_kills.dump(cell.parent / "nightly" / "history.sqlite")
    assert {**whole, "told": None} == {**each, "told": None}

    # an end to the alarm, and nights after it are a baseline's again
    at = ("--why", "new gear", "--cell", cell)
    opamc("nightly", "rebaseline", "r2", "--from", night(9), *at)
    opamc("nightly", cell, "--quiet")
    kept = rows(cell, f"SELECT night, status FROM night WHERE night >= '{night(6)}'")
    states = ["failed", "failed", "done", "baseline", "baseline"]
    assert [status for _, status in kept] == states
