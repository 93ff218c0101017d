"""Files that are either whole or not there."""

import os
import signal
import subprocess
import sys

import pytest

from opamc_cli.errors import InputError, UsageError
from opamc_cli.storage.files.atomic import atomic_path, ensure_directory, write_text
from opamc_cli.storage.runs.finding import find_runs
from tests.marks import long


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "r.txt"
    write_text(path, "old")
    with pytest.raises(TypeError):
        write_text(path, 5)  # type: ignore[arg-type]
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["r.txt"]


def test_an_unfinished_file_is_hidden_and_a_part(tmp_path):
    with atomic_path(tmp_path / "r.txt") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.name.startswith(".r.txt.")
        assert temporary.suffix == ".part"


KILLED = """
import signal, sys, time
import numpy as np
import pyarrow as pa
from opamc_cli.storage.runs.metadata import RunInfo
from opamc_cli.storage.runs.writing import write_run
# a shell starts background jobs, and so what they start, with SIGINT ignored
signal.signal(signal.SIGINT, signal.default_int_handler)
schema = pa.schema([("axis1_a", pa.float32())])
with write_run({path!r}, RunInfo(1.0), schema) as writer:
    while True:
        writer.write_table(pa.table({{"axis1_a": np.zeros(100_000, np.float32)}}))
        print("written", flush=True)
        time.sleep(0.01)
"""


@pytest.mark.parametrize("sent", [signal.SIGKILL, long(signal.SIGTERM), long(signal.SIGINT)])
def test_a_killed_writer_leaves_no_run(tmp_path, sent):
    path = tmp_path / "r.parquet"
    code = KILLED.format(path=str(path))
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as writer:
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"written\n"
        writer.send_signal(sent)
        writer.wait(timeout=30)
    assert not path.exists()
    with pytest.raises(InputError, match="holds no run"):
        find_runs([tmp_path])


def test_an_output_folder_that_is_a_file_is_refused(tmp_path):
    file = tmp_path / "file"
    file.touch()
    for path in (file, file / "below"):
        with pytest.raises(UsageError, match="cannot make this output folder"):
            ensure_directory(path)
    with pytest.raises(UsageError, match="choose another with --out"):
        write_text(file / "r.txt", "x")


def test_files_are_for_everybody_the_umask_lets_read(tmp_path):
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "r.txt", "x")
    finally:
        os.umask(before)
    assert (tmp_path / "r.txt").stat().st_mode & 0o777 == 0o640
