"""What a recording of each format offers: its channels, their values, and single values."""

from datetime import UTC, datetime

import foreign
import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.map.map_file import ColumnMap, IngestMap
from opamc_cli.storage.ingest.opening import open_source
from opamc_cli.storage.ingest.readers import arrow, hdf5, mat, mdf, ros, tdms
from opamc_cli.storage.ingest.source import Listed, Selection

X, BLOCK = np.arange(10.0), np.arange(30).reshape(10, 3)
DATES = np.datetime64("2026-03-01T08:00:00", "us") + np.arange(10).astype("m8[s]")
TEXTS = [f"2026-03-01T08:00:0{k}Z" for k in range(10)]


def opened(path, kind=None):
    columns = {"axis1_a": ColumnMap(source=0, unit="A")}
    return open_source(path, IngestMap(columns=columns, format=kind))


def channel(source, name, index=None, dates=False):
    """Return a channel whole; its blocks have at most four rows, see `small_blocks`."""
    parts = [block["x"] for block in source.blocks({"x": Selection(name, index, dates)})]
    assert max(map(len, parts)) <= 4
    return np.concatenate(parts)


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    for module in (arrow, hdf5, mat, mdf, ros, tdms):
        monkeypatch.setattr(module, "BLOCK_ROWS", 4, raising=False)


def test_hdf5(tmp_path):
    path = tmp_path / "r.h5"
    with h5py.File(path, "w") as file:
        file["g/x"] = X
        file["g/x"].attrs["unit"] = "mA"
        file["g/block"] = BLOCK
        file["g/block"].attrs["units"] = b"deg"
        file["turned"] = BLOCK.T
        file["row"] = X[np.newaxis]
        file["dates"] = [text.encode() for text in TEXTS]
        file["cube"], file["one"], file["flag"] = np.zeros((2, 2, 2)), 5.0, X > 3
        file["log"] = np.array([(1, b"a")] * 10, dtype=[("i", "i4"), ("s", "S1")])
        file.attrs["robot"] = b"R7"
        file["g"].attrs["loads"] = [1.5, 2.5]
        file["g"].attrs["none"] = np.empty(0)
    with opened(path) as source:
        assert source.channels() == [
            Listed("g/block", 3, "deg"),
            Listed("g/x", None, "mA"),
            Listed("log.i"),
            Listed("row"),
            Listed("turned", 3),
        ]
        np.testing.assert_array_equal(channel(source, "g/x"), X)
        np.testing.assert_array_equal(channel(source, "row"), X)
        np.testing.assert_array_equal(channel(source, "flag"), X > 3)
        for name in ("g/block", "turned"):
            for k in range(3):
                np.testing.assert_array_equal(channel(source, name, k), BLOCK[:, k])
        np.testing.assert_array_equal(channel(source, "log.i"), np.ones(10))
        np.testing.assert_array_equal(channel(source, "dates", dates=True), DATES)
        assert source.value("@robot") == "R7"
        assert source.value("g@loads") == 1.5
        assert source.value("g/x@unit") == "mA"
        assert (source.value("one"), source.value("log.s")) == (5.0, "a")
        for name, why in (
            ("g@other", "no channel 'g@other'; the file has g@loads, g@none"),
            ("nothing@x", "no channel 'nothing@x'; the file has .*g/x"),
            ("g@none", "'g@none' is empty where a value is needed"),
        ):
            with pytest.raises(InputError, match=why):
                source.value(name)


def test_mat(tmp_path):
    path = tmp_path / "r.mat"
    inner = {"x": X, "block": BLOCK, "s": "text", "deep": {"y": X[:, None]}}
    dates = np.array(TEXTS, dtype=object)
    scipy.io.savemat(path, {"g": inner, "row": X, "turned": BLOCK.T, "dates": dates, "e": []})
    with opened(path) as source:
        assert source.channels() == [
            *(Listed("g.x"), Listed("g.block", 3), Listed("g.deep.y")),
            *(Listed("row"), Listed("turned", 3)),
        ]
        for name in ("g.x", "g.deep.y", "row"):
            np.testing.assert_array_equal(channel(source, name), X)
        for name in ("g.block", "turned"):
            np.testing.assert_array_equal(channel(source, name, 1), BLOCK[:, 1])
            assert channel(source, name, 1).dtype == np.float64
        np.testing.assert_array_equal(channel(source, "dates", dates=True), DATES)
        assert (source.value("g.x"), source.value("g.s")) == (0.0, "text")
        with pytest.raises(InputError, match="'e' is empty where a value is needed"):
            source.value("e")
        with pytest.raises(InputError, match="'g' holds a struct, numbers are needed"):
            channel(source, "g")
        with pytest.raises(InputError, match=r"no channel 'g\.z'; the file has x, block, s, deep"):
            channel(source, "g.z")


