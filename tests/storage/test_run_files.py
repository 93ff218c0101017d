import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.errors import InputError
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.runs.writing import ROW_GROUP_SAMPLES, save_run, write_run

INFO = RunInfo(2048.0, "R1", "pick", 50.0, 1.0, "2022-10-26T08:17:21Z", "ab" * 32)


def noise(n, seed=0):
    return np.random.default_rng(seed).normal(size=n).astype(np.float32)


@settings(max_examples=30)
@given(
    n=st.integers(1, 400),
    group=st.integers(1, 100),
    start=st.integers(-5, 410),
    stop=st.none() | st.integers(-5, 410),
    width=st.sampled_from(["f4", "f8"]),
)
def test_any_range_reads_back_as_written(tmp_path_factory, n, group, start, stop, width):
    path = tmp_path_factory.mktemp("run") / "r.parquet"
    values = noise(n).astype(width)
    values[:: max(n // 3, 1)] = np.nan
    schema = pa.schema([("axis1_a", pa.from_numpy_dtype(values.dtype))])
    with write_run(path, INFO, schema) as writer:
        for at in range(0, n, group):
            writer.write_table(pa.table({"axis1_a": values[at : at + group]}))
    with Run(path) as run:
        assert (run.n_samples, run.info, run.axes) == (n, INFO, (1,))
        wanted = values[max(start, 0) : n if stop is None else max(stop, 0)]
        np.testing.assert_array_equal(run.read(["axis1_a"], start, stop)["axis1_a"], wanted)
        blocks = list(run.blocks(["axis1_a"]))
        lengths = [len(block["axis1_a"]) for _, block in blocks]
        assert [at for at, _ in blocks] == [sum(lengths[:k]) for k in range(len(blocks))]
        joined = np.concatenate([block["axis1_a"] for _, block in blocks])
        np.testing.assert_array_equal(joined, values)
        assert joined.dtype == values.dtype


def test_only_the_row_groups_asked_for_are_read(tmp_path, monkeypatch):
    path = tmp_path / "r.parquet"
    n = 3 * ROW_GROUP_SAMPLES
    save_run(path, INFO, {"axis1_a": noise(n), "axis1_b": noise(n)})
    run = Run(path)
    read = []
    whole = pq.ParquetFile.read_row_groups

    def spy(self, groups, **options):
        read.append((groups, options["columns"]))
        return whole(self, groups, **options)

    monkeypatch.setattr(pq.ParquetFile, "read_row_groups", spy)
    start = ROW_GROUP_SAMPLES + 5
    values = run.read(["axis1_b"], start, start + 100)["axis1_b"]
    np.testing.assert_array_equal(values, noise(n)[start : start + 100])
    across = slice(ROW_GROUP_SAMPLES - 1, ROW_GROUP_SAMPLES + 1)
    values = run.read(["axis1_b"], across.start, across.stop)["axis1_b"]
    np.testing.assert_array_equal(values, noise(n)[across])
    # the second range needs the first group too, the other is still held
    assert read == [([1], ["axis1_b"]), ([0], ["axis1_b"])]


def test_nulls_and_integers_become_floats(tmp_path):
    path = tmp_path / "r.parquet"
    columns = {"axis1_a": pa.array([1.0, None, 3.0], pa.float32()), "axis1_position": [1, None, 2]}
    table = pa.table(columns)
    with write_run(path, INFO, table.schema) as writer:
        writer.write_table(table)
    data = Run(path).read(["axis1_a", "axis1_position"])
    np.testing.assert_array_equal(data["axis1_a"], [1, np.nan, 3])
    np.testing.assert_array_equal(data["axis1_position"], [1, np.nan, 2])


@pytest.mark.parametrize("width", [np.float32, np.float64])
def test_infinities_are_missing_values(tmp_path, width):
    path = tmp_path / "r.parquet"
    save_run(path, INFO, {"axis1_a": np.array([1, np.inf, -np.inf, 2], dtype=width)})
    run = Run(path)
    (_, block), values = next(run.blocks(["axis1_a"])), run.read(["axis1_a"])
    for found in (block["axis1_a"], values["axis1_a"]):
        assert found.dtype == width
        np.testing.assert_array_equal(found, [1, np.nan, np.nan, 2])


def test_writing_twice_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        save_run(tmp_path / name, INFO, {"axis1_a": noise(300_000)})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_every_flipped_byte_is_noticed(tmp_path):
    path = tmp_path / "r.parquet"
    values = noise(20_000)
    save_run(path, INFO, {"axis1_a": values})
    content = path.read_bytes()
    damaged = tmp_path / "damaged.parquet"
    for at in np.linspace(0, len(content) - 1, 60).astype(int):
        flipped = bytearray(content)
        flipped[at] ^= 0x10
        damaged.write_bytes(flipped)
        try:
            found = Run(damaged).read(["axis1_a"])["axis1_a"]
        except InputError:
            continue
        # what is not noticed must be harmless: statistics, names of the writer
        np.testing.assert_array_equal(found, values, err_msg=f"byte {at} of {len(content)}")


@pytest.mark.parametrize("keep", [0, 1, 4, 100, 0.5, 0.99])
def test_a_truncated_run_is_refused(tmp_path, keep):
    path = tmp_path / "r.parquet"
    save_run(path, INFO, {"axis1_a": noise(5000)})
    content = path.read_bytes()
    path.write_bytes(content[: int(keep * len(content)) if isinstance(keep, float) else keep])
    with pytest.raises(InputError, match="cannot be opened as Parquet") as caught:
        Run(path)
    assert "\n" not in str(caught.value)
    # as of a logger that stopped, or has not ended yet
    assert ("cut off, or still being written" in str(caught.value)) == (keep not in (0, 1, 4))


def raw_run(path, metadata, columns=None):
    table = pa.table({"axis1_a": [1.0, 2.0]} if columns is None else columns)
    pq.write_table(table.replace_schema_metadata(metadata), path)
    return path


@pytest.mark.parametrize(
    ("metadata", "columns", "expected"),
    [
        (None, None, "is not a run"),
        ({"opamc_table": "{}"}, None, "is a stage table"),
        ({"opamc": "{"}, None, "is not JSON"),
        ({"opamc": b"\xff"}, None, "is not JSON"),
        ({"opamc": "[1]"}, None, "holds no JSON object"),
        ({"opamc": "{}"}, None, "no sampling_rate_hz"),
        ({"opamc": '{"sampling_rate_hz": 0}'}, None, "sampling_rate_hz is 0;"),
        ({"opamc": '{"sampling_rate_hz": -5}'}, None, "sampling_rate_hz is -5"),
        ({"opamc": '{"sampling_rate_hz": NaN}'}, None, "sampling_rate_hz is nan"),
        ({"opamc": '{"sampling_rate_hz": "2048"}'}, None, "sampling_rate_hz is '2048'"),
        ({"opamc": '{"sampling_rate_hz": true}'}, None, "sampling_rate_hz is True"),
        ({"opamc": '{"sampling_rate_hz": 1, "payload_kg": "two"}'}, None, "payload_kg is 'two'"),
        (
            {"opamc": '{"sampling_rate_hz": 1, "started_at": "yesterday"}'},
            None,
            "started_at is 'yesterday'; an ISO 8601 time such as 2026-03-01T22:00:00Z is needed",
        ),
        ({"opamc": '{"sampling_rate_hz": 1, "started_at": 5}'}, None, "started_at is 5; an ISO"),
        ({"opamc": '{"sampling_rate_hz": 1}'}, {"axis1_a": ["x"]}, "axis1_a has type string"),
        ({"opamc": '{"sampling_rate_hz": 1}'}, {"current": [1.0]}, "no current column among"),
        ({"opamc": '{"sampling_rate_hz": 1}'}, {"axis0_a": [1.0]}, "axes count from 1 to 999"),
        (
            {"opamc": '{"sampling_rate_hz": 1}'},
            {"axis1_position": [1.0]},
            "no current column among",
        ),
        ({"opamc": '{"sampling_rate_hz": 1}'}, {"axis1_a": pa.array([], "f8")}, "no samples"),
    ],
)
def test_files_that_are_no_run_are_refused(tmp_path, metadata, columns, expected):
    path = raw_run(tmp_path / "r.parquet", metadata, columns)
    with pytest.raises(InputError) as caught:
        Run(path)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_unknown_metadata_is_left_alone(tmp_path):
    text = json.dumps({"sampling_rate_hz": 100, "operator": "somebody"})
    assert Run(raw_run(tmp_path / "r.parquet", {"opamc": text})).sampling_rate_hz == 100


@pytest.mark.parametrize("when", [None, "", "2026-03-01", "20260301T2200+0100", "2026-03-01 22:00"])
def test_a_start_may_be_missing_or_a_time_of_any_form(tmp_path, when):
    text = json.dumps({"sampling_rate_hz": 100, "started_at": when})
    assert Run(raw_run(tmp_path / "r.parquet", {"opamc": text})).info.started_at == when


def test_names_that_are_numbers_are_names(tmp_path):
    text = json.dumps({"sampling_rate_hz": 100, "program": 7, "robot": 3, "session": 5})
    info = Run(raw_run(tmp_path / "r.parquet", {"opamc": text})).info
    assert (info.program, info.robot, info.session) == ("7", "3", "5")


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda t: t, None),
        (lambda t: t + 1e9, None),
        (lambda t: t + np.where(np.arange(len(t)) >= 50, 0.5, 0), "steps by 0.51 s at sample 49"),
        (lambda t: t * 1.01, "says 99.0099 Hz"),
        (lambda t: np.where(np.arange(len(t)) == 7, np.nan, t), "at sample 6"),
        (lambda t: t[::-1].copy(), "steps by -0.01 s"),
    ],
)
def test_time_must_agree_with_the_rate(tmp_path, change, expected):
    path = tmp_path / "r.parquet"
    time_s = change(np.arange(100) / 100)
    save_run(path, RunInfo(100.0), {"axis1_a": noise(100), "time_s": time_s})
    if expected is None:
        Run(path).check_time()
        return
    with pytest.raises(InputError, match=r"column time_s") as caught:
        Run(path).check_time()
    assert expected in str(caught.value)


