"""A small cell of virtual robots, recorded once."""

import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))

import cell_logs

from opamc_cli.__main__ import main


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str


@pytest.fixture
def opamc(capsys) -> Callable[..., Ended]:
    def call(*arguments: object) -> Ended:
        capsys.readouterr()
        code = 0
        try:
            main([str(a) for a in arguments])
        except SystemExit as ended:
            code = int(ended.code or 0)
        captured = capsys.readouterr()
        return Ended(code, captured.out, captured.err)

    return call


@pytest.fixture(scope="session")
def recorded(tmp_path_factory) -> Path:
    """Three robots, five nights; axis 2 of r2 is damaged from the fourth on."""
    folder = tmp_path_factory.mktemp("recorded")
    cell_logs.record_cell(folder, 3, 5, {1: [0.0, 0.0, 0.0, 1.0, 1.0]})
    return folder


@pytest.fixture
def cell(recorded, tmp_path) -> Path:
    """A cell of its own for a test, with links to the recordings; two nights are the baseline."""
    shutil.copytree(recorded / "logs", tmp_path / "logs")
    path = tmp_path / "cell.yaml"
    path.write_text(
        "runs: logs/{robot}/{night}/*.parquet\nbaseline: {nights: 3}\nset: {joint.explain: false}\n"
    )
    return path
