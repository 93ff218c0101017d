import sys

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, RootObject, TdmsWriter

from opamc_cli.errors import InputError
from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.ingest.source import BLOCK_ROWS
from opamc_cli.storage.runs.run import Run

RNG = np.random.default_rng(11)
N = BLOCK_ROWS + 1000  # more than one block
CURRENT_MA = RNG.normal(scale=2000, size=(N, 3)).astype(np.float32).astype(float)
ANGLE_DEG = np.linspace(-170, 900, N)


def ingested(tmp_path, file, text):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    outcome = ingest.run([file], load_map(path), tmp_path / "out")
    if outcome.errors:
        raise outcome.errors[0]
    return Run(outcome.results[0].run)


def check(run, rate=2048.0):
    assert run.sampling_rate_hz == pytest.approx(rate)
    data = run.read(["axis1_a", "axis1_c", "axis1_position"])
    np.testing.assert_array_equal(data["axis1_a"], (CURRENT_MA[:, 0] * 1e-3).astype(np.float32))
    np.testing.assert_array_equal(data["axis1_c"], (CURRENT_MA[:, 2] * 1e-3).astype(np.float32))
    assert data["axis1_position"].dtype == np.float64
    np.testing.assert_allclose(data["axis1_position"], np.deg2rad(ANGLE_DEG), atol=1e-12)


def map_text(a, c, position, rate, index=True):
    at = [", index: 0", ", index: 2"] if index else ["", ""]
    return (
        f"sampling_rate_hz: {rate}\ncolumns:\n"
        f"  axis1_a: {{source: {a}, unit: mA{at[0]}}}\n"
        f"  axis1_c: {{source: {c}, unit: mA{at[1]}}}\n"
        f"  axis1_position: {{source: {position}, unit: deg, unwrap: true}}\n"
    )


WRAPPED_DEG = (ANGLE_DEG + 180) % 360 - 180


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("transposed", [False, True])
def test_mat5(tmp_path, compressed, transposed):
    file = tmp_path / "r.mat"
    phases = CURRENT_MA.T if transposed else CURRENT_MA
    content = {"log": {"motor": {"i": phases}, "q": WRAPPED_DEG}, "fs": 2048.0, "unused": "text"}
    scipy.io.savemat(file, content, do_compression=compressed)
    rate = "{source: fs, unit: Hz}"
    check(ingested(tmp_path, file, map_text("log.motor.i", "log.motor.i", "log.q", rate)))


def write_mat73(file):
    """Write what MATLAB 7.3 writes: a text block, groups for structs, arrays transposed."""
    with h5py.File(file, "w", userblock_size=512) as h5:
        log = h5.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        log.create_dataset("i", data=CURRENT_MA.T)
        log.create_dataset("q", data=WRAPPED_DEG[None, :])
        h5.create_dataset("dt", data=[[1 / 2048]])
        name = h5.create_dataset(
            "robot", data=np.frombuffer(b"arm 7", np.uint8)[:, None].astype("u2")
        )
        name.attrs["MATLAB_class"] = np.bytes_("char")
    with file.open("r+b") as handle:
        handle.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def test_mat73(tmp_path):
    file = tmp_path / "r.mat"
    write_mat73(file)
    text = map_text("log.i", "log.i", "log.q", "{source: dt, unit: s}")
    run = ingested(tmp_path, file, text + "metadata: {robot: {source: robot}}")
    check(run)
    assert run.info.robot == "arm 7"


def test_hdf5_datasets_attributes_and_records(tmp_path):
    file = tmp_path / "r.h5"
    with h5py.File(file, "w") as h5:
        records = np.zeros(N, dtype=[("t", "f8"), ("i_a", "f4"), ("i_c", "f4")])
        records["i_a"], records["i_c"] = CURRENT_MA[:, 0], CURRENT_MA[:, 2]
        records["t"] = np.arange(N) / 2.048
        h5.create_dataset("drive/log", data=records, chunks=(4096,), compression="gzip")
        h5.create_dataset("joint/q", data=WRAPPED_DEG)
        h5["drive"].attrs["load"] = 1.5
    text = map_text("drive/log.i_a", "drive/log.i_c", "joint/q", 2048, index=False)
    text += "time: {source: drive/log.t, unit: ms}\nmetadata: {payload_kg: {source: drive@load}}"
    run = ingested(tmp_path, file, text)
    check(run)
    assert run.info.payload_kg == 1.5


def test_tdms_channels_and_properties(tmp_path):
    file = tmp_path / "r.tdms"
    properties = {"wf_increment": 1 / 2048, "operator": "somebody"}
    with TdmsWriter(file) as writer:
        for start in range(0, N, 20_000):  # a logger writes in pieces
            part = slice(start, start + 20_000)
            writer.write_segment(
                [
                    RootObject({"robot": "R7"}),
                    ChannelObject("Motor", "I a", CURRENT_MA[part, 0], properties),
                    ChannelObject("Motor", "I/c", CURRENT_MA[part, 2]),
                    ChannelObject("Joint", "q", WRAPPED_DEG[part]),
                ]
            )
    rate = "{source: Motor/I a@wf_increment, unit: s}"
    text = map_text("Motor/I a", "Motor/I/c", "Joint/q", rate, index=False)
    run = ingested(tmp_path, file, text + 'metadata: {robot: {source: "@robot"}}')
    check(run)
    assert run.info.robot == "R7"


def one_channel(source, extra=""):
    return f"sampling_rate_hz: 10\ncolumns: {{axis1_a: {{source: {source}, unit: A{extra}}}}}\n"


