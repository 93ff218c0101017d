"""The short form of benchmarks/nightly/nightly_kills.py: whatever happens, the end is the same."""

import random
import shutil
import subprocess
import sys
from pathlib import Path

import cell_logs
import nightly_kills
import pytest

pytestmark = pytest.mark.long
STUDIES = Path(__file__).parents[3] / "benchmarks" / "nightly"


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    folder = tmp_path_factory.mktemp("killed")
    cell_logs.record_cell(folder, 2, 3, {})
    (folder / "cell.yaml").write_text(
        "runs: logs/{robot}/{night}/*.parquet\nbaseline: {nights: 2}\n"
    )
    with nightly_kills.with_stand_in():
        yield nightly_kills.Trial(folder)


def test_kills(trial):
    draw = random.Random(1)
    for _ in range(3):
        trial.kill(draw)
    trial.kill(draw, most=2)


def test_kills_of_workers(trial):
    trial.kill_worker(random.Random(2))


def test_starts_at_once(trial):
    codes = trial.start_at_once(5)
    assert set(codes) <= {0, 1, 6}
    assert {0, 1} & set(codes)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler for what makes writes fail")
def test_full_disks():
    done = subprocess.run(
        [
            *(sys.executable, STUDIES / "nightly_kills.py"),
            *("--kills", "0", "--worker-kills", "0", "--robots", "2", "--disk", "150"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "all ended the same" in done.stdout
    assert "2" in done.stdout.rpartition("exit codes")[2]