def test_tdms(tmp_path):
    path = tmp_path / "r.tdms"
    channels = [
        ChannelObject("g", "x", X, {"unit_string": "A"}),
        ChannelObject("g", "when", DATES),
        ChannelObject("g", "text", np.array(TEXTS)),
        ChannelObject("h", "n", np.arange(10, dtype=np.int16)),
        ChannelObject("h", "empty", np.empty(0)),
    ]
    with TdmsWriter(path) as writer:
        group = GroupObject("g", {"load": 1.5})
        writer.write_segment([RootObject({"robot": "R7"}), group, *channels])
    with opened(path) as source:
        assert source.channels() == [
            *(Listed("g/x", unit="A"), Listed("g/when", dates=True), Listed("h/n"))
        ]
        np.testing.assert_array_equal(channel(source, "g/x"), X)
        found = channel(source, "h/n")
        np.testing.assert_array_equal(found, X)
        assert found.dtype == np.float64
        for name in ("g/when", "g/text"):
            found = channel(source, name, dates=True)
            np.testing.assert_array_equal(found, DATES)
            assert found.dtype == np.dtype("M8[us]")
        assert (source.value("@robot"), source.value("g@load")) == ("R7", 1.5)
        assert (source.value("g/x@unit_string"), source.value("h/n")) == ("A", 0)
        with pytest.raises(InputError, match="channel 'h/empty' is empty"):
            source.value("h/empty")
        with pytest.raises(InputError, match="no channel 'g@none'; the file has g@load"):
            source.value("g@none")
        with pytest.raises(InputError, match="has one dimension; drop its index"):
            channel(source, "g/x", 0)


@pytest.mark.parametrize("ending", ["parquet", "arrow"])
def test_arrow(tmp_path, ending):
    path = tmp_path / f"r.{ending}"
    table = pa.table(
        {
            "x": X,
            "when": pa.array(DATES),
            "list": [[k, k + 1, k + 2] if k else [0, 1, 2, 9] for k in range(10)],
            "fixed": pa.array([[k, -k] for k in range(10)], pa.list_(pa.int8(), 2)),
            "s": pa.array([{"y": float(k), "z": "t"} for k in range(10)]),
            "a.b": pa.array([None, *range(1, 10)], pa.int32()),
            "text": [None, *TEXTS[1:]],
            "none": pa.array([None] * 10, pa.float64()),
        }
    ).replace_schema_metadata({"robot": "R7"})
    if ending == "parquet":
        pq.write_table(table, path)
    else:  # a stream, which Feather is not
        with pa.OSFile(str(path), "wb") as file, pa.ipc.new_stream(file, table.schema) as stream:
            stream.write_table(table)
    with opened(path) as source:
        assert source.channels() == [
            *(Listed("x"), Listed("when", dates=True), Listed("list", 4), Listed("fixed", 2)),
            *(Listed("s.y"), Listed("a.b"), Listed("none")),
        ]
        np.testing.assert_array_equal(channel(source, "x"), X)
        np.testing.assert_array_equal(channel(source, "s.y"), X)
        np.testing.assert_array_equal(channel(source, "a.b"), [np.nan, *range(1, 10)])
        np.testing.assert_array_equal(channel(source, "list", 2), X + 2)
        np.testing.assert_array_equal(channel(source, "fixed", 1), -X)
        np.testing.assert_array_equal(channel(source, "when", dates=True), DATES)
        found = channel(source, "text", dates=True)
        assert np.isnat(found[0])
        np.testing.assert_array_equal(found[1:], DATES[1:])
        assert (source.value("@robot"), source.value("a.b"), source.value("s.z")) == ("R7", 1, "t")
        both = {"one": Selection("x"), "other": Selection("s.y")}
        assert [len(block["other"]) for block in source.blocks(both)] == [4, 4, 2]
        for name, index, why in (
            ("x", 0, "'x' holds single values; drop its index"),
            ("list", 3, r"'list' holds lists of 3 values, index is 3; set index to 0\.\.2"),
            ("list", None, "index is None; set index to"),
            ("text", None, "'text' holds string, numbers are needed"),
            ("y", None, r"no channel 'y'; the file has x, when, list, fixed, s\.y, s\.z, a\.b"),
        ):
            with pytest.raises(InputError, match=why):
                channel(source, name, index)
        for name, why in (
            ("@other", "no channel '@other'; the file has @robot"),
            ("none", "column 'none' is empty where a value is needed"),
            ("y", "no channel 'y'; the file has x, when"),
        ):
            with pytest.raises(InputError, match=why):
                source.value(name)


