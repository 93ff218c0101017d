"""The short forms of `make kill` and `make faults`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


def script(name: str, *arguments: object) -> str:
    """Run a script of this folder; it fails if one of its trials does."""
    ended = subprocess.run(
        [sys.executable, str(HERE / name), *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr[-2000:]
    return ended.stdout


@pytest.mark.long
def test_killed_commands():
    said = script("kills.py", "--count", 4, "--seed", 1, "--only", "diagnose")
    assert "4 kills and interruptions, 0 wrong" in said


@pytest.mark.long
@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_failing_system_calls():
    said = script("faults.py", "--every", 20, "--first", 7, "--only", "score")
    assert int(said.splitlines()[-1].split()[0]) > 5
