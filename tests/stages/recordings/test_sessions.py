"""Which recordings are one session: by metadata, night, folder and file, in this order."""

from pathlib import Path

import pytest

from opamc_cli.stages.recordings.sessions import in_words, lie_in_folders, night_of, sessions_of
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.sources import RunSource


def source(path, **info):
    return RunSource(Path(path).stem, Path(path), "0" * 64, 1000, RunInfo(100.0, **info))


@pytest.mark.parametrize(
    ("text", "night"),
    [
        ("2026-03-01T22:00:00+00:00", "2026-03-01"),
        ("2026-03-02T03:00:00Z", "2026-03-01"),
        ("2026-03-02T12:00:00", "2026-03-02"),
        ("2026-03-02T13:30:00+02:00", "2026-03-01"),
        ("yesterday", None),
        (None, None),
    ],
)
def test_a_night_shift_is_one_night(text, night):
    found = night_of(text, 12.0)
    assert (found.isoformat() if found else None) == night


def test_metadata_comes_before_the_night_and_the_night_before_the_folder():
    runs = [
        source("a/1.parquet", session="s", started_at="2026-03-01T22:00:00Z"),
        source("b/2.parquet", session="s", started_at="2026-03-05T22:00:00Z"),
        source("a/3.parquet", started_at="2026-03-01T22:00:00Z"),
        source("b/4.parquet", started_at="2026-03-02T02:00:00Z"),
        source("a/5.parquet"),
        source("a/6.parquet"),
    ]
    found = sessions_of(runs, 12.0, lie_in_folders(runs))
    assert found.of_run["1"] == found.of_run["2"]
    assert found.of_run["3"] == found.of_run["4"]
    assert found.of_run["5"] == found.of_run["6"]
    assert len(found) == 3
    assert found.told_by == ("session", "night", "folder")


def test_one_folder_for_all_tells_nothing():
    runs = [source("normal/1.parquet"), source("normal/2.parquet")]
    assert not lie_in_folders(runs)
    found = sessions_of(runs, 12.0, lie_in_folders(runs))
    assert len(found) == 2
    assert "each is taken for a session of its own" in " ".join(in_words(found, found))


def test_many_files_of_one_night_are_said_to_be_one_session():
    runs = [source(f"{k}.parquet", started_at=f"2026-03-01T2{k}:00:00Z") for k in range(3)]
    found = sessions_of(runs, 12.0)
    assert len(found) == 1
    assert "3 runs are 1 session, told apart by night" in in_words(found, found)[0]


def test_a_clock_that_was_never_set_does_not_make_one_session_of_dated_folders():
    never = "1970-01-01T00:00:40Z"
    runs = [source(f"2026-03-0{k}/{k}.parquet", started_at=never) for k in (1, 2, 3)]
    found = sessions_of(runs, 12.0, lie_in_folders(runs))
    assert (len(found), found.told_by, found.wrong_clocks) == (3, ("folder",), 3)
    assert "more than a day off the date of their folder" in " ".join(in_words(found, found))
    # a folder of the next morning is the same night
    near = [
        source("2026-03-01/1.parquet", started_at="2026-03-01T22:00:00Z"),
        source("2026-03-02/2.parquet", started_at="2026-03-02T03:00:00Z"),
    ]
    assert len(sessions_of(near, 12.0, lie_in_folders(near))) == 1


def test_a_folder_of_a_date_is_a_night_where_folders_tell_nights():
    """A day shift, 06:30 to 16:00, was two nights, the first of the day before."""
    runs = [
        source(f"{day[:10]}/{k}.parquet", started_at=f"{day}:00Z")
        for k, day in enumerate(("2026-03-01T06:30", "2026-03-01T16:00", "2026-03-02T06:30"))
    ]
    assert sorted({*sessions_of(runs, 12.0).of_run.values()}) == ["2026-02-28", "2026-03-01"]
    found = sessions_of(runs, None)
    assert [*found.of_run.values()] == ["2026-03-01", "2026-03-01", "2026-03-02"]
    assert found.told_by == ("night",)
    # but what is called a session is one
    other = source("a/1.parquet", session="s", started_at="2026-03-01T22:00:00Z")
    assert sessions_of([other], None).told_by == ("session",)


def test_a_start_that_is_no_time_is_said():
    runs = [source(f"{k}.parquet", started_at="0001-01-01") for k in range(3)]
    found = sessions_of(runs, 12.0)
    assert (len(found), found.told_by, found.unread_clocks) == (3, ("file",), 3)
    assert "started_at of 3 of 3 runs is no time" in " ".join(in_words(found, found))