def test_mdf(tmp_path):
    recorded = foreign.recording(seconds=0.08)
    with opened(foreign.mdf(tmp_path / "r.mf4", recorded)) as source:
        names = [f"Axis{k}_{kind}" for k in range(1, 7) for kind in ("Iq", "Angle")]
        units = {"Iq": "A", "Angle": "deg"}
        assert source.channels() == [
            Listed("time", unit="s", rows=len(recorded.time_s)),
            *(
                Listed(name, unit=units[name.split("_")[1]], rows=len(recorded.time_s))
                for name in names
            ),
        ]
        np.testing.assert_allclose(channel(source, "time"), recorded.time_s)
        np.testing.assert_allclose(channel(source, "Axis2_Iq"), recorded.current[:, 1])
        assert source.value("Axis2_Iq") == recorded.current[0, 1]
        assert isinstance(source.value("@start_time"), datetime)
        with pytest.raises(InputError, match=r"no channel 'x'; the file has time, Axis1_Iq, .*…"):
            channel(source, "x")


def test_ros(tmp_path):
    recorded = foreign.recording(seconds=0.08)
    with opened(foreign.bag(tmp_path / "bag", recorded, joints=tuple("abcdef"))) as source:
        fields = ("position", "velocity", "effort")
        each = [f"/joint_states/{joint}/{field}" for field in fields for joint in "abcdef"]
        assert source.channels() == [
            Listed("/joint_states/stamp", unit="s"),
            *(Listed(name, unit="rad" if name.endswith("position") else None) for name in each),
            *(Listed(field, 6, labels=tuple("abcdef")) for field in fields),
        ]
        started = 1_772_000_000
        for name in ("stamp", "/joint_states/stamp"):
            np.testing.assert_allclose(channel(source, name) - started, recorded.time_s, atol=1e-6)
        np.testing.assert_array_equal(
            channel(source, "/joint_states/b/effort"), recorded.current[:, 1]
        )
        np.testing.assert_array_equal(channel(source, "effort", 5), recorded.current[:, 5])
        assert source.value("/joint_states/c/velocity") == recorded.speed[0, 2]
        expected = datetime.fromtimestamp(started, UTC).replace(tzinfo=None)
        assert source.value("@started_at") == np.datetime64(expected, "us")
        with pytest.raises(InputError, match=r"'effort' has joints 0\.\.5 \(a, b, .*index is 6"):
            channel(source, "effort", 6)
        for name in ("effort", "/joint_states/z/effort", "/joint_states/a/force"):
            with pytest.raises(InputError, match=f"no channel '{name}'; the file has /joint_st"):
                channel(source, name)


def test_what_cannot_be_opened(tmp_path):
    for name, why in (
        ("folder", "is a folder where a recording is needed"),
        ("none.csv", "no such file"),
        ("empty.csv", r"is empty \(0 bytes\)"),
        ("a.xyz", "its ending does not tell the format"),
    ):
        path = tmp_path / name
        if name == "folder":
            path.mkdir()
        elif name != "none.csv":
            path.write_text("" if name == "empty.csv" else "x")
        with pytest.raises(InputError, match=why), opened(path):
            pass
