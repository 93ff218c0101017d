"""Recordings, maps and paths as an outsider would get them wrong: said, and nothing lost by it."""

import os
import shutil
import socket
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from recordings import columns, record

from opamc_cli.__main__ import _have_caches
from opamc_cli.errors import ExitCode, InputError
from opamc_cli.stages.recordings.axis_recording import read_recording
from opamc_cli.storage.runs.run import Run
from tests.marks import long

QUICK = ("--set", "joint.explain=false", "--quiet")
MAP = "sampling_rate_hz: 1000\ncolumns: {axis1_a: {source: a, unit: A}}\n"


def diagnose(opamc, baseline, target, out):
    return opamc("diagnose", "--baseline", baseline, "--target", target, "--out", out, *QUICK)


# -- numbers that no sensor delivers ---------------------------------------------------------


def largest_integers(x):
    return np.full(len(x), 2**64 - 1, np.uint64)


def overflowing(x):
    return np.where(x > 0, 3e38, -3e38).astype(np.float32)


def half_floats(x):
    return np.where(x > 0, np.inf, x).astype(np.float16)


@pytest.mark.parametrize(
    "odd", [largest_integers, long(overflowing), long(half_floats)], ids=lambda odd: odd.__name__
)
def test_samples_that_no_sensor_delivers(opamc, baseline, tmp_path, odd):
    def every_phase(columns):
        columns.update({f"axis2_{p}": odd(columns[f"axis2_{p}"]) for p in "abc"})

    target = record(tmp_path / "tonight.parquet", 9, every_phase)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ended = diagnose(opamc, baseline, target, tmp_path / "out")
    assert ended.code == ExitCode.NOT_ENOUGH_DATA
    assert "xis 2 not judged" in ended.out


@pytest.mark.parametrize(
    "text",
    [
        "0001-01-01T00:00:00+14:00",
        long("9999-12-31T23:59:59-12:00"),
    ],
)
def test_a_clock_that_was_never_set(opamc, baseline, tmp_path, text):
    target = record(tmp_path / "tonight.parquet", 9, started_at=text)
    assert diagnose(opamc, baseline, target, tmp_path / "out").code == ExitCode.DONE


@pytest.mark.parametrize("zone", ["UTC", "Pacific/Kiritimati"])
def test_a_time_without_zone_is_utc_wherever_it_is_read(tmp_path, monkeypatch, zone):
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        with Run(record(tmp_path / "r.parquet", 0, started_at="2026-03-01T02:00:00")) as run:
            assert read_recording(run, 1).started_s == 1772330400.0
    finally:
        monkeypatch.undo()
        time.tzset()


# -- names -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["Axis2_A", "axis02_a", "axis2_a ", "axis2-a"])
def test_an_axis_that_is_misspelt_on_both_sides_is_not_passed_over(tmp_path, name):
    def rename(columns):
        columns[name] = columns.pop("axis2_a")

    with pytest.raises(InputError, match="is it axis2_a"):
        Run(record(tmp_path / "r.parquet", 0, rename))


def test_columns_of_others_are_left_alone(tmp_path):
    def add(columns):
        columns.update(dict.fromkeys(("Axis2_A", "axis_a", "axis2_a_raw"), columns["axis1_a"]))

    with Run(record(tmp_path / "r.parquet", 0, add)) as run:
        assert run.axes == (1, 2)


def test_a_variable_of_the_shell_that_is_not_set(opamc, tmp_path, tonight, monkeypatch):
    """An empty path would be the folder in which the command was started."""
    monkeypatch.chdir(tonight.parent)
    ended = opamc("segment", "", "--out", tmp_path)
    assert ended.code == ExitCode.USAGE
    assert "an argument is empty" in ended.sentences[0]


@pytest.mark.parametrize("text", ["rubbish", long("-1"), long("9" * 20)])
def test_a_fixed_time_that_is_none(opamc, tmp_path, monkeypatch, text):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", text)
    ended = opamc("decide", "--out", tmp_path)
    assert ended.code == ExitCode.USAGE
    assert "SOURCE_DATE_EPOCH" in ended.sentences[0]


@pytest.mark.long
def test_an_environment_that_libraries_stumble_over(diagnosed, tmp_path):
    out = shutil.copytree(diagnosed, tmp_path / "out", symlinks=True)
    odd = {"SOURCE_DATE_EPOCH": "", "MPLBACKEND": "rubbish", "COLUMNS": "-1", "TZ": ":rubbish"}
    ended = subprocess.run(
        [sys.executable, "-m", "opamc_cli", "report", "--out", str(out)],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **odd},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr


def test_a_service_without_a_home_has_a_place_for_its_compiled_loops(monkeypatch):
    """Numba refuses to load where it can write neither beside the loops nor at home."""
    places = ("NUMBA_CACHE_DIR", "MPLCONFIGDIR")
    for name in (*places, "XDG_CACHE_HOME"):
        monkeypatch.setenv(name, "")  # restored at the end
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", "/nonexistent")
    installed = Path(_have_caches.__code__.co_filename).parent
    denied = {"/", str(installed)}
    monkeypatch.setattr(os, "access", lambda path, _: str(path) not in denied)
    _have_caches()
    made = {Path(os.environ[name]) for name in places}
    assert len(made) == 1
    assert next(iter(made)).is_dir()
    # what the user has set, or can write, is kept
    before = dict(os.environ)
    denied.clear()
    _have_caches()
    assert dict(os.environ) == before
    shutil.rmtree(next(iter(made)))


