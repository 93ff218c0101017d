"""The history's file by itself; tests/stages/nightly has what nights put there."""

import sqlite3
from contextlib import closing

from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import Event


def test_a_file_tells_the_layout_that_it_has(tmp_path):
    path = tmp_path / "history.sqlite"
    History(path).__exit__()
    with closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (1,)


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
