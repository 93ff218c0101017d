"""Folders that are replaced as a whole."""

import pytest

from opamc_cli.errors import UsageError
from opamc_cli.storage.files.folders import remove_folder, replace_folder


def contents(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*.*")}


def test_a_new_folder_takes_the_place_of_the_old_one_and_of_what_was_left(tmp_path):
    for left in (".night.part", ".night.old", "night"):
        (tmp_path / left).mkdir()
        (tmp_path / left / "old.txt").write_text("old")
    replace_folder(tmp_path / "night", {"a.txt": b"1", "deep/b.txt": b"2"})
    assert contents(tmp_path / "night") == {"a.txt": b"1", "deep/b.txt": b"2"}
    assert [p.name for p in tmp_path.iterdir()] == ["night"]


def test_what_cannot_be_written_leaves_the_old_folder(tmp_path):
    replace_folder(tmp_path / "night", {"a.txt": b"1"})
    with pytest.raises(UsageError, match=r"night: cannot be written .*check space"):
        replace_folder(tmp_path / "night", {"a": b"", "a/b.txt": b""})
    assert contents(tmp_path / "night") == {"a.txt": b"1"}
    assert [p.name for p in tmp_path.iterdir()] == ["night"]


def test_a_folder_goes_with_what_a_killed_process_left(tmp_path):
    for name in (".night.part", ".night.old", "night", "other"):
        (tmp_path / name).mkdir()
    remove_folder(tmp_path / "night")
    assert [p.name for p in tmp_path.iterdir()] == ["other"]
    remove_folder(tmp_path / "night")
    (tmp_path / "night").write_text("a file")
    with pytest.raises(UsageError, match=r"night: cannot be removed \(Not a dir"):
        remove_folder(tmp_path / "night")


def test_what_is_no_result_is_not_taken_away(tmp_path):
    (tmp_path / "night" / "deep").mkdir(parents=True)
    (tmp_path / "night" / "a.txt").write_text("old")
    log = tmp_path / "night" / "deep" / "cycle.parquet"
    log.write_text("a year of work")
    for take in (lambda: replace_folder(log.parents[1], {"a.txt": b"1"}, of={"a.txt"}),
                 lambda: remove_folder(log.parents[1], of={"a.txt"})):  # fmt: skip
        with pytest.raises(UsageError, match=r"cycle.parquet: would be removed and is no result"):
            take()
    assert log.read_text() == "a year of work"
    log.unlink()
    replace_folder(log.parents[1], {"a.txt": b"1"}, of={"a.txt"})
    assert contents(tmp_path / "night") == {"a.txt": b"1"}
