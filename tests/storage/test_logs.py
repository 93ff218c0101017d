"""Which files of a cell are recordings, whose they are, and of which night."""

import hashlib

import numpy as np
import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.logs import (
    Facts,
    LogFile,
    copy_name,
    fetch,
    find_logs,
    find_logs_and_strays,
    find_unnamed,
    read_facts,
)
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import save_run


@pytest.mark.parametrize(
    ("folder", "night"),
    [
        ("2026-03-02", "2026-03-02"),
        ("20260302", "2026-03-02"),
        ("2026-02-30", None),  # no day: the recording itself has to tell, or it is said
        ("2026-3-2", None),
    ],
)
def test_a_night_is_a_day_or_left_to_the_recording(tmp_path, folder, night):
    path = tmp_path / "r1" / folder / "a.parquet"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"")
    (log,) = find_logs(f"{tmp_path}/{{robot}}/{{night}}/*.parquet", None)
    assert (log.robot, log.night) == ("r1", night)


def test_other_folders_beside_the_nights_are_no_logs_but_strays(tmp_path):
    folders = ("2026", "archive", "tmp-2026-03-02")
    for folder in (*folders, ".hidden", "2026-03-02"):
        touch(tmp_path / "r1" / folder / "a.parquet")
        touch(tmp_path / "r1" / folder / "b.parquet")
    touch(tmp_path / "r1" / "notes" / "a.txt")
    for scheme in ("", "file://"):
        pattern = f"{scheme}{tmp_path}/{{robot}}/{{night}}/*.parquet"
        logs, strays = find_logs_and_strays(pattern, None)
        assert logs == find_logs(pattern, None)
        assert [log.night for log in logs] == ["2026-03-02", "2026-03-02"]
        assert strays == [("r1", f"{scheme}{tmp_path}/r1/{folder}") for folder in folders]
        assert find_logs_and_strays(pattern, ("r2",)) == ([], [])
        assert find_logs_and_strays(pattern.replace("{night}", "*"), None)[1] == []
    assert find_logs(f"{tmp_path}/r1/{{night}}/*.parquet", ("r1",)) == find_logs(
        f"{tmp_path}/{{robot}}/{{night}}/*.parquet", None
    )


def touch(path, content=b""):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("scheme", ["", "file://"])
def test_patterns(tmp_path, scheme):
    for name in ("r1/2026-03-02/a.parquet", "r1/2026-03-02/deep/er/b.parquet", "r2/x.parquet"):
        touch(tmp_path / name, b"xyz")
    touch(tmp_path / "r[3]" / "2026-03-01" / "1" / "a.parquet")

    def found(pattern, robots=None):
        logs = find_logs(f"{scheme}{tmp_path}/{pattern}", robots)
        place = f"{scheme}{tmp_path}/"
        assert all(log.path.startswith(place) and log.remote is bool(scheme) for log in logs)
        return [(log.robot, log.night, log.path.removeprefix(place)) for log in logs]

    a, b = "r1/2026-03-02/a.parquet", "r1/2026-03-02/deep/er/b.parquet"
    odd = "r[3]/2026-03-01/1/a.parquet"
    assert found("{robot}/{night}/*.parquet") == [("r1", "2026-03-02", a)]
    assert found("{robot}/{night}/**/*.parquet") == [
        *(("r1", "2026-03-02", a), ("r1", "2026-03-02", b), ("r[3]", "2026-03-01", odd))
    ]
    assert found("{robot}/{night}/**/*.parquet", ("r[3]", "r9")) == [("r[3]", "2026-03-01", odd)]
    assert found("{robot}/?.parquet") == [("r2", None, "r2/x.parquet")]
    assert found("{robot}/[!abd].parquet") == [("r2", None, "r2/x.parquet")]
    assert found("{robot}/[ab].parquet") == []
    # one baseline for several robots
    assert found("r2/*.parquet", ("x", "w")) == [
        *(("w", None, "r2/x.parquet"), ("x", None, "r2/x.parquet"))
    ]
    assert found("none/{robot}/*") == []
    # the same name twice is the same robot twice
    touch(tmp_path / "s" / "r1" / "r1-x.parquet")
    touch(tmp_path / "s" / "r1" / "r2-x.parquet")
    assert found("s/{robot}/{robot}-x.parquet") == [("r1", None, "s/r1/r1-x.parquet")]
    size = {
        log.path.rpartition("/")[2]: log.size
        for log in find_logs(f"{scheme}{tmp_path}/{{robot}}/*.parquet", None)
    }
    assert size == {"x.parquet": 3}