def write(kind, tmp_path):
    """Write one file of a kind with channels x (10 samples), y (9) and text."""
    file = tmp_path / f"r.{kind}"
    x, y = np.arange(10.0), np.arange(9.0)
    if kind == "mat":
        content = {"g": {"x": x, "y": y, "text": "abc", "block": np.ones((10, 2))}}
        scipy.io.savemat(file, content)
        return file, "g."
    if kind == "h5":
        with h5py.File(file, "w") as h5:
            h5["g/x"], h5["g/y"], h5["g/text"], h5["g/block"] = x, y, "abc", np.ones((10, 2))
        return file, "g/"
    with TdmsWriter(file) as writer:
        text = ChannelObject("g", "text", np.array(["abc"] * 10))
        writer.write_segment([ChannelObject("g", "x", x), ChannelObject("g", "y", y), text])
    return file, "g/"


KINDS = ["mat", "h5", "tdms"]


@pytest.mark.parametrize("kind", KINDS)
def test_absent_channels_are_refused_with_those_that_are_there(tmp_path, kind):
    file, prefix = write(kind, tmp_path)
    with pytest.raises(InputError, match=f"no channel '{prefix}z'; the file has .*x"):
        ingested(tmp_path, file, one_channel(prefix + "z"))


@pytest.mark.parametrize("kind", KINDS)
def test_text_is_refused_where_numbers_are_needed(tmp_path, kind):
    file, prefix = write(kind, tmp_path)
    with pytest.raises(InputError, match="numbers are needed"):
        ingested(tmp_path, file, one_channel(prefix + "text"))


@pytest.mark.parametrize("kind", KINDS)
def test_channels_of_different_length_are_refused(tmp_path, kind):
    file, p = write(kind, tmp_path)
    text = one_channel(p + "x")[:-2] + f", axis1_b: {{source: {p}y, unit: A}}}}\n"
    with pytest.raises(InputError, match=f"'{p}y' has 9 samples, '{p}x' has 10"):
        ingested(tmp_path, file, text)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("keep", [0.3, 0.7, 0.95])
def test_truncated_files_are_refused_or_lose_whole_channels(tmp_path, kind, keep):
    file, prefix = write(kind, tmp_path)
    content = file.read_bytes()
    file.write_bytes(content[: int(len(content) * keep)])
    path = tmp_path / "map.yaml"
    path.write_text(one_channel(prefix + "x"))
    outcome = ingest.run([file], load_map(path), tmp_path / "out")
    for item in outcome.results:  # what is cut off lies behind the channel
        np.testing.assert_array_equal(Run(item.run).read(["axis1_a"])["axis1_a"], np.arange(10))
    for error in outcome.errors:
        assert str(error).startswith(str(file))
        assert "\n" not in str(error)
        assert not list((tmp_path / "out").glob("*.par*"))


@pytest.mark.parametrize("kind", ["mat", "h5", "tdms"])
def test_damaged_files_end_in_a_sentence_or_a_run(tmp_path, kind):
    if kind == "mat":
        # scipy's C code may read beyond its buffer where an uncompressed file lies about sizes
        file, prefix = tmp_path / "r.mat", "g."
        scipy.io.savemat(file, {"g": {"x": np.arange(10.0)}}, do_compression=True)
    else:
        file, prefix = write(kind, tmp_path)
    path = tmp_path / "map.yaml"
    path.write_text(one_channel(prefix + "x"))
    channels, content = load_map(path), file.read_bytes()
    rng = np.random.default_rng(1)
    n_refused = 0
    for _ in range(80):
        damaged = bytearray(content)
        for at in rng.integers(len(content), size=rng.integers(1, 9)):
            damaged[at] = rng.integers(256)
        file.write_bytes(damaged)
        outcome = ingest.run([file], channels, tmp_path / "out")
        for error in outcome.errors:
            n_refused += 1
            assert str(error).startswith(str(file))
            assert "\n" not in str(error)
    assert n_refused > 5


@pytest.mark.parametrize("kind", KINDS)
def test_files_of_another_format_are_refused(tmp_path, kind):
    file = tmp_path / f"r.{kind}"
    file.write_text("a,b\n1,2\n" * 100)
    with pytest.raises(InputError, match=f"r.{kind}: "):
        ingested(tmp_path, file, one_channel("x"))


@pytest.mark.parametrize("kind", ["mat", "h5"])
def test_two_dimensions_need_an_index(tmp_path, kind):
    file, prefix = write(kind, tmp_path)
    with pytest.raises(InputError, match=r"holds 2 channels \(10x2\), index is None; set index"):
        ingested(tmp_path, file, one_channel(prefix + "block"))
    with pytest.raises(InputError, match=r"index is 2; set index to 0\.\.1"):
        ingested(tmp_path, file, one_channel(prefix + "block", ", index: 2"))


@pytest.mark.parametrize(("kind", "library"), [("h5", "h5py"), ("tdms", "nptdms")])
def test_a_missing_library_is_named_with_the_way_to_get_it(tmp_path, monkeypatch, kind, library):
    file, prefix = write(kind, tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError, match=r"install it with pip install 'opamc\[ingest\]'"):
        ingested(tmp_path, file, one_channel(prefix + "x"))


def test_an_unknown_ending_is_refused(tmp_path):
    file = tmp_path / "r.xyz"
    file.write_text("1\n")
    with pytest.raises(InputError, match="set format in the map"):
        ingested(tmp_path, file, one_channel("0"))