def test_columns_of_different_length_are_refused(tmp_path):
    with pytest.raises(InputError, match="columns of different length"):
        save_run(tmp_path / "r.parquet", INFO, {"axis1_a": noise(5), "axis1_b": noise(6)})
    assert not list(tmp_path.iterdir())


# -- finding runs --------------------------------------------------------------------------


def test_folders_stand_for_their_runs(tmp_path):
    for name in ("b/2.parquet", "b/1.parquet", "a.parquet"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        save_run(tmp_path / name, INFO, {"axis1_a": noise(10)})
    raw_run(tmp_path / "segments.parquet", {"opamc_table": "{}"})
    (tmp_path / ".hidden.parquet").write_bytes(b"half")
    found = find_runs([tmp_path, tmp_path / "a.parquet"])
    assert [name for name, _ in found] == ["a", "b/1", "b/2"]
    whole = find_runs([tmp_path / "b" / "1.parquet", tmp_path / "b"])
    assert [name for name, _ in whole] == ["1", "2"]


def test_empty_folders_and_missing_paths_are_refused(tmp_path):
    with pytest.raises(InputError, match="the folder holds no run"):
        find_runs([tmp_path])
    with pytest.raises(InputError, match="no such file or folder"):
        find_runs([tmp_path / "x"])


def test_blocks_are_bounded_whatever_the_row_groups(tmp_path):
    path = tmp_path / "r.parquet"
    n = ROW_GROUP_SAMPLES + 1000
    table = pa.table({"axis1_a": noise(n)})
    metadata = {"opamc": json.dumps({"sampling_rate_hz": 1})}
    pq.write_table(table.replace_schema_metadata(metadata), path)  # one row group
    lengths = [len(block["axis1_a"]) for _, block in Run(path).blocks(["axis1_a"])]
    assert sum(lengths) == n
    assert max(lengths) <= ROW_GROUP_SAMPLES
