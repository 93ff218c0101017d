"""A night that goes on has lost nothing yet: who records late is not missed in the morning."""

import json
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest
from cell_logs import night
from changed_logs import add_night, set_clock

from opamc_cli.errors import ExitCode
from opamc_cli.stages.nightly.inputs.hours import usual_hours
from opamc_cli.stages.nightly.plan.planned import Comparison
from opamc_cli.stages.nightly.start import look


def recording(of, clock=""):
    started_at = f"{clock}:00Z" if clock else None
    return SimpleNamespace(night=of, facts=SimpleNamespace(started_at=started_at))


def at(text):
    return datetime.fromisoformat(text).replace(tzinfo=UTC)


def test_a_robot_s_hours_are_the_latest_of_its_last_nights():
    """Folders of dates, recorded at 9 and 16 of the day after, and once an hour later."""
    days = ["2026-03-02T09:00", "2026-03-03T09:30", "2026-03-04T09:00", "2026-03-05T01:00"]
    rows = [recording(f"2026-03-0{n}", clock) for n, clock in enumerate(days, start=1)]
    rows.append(recording("2026-03-02", "2026-03-03T16:00"))
    hours = usual_hours([*rows, recording("", "2026-03-09T23:00")])
    assert hours.may_begin("2026-03-05", at("2026-03-06T06:00"))
    assert not hours.may_begin("2026-03-05", at("2026-03-06T09:30"))
    assert hours.may_go_on("2026-03-05", at("2026-03-06T15:59"))
    assert not hours.may_go_on("2026-03-05", at("2026-03-06T16:00"))
    assert not hours.may_go_on("", at("2026-03-01T00:00"))
    nothing = usual_hours([recording("2026-03-01"), recording("2026-03-02")])
    assert not nothing.may_begin("2026-03-02", at("2026-03-01T00:00"))


def lacking(targets, *baseline, running=False):
    of = tuple(recording(f"2026-03-0{n}") for n, size in enumerate(baseline) for _ in range(size))
    return list(Comparison("", "", (recording("x"),) * targets, of, running=running).lacking)


def test_a_night_of_far_fewer_recordings_than_nights_that_differ_is_said():
    """One of four to five was "healthy", without a word."""
    assert lacking(1, 5, 5, 4) == ["1 recording where each night of the baseline has 4 to 5"]
    assert lacking(2, 4, 4) == ["2 recordings where each night of the baseline has 4"]
    assert lacking(3, 5, 5, 4) == lacking(4, 4, 4) == lacking(1, 3, 6, 5) == lacking(1, 4) == []
    assert lacking(1, 5, 5, 4, running=True) == []


@pytest.fixture
def clock(monkeypatch):
    def set_now(text):
        monkeypatch.setattr(look, "datetime", SimpleNamespace(now=lambda _: at(text)))

    return set_now


@pytest.mark.usefixtures("here", "undrawn")
def test_a_robot_that_records_after_cron_is_not_missed_until_then(cell, logs, opamc, clock):
    """Each morning its file of the night was missed, and a day later that was taken back."""
    for robot, hour in (("r1", "T22:00"), ("r3", "T23:30")):
        for index in range(5):
            path = logs / robot / night(index) / "cycle.parquet"
            set_clock(path, f"{night(index)}{hour}:00+00:00", 1 + 1e-4 * index)
    add_night(logs, 5)
    clock(f"{night(5)}T23:00")
    assert opamc("nightly", cell, "--quiet").code == ExitCode.DONE
    clock(f"{night(5)}T23:45")
    ended = opamc("nightly", cell, "--quiet")
    assert (ended.code, ended.out.partition(";")[0]) == (4, f"r3 no file of {night(5)}")


@pytest.mark.usefixtures("here", "undrawn")
def test_a_night_that_ends_without_all_its_recordings_is_in_part_then(cell, logs, opamc, clock):
    add_night(logs, 5)
    for index in range(6):
        path = logs / "r1" / night(index) / "cycle.parquet"
        set_clock(path, f"{night(index)}T20:00:00+00:00")
        if index < 5:
            set_clock(path, f"{night(index)}T20:00:00+00:00", 1 + 1e-4 * index)
            late = path.with_name("late.parquet")
            late.write_bytes(path.read_bytes())
            set_clock(late, f"{night(index)}T23:00:00+00:00", 1.01 + 1e-4 * index)
    clock(f"{night(5)}T22:00")
    first = opamc("nightly", cell, "--quiet", "--robot", "r1")
    assert (first.code, first.out) == (ExitCode.DONE, "")
    clock(f"{night(5)}T23:10")
    planned = json.loads(opamc("nightly", cell, "--dry-run", "--robot", "r1", "--json").out)
    (again,) = planned["nights"]
    assert again["why"] == "the night is over, and has not all its recordings"
    ended = opamc("nightly", cell, "--quiet", "--robot", "r1")
    assert ended.code == ExitCode.PARTIAL
    assert "in part not judged: 1 recording" in ended.out
    assert "each night of the baseline has 2" in ended.out
    assert opamc("nightly", cell, "--quiet", "--robot", "r1").out == ""