def test_an_address_that_cannot_be_listed_is_told():
    with pytest.raises(InputError, match=r"cannot be listed .*; check address and credentials"):
        find_logs("nothing://place/{robot}/*.parquet", None)


def test_facts_of_a_recording_and_of_none(tmp_path):
    path = tmp_path / "copy.parquet"
    info = RunInfo(100.0, "R1", "pick", 50.0, 1.5, "2026-03-02T00:00:00Z")
    save_run(path, info, {"axis1_a": np.zeros(10)})
    log = LogFile("s3://place/a.parquet", "r1", None, 1, 2)
    digest, facts = read_facts(log, path)
    assert digest == hashlib.sha256(path.read_bytes()).hexdigest()
    assert facts == Facts("pick", 50.0, 1.5, 100.0, "2026-03-02T00:00:00Z", "R1")
    assert Facts.from_json(facts.to_json()) == facts
    assert Facts.of(RunInfo(100.0)) == Facts(sampling_rate_hz=100.0)
    path.write_bytes(b"no run")
    digest, facts = read_facts(log, path)
    assert digest == hashlib.sha256(b"no run").hexdigest()
    assert facts.error.startswith("s3://place/a.parquet: cannot be opened")
    assert read_facts(log, tmp_path / "none")[1].error == (
        "s3://place/a.parquet: cannot be read (No such file or directory)"
    )


def test_a_recording_is_fetched_once_and_whole(tmp_path):
    path = touch(tmp_path / "a.parquet", b"one")
    assert fetch(LogFile(str(path), "r", None, 3, 1), tmp_path / "to") == path
    log = LogFile(f"file://{path}", "r", None, 3, 1)
    copy = fetch(log, tmp_path / "to" / "deep")
    assert copy == tmp_path / "to" / "deep" / copy_name(log)
    assert copy.read_bytes() == b"one"
    path.write_bytes(b"two")
    assert fetch(log, copy.parent).read_bytes() == b"one"
    # other bytes have another name
    later = LogFile(log.path, "r", None, 3, 2)
    assert fetch(later, copy.parent).read_bytes() == b"two"
    path.unlink()
    with pytest.raises(InputError, match=r"cannot be fetched .*; check address and credentials"):
        fetch(LogFile(log.path, "r", None, 4, 2), copy.parent)
    assert len(list(copy.parent.iterdir())) == 2


@pytest.mark.parametrize(
    ("pattern", "places"),
    [
        ("{robot}/{night}/*.parquet", "r{}/2026-03-01/x.parquet"),
        ("{night}/{robot}/*.parquet", "2026-03-01/r{}/x.parquet"),
        ("**/{robot}/log/*.parquet", "a/r{}/log/x.parquet"),
        ("{robot}_{night}.parquet", "r{}_2026-03-01.parquet"),
        ("{robot}/{robot}_{night}.parquet", "r{0}/r{0}_2026-03-01.parquet"),
    ],
)
def test_robots_that_nobody_named_are_found_if_they_have_recordings(tmp_path, pattern, places):
    for robot in "123":
        path = tmp_path / places.format(robot)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    (tmp_path / "lost+found").mkdir()
    (tmp_path / "old" / "mar-01").mkdir(parents=True)
    (tmp_path / "old" / "mar-01" / "x.parquet").write_text("")
    found = find_unnamed(f"{tmp_path}/{pattern}", ("r2",))
    assert [robot for robot, _ in found] == ["r1", "r3"]
    assert all(at.endswith(robot) for robot, at in found)
    assert find_unnamed(f"{tmp_path}/{pattern}", ("r1", "r2", "r3")) == []