def test_names_that_are_no_text_are_one_line_each(opamc, tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for name in ("a.csv", os.fsdecode(b"b\xff\n.csv"), "c\nd\x1b[31m.csv"):
        (folder / name).write_text("t,cur_1\n0,1\n")
    ended = opamc("ingest", folder, "--map", "ur_rtde", "--out", tmp_path / "out")
    assert ended.code == ExitCode.BAD_INPUT
    lines = ended.err.splitlines()
    assert len(lines) == 3
    assert all(line.startswith("opamc: ") and line.isprintable() for line in lines)
    assert sum("its name is not UTF-8; rename it" in line for line in lines) == 1
    assert opamc("ingest", folder / "a.csv", "--guess").err == ""


# -- what is not ours is not replaced --------------------------------------------------------


def test_a_recording_with_a_tables_name_stays(opamc, tonight, tmp_path):
    """Results go into the folder of the recordings, one of which is called segments."""
    own = tmp_path / "segments.parquet"
    own.write_bytes(tonight.read_bytes())
    ended = opamc("segment", own, "--out", tmp_path)
    assert ended.code == ExitCode.USAGE
    assert "would be replaced" in ended.sentences[0]
    assert own.read_bytes() == tonight.read_bytes()


@pytest.mark.parametrize("whose", ["itself", "a run"])
def test_ingest_replaces_nothing_but_its_own_runs(opamc, tonight, tmp_path, whose):
    (tmp_path / "map.yaml").write_text(MAP)
    out = tmp_path / "out"
    out.mkdir()
    source = (out if whose == "itself" else tmp_path) / "log.parquet"
    pq.write_table(pa.table({"a": columns(0)["axis1_a"]}), source)
    if whose == "a run":
        (out / "log.parquet").write_bytes(tonight.read_bytes())
    before = (out / "log.parquet").read_bytes()
    ended = opamc("ingest", source, "--map", tmp_path / "map.yaml", "--out", out)
    assert ended.code == ExitCode.BAD_INPUT
    assert "was not made by ingest" in ended.sentences[0]
    assert (out / "log.parquet").read_bytes() == before


RATE, ONE = "sampling_rate_hz: 1000\n", "columns: {axis1_a: {source: a, unit: A}}"
ODD_MAPS = {
    RATE + ONE[:-1] + ", axis1_b: {source: a, unit: A}}": "axis1_a and columns.axis1_b are both of",
    RATE + "columns: {axis1_a: {source: a, unit: A, scale: 0}}": "scale is 0",
    RATE + "columns: {axis1_a: {source: t, unit: A, scale: 1.e+9}}": "has no value in",
    "time: {source: t, unit: s}\n" + ONE: "says 1e-09 Hz, a log has 0.001 to 1e+06",
    MAP + "metadata: {payload_kg: 1.e+9}": "payload_kg is 1000000000",
    MAP + f"metadata: {{robot: {'x' * 1001}}}": "at most 1000",
}


@pytest.mark.parametrize("text", ODD_MAPS, ids=range(len(ODD_MAPS)))
def test_no_run_is_made_that_could_not_be_used(opamc, tmp_path, text):
    """Clock in nanoseconds, one channel for two phases, conditions of no robot."""
    rows = "".join(f"{n % 7},{1e9 * (n + 1)}\n" for n in range(300))
    (tmp_path / "log.csv").write_text("a,t\n" + rows)
    (tmp_path / "map.yaml").write_text(text)
    ended = opamc(
        "ingest", tmp_path / "log.csv", "--map", tmp_path / "map.yaml", "--out", tmp_path / "out"
    )
    assert ended.code in (ExitCode.USAGE, ExitCode.BAD_INPUT)
    (sentence,) = ended.sentences
    assert ODD_MAPS[text] in sentence
    assert not list((tmp_path / "out").glob("*.parquet"))


# -- bounded ---------------------------------------------------------------------------------


BOMB = "\n".join(
    ["l0: &l0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    + [f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 10)}]" for n in range(1, 10)]
)


@pytest.mark.usefixtures("in_time")
@pytest.mark.parametrize(
    "odd", ["skip_rows: 1000000000", "units_rows: 1000000000", "axes: 1000000000", BOMB]
)
def test_a_map_that_asks_for_ever(opamc, tmp_path, odd):
    (tmp_path / "log.csv").write_text("a\n" + "1\n2\n" * 100)
    (tmp_path / "map.yaml").write_text(MAP + odd)
    ended = opamc(
        "ingest", tmp_path / "log.csv", "--map", tmp_path / "map.yaml", "--out", tmp_path / "out"
    )
    assert ended.code in (ExitCode.USAGE, ExitCode.BAD_INPUT)
    (sentence,) = ended.sentences
    assert len(sentence) < 600


@pytest.mark.usefixtures("in_time")
def test_a_value_that_multiplies_itself(opamc, tmp_path):
    (tmp_path / "c.yaml").write_text(f"{BOMB}\nreport: {{title: *l9}}\n")
    ended = opamc("config", "check", "--config", tmp_path / "c.yaml")
    assert ended.code == ExitCode.USAGE
    (sentence,) = ended.sentences
    assert len(sentence) < 600


@pytest.mark.usefixtures("in_time")
def test_a_socket_for_a_run(opamc, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a socket's path is short
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("s.parquet")
        ended = opamc("segment", "s.parquet", "--out", tmp_path / "out")
    assert ended.code == ExitCode.BAD_INPUT
    assert "it is a socket" in ended.sentences[0]
