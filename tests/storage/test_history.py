"""The history's file by itself; tests/stages/nightly has what nights put there."""

import sqlite3
from contextlib import closing, suppress

import pytest

from opamc_cli.errors import UsageError
from opamc_cli.storage.history import history
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import Declared, Event, NightRow

KEY = '{"version": "1", "config": "c", "baseline": "b", "files": []}'


def test_a_file_tells_the_layout_that_it_has(tmp_path):
    path = tmp_path / "history.sqlite"
    History(path).__exit__()
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (1,)


def test_a_file_that_another_program_has_open_is_no_full_disk(tmp_path, monkeypatch):
    path = tmp_path / "history.sqlite"
    History(path).__exit__()
    monkeypatch.setattr(history, "BUSY_S", 0.01)
    with closing(sqlite3.connect(path, isolation_level=None)) as viewer:
        viewer.execute("BEGIN EXCLUSIVE")
        said = r"\(database is locked\); another program has it open"
        with History(path) as kept, pytest.raises(UsageError, match=said):
            kept.replace_missing([Event("2026-03-02T00:00:00Z", "R1", None, "missing", "no files")])


def test_missing_nights_are_written_anew_only_if_they_differ(tmp_path):
    gone = Event("2026-03-02T00:00:00Z", "R1", None, "missing", "no files")
    path = tmp_path / "history.sqlite"
    with History(path) as history, closing(sqlite3.connect(path)) as other:

        def changed():
            return other.execute("PRAGMA data_version").fetchone()

        history.replace_missing([gone])
        before = changed()
        history.replace_missing([gone])
        assert changed() == before
        history.replace_missing([])
        assert changed() != before
        assert history.events() == []


def test_nights_are_read_once_until_somebody_writes(tmp_path, monkeypatch):
    path = tmp_path / "history.sqlite"
    read, rows = [], History.rows
    monkeypatch.setattr(History, "rows", lambda *given: read.append(1) or rows(*given))

    def known(history):
        return [night for _, night in history.nights()]

    with History(path) as history, History(path) as other:
        assert known(history) == []
        history.record_night(NightRow("r1", "2026-03-01", KEY, "done"))
        assert known(history) == ["2026-03-01"]
        before = len(read)
        history.nights().clear()  # theirs, who asked
        assert known(history) == ["2026-03-01"]
        assert len(read) == before
        other.record_night(NightRow("r1", "2026-03-02", KEY, "done"))
        assert known(history) == ["2026-03-01", "2026-03-02"]
        with suppress(LookupError), history.transaction():
            history._db.execute("DELETE FROM night")
            assert known(history) == []
            raise LookupError
        assert known(history) == ["2026-03-01", "2026-03-02"]


def test_what_another_program_says_of_the_same_axis_and_night_is_news(tmp_path):
    first, second = (
        Event("2026-03-01", "r1", 1, "not-judged", f"axis 1 in program {name}: not judged")
        for name in ("lift", "place")
    )
    with History(tmp_path / "history.sqlite") as history:
        history.settle("r1", [], [], [first])
        history.tell(history.events(untold=True))
        history.settle("r1", [], [], [first])
        assert history.events(untold=True) == []
        history.settle("r1", [], [], [first, second])
        assert history.events(untold=True) == [first, second]
        history.tell(history.events(untold=True))
        history.settle("r1", [], [], [second])
        assert history.events(untold=True) == []


def test_verdicts_of_two_programs_that_are_others_are_both_kept(tmp_path):
    night = NightRow("r1", "2026-03-01", KEY, "done")
    both = [
        Event("2026-03-01", "r1", 1, "judged-anew", f"axis 1 in program {name} healthy, was fault")
        for name in ("lift", "place")
    ]
    with History(tmp_path / "history.sqlite") as history:
        history.record_night(night, events=both)
        assert history.events(untold=True) == both
        history.tell(both)
        history.record_night(night, events=both)
        assert history.events(untold=True) == []
        history.record_night(night, events=both[:1])
        assert history.events() == both


def test_an_alarm_that_was_acknowledged_is_news_if_it_stands_again(tmp_path):
    """Without a start between: nobody but the declaration knows that it was silent."""
    stands = Event("2026-03-02 lift", "r1", 2, "stands", "")
    with History(tmp_path / "history.sqlite") as history:
        history.tell([stands, Event("2026-03-02 lift", "r1", 1, "stands", "")])
        history.declare(Declared("t", "r1", 2, "acknowledged", "2026-03-04", "gear"), "known")
        assert history.untold([stands]) == [stands]
        told = {(one.axis, one.kind) for one in history.told(("stands", "known"))}
        assert told == {(1, "stands"), (2, "known")}
