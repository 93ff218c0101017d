"""Runs at the bounds of what they may hold."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.runs import run as run_module
from opamc_cli.storage.runs import writing
from opamc_cli.storage.runs.finding import find_runs, passed_over
from opamc_cli.storage.runs.hashes import file_sha256, know_sha256
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import save_run, write_run

INFO = RunInfo(100.0)


def saved(path, n=10, info=INFO, **columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    save_run(path, info, columns or {"axis1_a": np.arange(float(n))})
    return path


def raw(path, columns, **metadata):
    """Write what `save_run` would refuse."""
    schema = {"opamc": json.dumps({"sampling_rate_hz": 100} | metadata)}
    pq.write_table(pa.table(columns).replace_schema_metadata(schema), path)
    return path


def test_what_a_run_says_of_itself(tmp_path):
    assert INFO.to_json() == '{"sampling_rate_hz": 100.0}'
    torque = RunInfo(100.0, "R1", current_unit="Nm")
    assert torque.to_json() == '{"current_unit": "Nm", "robot": "R1", "sampling_rate_hz": 100.0}'
    with Run(saved(tmp_path / "r.parquet", info=torque)) as run:
        assert (run.info, run.name, run.n_samples, run.duration_s) == (torque, "r", 10, 0.1)
        assert run.sha256 == file_sha256(run.path)
    assert Run(tmp_path / "r.parquet", "other").name == "other"


def test_samples_are_the_same_whatever_a_run_says_of_itself(tmp_path):
    noise = np.random.default_rng(0).normal(size=(2, 400)).astype("f4")

    def hashed(info, current, **more):
        columns = {"axis1_a": noise[0], "axis2_current": current, **more}
        with Run(saved(tmp_path / "r.parquet", info=info, **columns)) as run:
            return run.currents_sha256

    first = hashed(INFO, noise[1])
    warm = {"axis1_temperature": noise[0], "time_s": np.arange(400) / 100}
    assert hashed(RunInfo(100.01, "R1", started_at="2026-03-01"), noise[1], **warm) == first
    assert hashed(INFO, noise[1][::-1].copy()) != first
    assert hashed(INFO, np.zeros(400, "f4")) != first
    with Run(saved(tmp_path / "r.parquet", axis1_a=np.full(400, 0.5))) as run:
        assert run.currents_sha256 == ""


def test_columns_of_an_axis(tmp_path):
    names = "axis2_a axis2_c axis2_position axis2_velocity axis10_current axis3_position time_s x"
    columns = {name: np.arange(10) / 100 for name in names.split()}
    run = Run(saved(tmp_path / "r.parquet", **columns))
    assert run.axes == (2, 10)
    own, other = run.channels(2), run.channels(10)
    assert own.phases == ("axis2_a", "axis2_c")
    assert (own.current, own.position, own.velocity) == (None, "axis2_position", "axis2_velocity")
    assert (other.phases, other.current, other.position) == ((), "axis10_current", None)
    with pytest.raises(InputError, match="axis 3 has no current column; the run has axes 2, 10"):
        run.channels(3)


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("sampling_rate_hz", 1e-3, 0.9e-3),
        ("sampling_rate_hz", 1e6, 1.1e6),
        ("speed_percent", 1e6, 1.1e6),
        ("speed_percent", 1e-3, 0.0),
        ("payload_kg", 0.0, -5.0),
        ("robot", "x" * 1000, "x" * 1001),
        ("current_unit", "Nm", "V"),
    ],
)
def test_bounds_of_metadata(tmp_path, key, good, bad):
    columns = {"axis1_a": [1.0]}
    assert getattr(Run(raw(tmp_path / "r.parquet", columns, **{key: good})).info, key) == good
    with pytest.raises(InputError, match=f"key 'opamc' says {key} is"):
        Run(raw(tmp_path / "r.parquet", columns, **{key: bad}))
    info = RunInfo(**{"sampling_rate_hz": 100.0, key: bad})
    with (
        pytest.raises(InputError, match=r"its metadata .*; correct the map or what was recorded"),
        write_run(tmp_path / "w.parquet", info, pa.schema([("axis1_a", pa.float32())])),
    ):
        pass


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("axis999_a", None),
        ("axis1000_a", "axes count from 1 to 999"),
        ("axis99999999999999999999_a", "axes count from 1 to 999"),
        ("axis0_a", "axes count from 1 to 999"),
        ("Axis 00 position", "axes count from 1 to 999"),
        ("Axis2_A", "is it axis2_a"),
        ("axis 02 current", "is it axis2_current"),
        ("axis1 a", None),  # its right name is there beside it
        ("axis2_d", None),
    ],
)
def test_columns_that_are_nearly_an_axis_s(tmp_path, name, why):
    path = raw(tmp_path / "r.parquet", {"axis1_a": [1.0], name: [1.0]})
    if why is None:
        Run(path)
    else:
        with pytest.raises(InputError, match=why):
            Run(path)


def test_samples_beyond_a_thousand_million_are_missing(tmp_path):
    values = np.array([1e9, -1e9, 1.1e9, -1.1e9])
    for width in ("f2", "f4", "f8", "i8"):
        kept = (np.arange(4) if width == "f2" else values).astype(width)
        path = raw(tmp_path / f"{width}.parquet", {"axis1_a": kept, "time_s": values})
        found = Run(path).read(["axis1_a", "time_s"])
        expected = kept if width == "f2" else [1e9, -1e9, np.nan, np.nan]
        np.testing.assert_allclose(found["axis1_a"], expected, rtol=1e-7)
        assert found["axis1_a"].dtype == (np.float64 if width[1] == "8" else np.float32)
        assert found["time_s"].tolist() == values.tolist()


def test_row_groups_of_a_bounded_size(tmp_path, monkeypatch):
    path = saved(tmp_path / "r.parquet")
    monkeypatch.setattr(run_module, "MOST_GROUP_SAMPLES", 10)
    Run(path)
    monkeypatch.setattr(run_module, "MOST_GROUP_SAMPLES", 9)
    with pytest.raises(InputError, match="a row group has 10 samples, at most 9"):
        Run(path)


def test_two_row_groups_of_each_column_are_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "ROW_GROUP_SAMPLES", 10)
    run = Run(saved(tmp_path / "r.parquet", axis1_a=np.arange(40.0), axis1_b=np.arange(40.0)))
    read = []
    whole = run._read_groups
    monkeypatch.setattr(run, "_read_groups", lambda g, c: (read.append((g[0], *c)), whole(g, c))[1])
    for start in (0, 10, 0, 10, 20, 10, 20, 0):
        assert run.read(["axis1_a"], start, start + 10)["axis1_a"].tolist() == [
            *range(start, start + 10)
        ]
    assert [group for group, _ in read] == [0, 1, 2, 0]
    assert run.read(["axis1_a", "axis1_b"], 5, 15)["axis1_b"].tolist() == [*range(5, 15)]
    assert run.read(["axis1_a"], 7, 7)["axis1_a"].size == 0
    assert run.read(["axis1_a"], 39, 99)["axis1_a"].tolist() == [39]


@pytest.mark.parametrize(
    ("step", "rate_off", "ok"),
    [(1.49, 0, True), (1.51, 0, False), (0.51, 0, True), (1, 0.0009, True), (1, 0.0011, False)],
)
def test_time_agrees_within_half_a_sample_and_a_thousandth(
    tmp_path, monkeypatch, step, rate_off, ok
):
    monkeypatch.setattr(writing, "ROW_GROUP_SAMPLES", 1000)
    monkeypatch.setattr(run_module, "ROW_GROUP_SAMPLES", 1000)
    steps = np.full(2999, 1 / (1 - rate_off))
    steps[999] = step  # between two blocks
    if step != 1:
        steps[1000] = 2 - step
    time_s = np.r_[0, np.cumsum(steps)] / 100
    path = saved(tmp_path / "r.parquet", axis1_a=np.zeros(3000), time_s=time_s)
    if ok:
        Run(path).check_time()
    else:
        with pytest.raises(InputError, match="at sample 999 " if step > 1.5 else "says 99.89"):
            Run(path).check_time()
    Run(saved(tmp_path / "one.parquet", axis1_a=[0.0], time_s=[9.0])).check_time()


def test_names_of_runs(tmp_path):
    one, other = saved(tmp_path / "x" / "a.parquet"), saved(tmp_path / "y" / "a.parquet")
    (tmp_path / "x" / "table.parquet").write_bytes(b"no Parquet: opening it says what is wrong")
    assert [name for name, _ in find_runs([tmp_path / "x"])] == ["a", "table"]
    # equal names are told apart by their whole paths
    assert [name for name, _ in find_runs([other, one])] == [
        str(path.with_suffix("")) for path in (one, other)
    ]
    assert find_runs([tmp_path / "x" / "a.*", one]) == [("a", one)]


def test_a_sum_that_is_known_is_not_taken_again(tmp_path):
    path = saved(tmp_path / "r.parquet")
    state = path.stat()
    know_sha256(path, state.st_mtime_ns, state.st_size + 1, "another size")
    assert len(file_sha256(path)) == 64
    other = saved(tmp_path / "s.parquet")
    know_sha256(other, other.stat().st_mtime_ns, other.stat().st_size, "known")
    assert file_sha256(other) == "known"


def test_recordings_that_are_no_runs_are_told_from_other_files(tmp_path):
    for name in (
        "a.csv",
        "night/b.MAT",
        "c.tdms",
        "d.csv.gz",
        "README.txt",
        "truth.json",
        ".e.csv",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1,2\n")
    save_run(tmp_path / "c.parquet", RunInfo(100.0), {"axis1_a": np.zeros(3, np.float32)})
    (said,) = passed_over([tmp_path, tmp_path / "c.parquet", tmp_path])
    assert "3 recordings are passed over (a.csv, …)" in said
    assert "`opamc ingest`" in said
    assert passed_over([tmp_path / "c.parquet"]) == []
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "monday").symlink_to(tmp_path / "night")
    (said,) = passed_over([tmp_path / "runs"])
    assert "monday: is a link to a folder" in said
