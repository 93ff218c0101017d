"""How the tests of this folder call the command, and the recordings that they share."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from fuzz import ALONE
from fuzz import call as called
from recordings import record

from opamc_cli.__main__ import main


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str

    @property
    def sentences(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("opamc: ")]


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
def baseline(tmp_path_factory) -> Path:
    """Three sessions of a healthy robot."""
    folder = tmp_path_factory.mktemp("baseline")
    for seed in range(3):
        record(folder / f"night-{seed}.parquet", seed)
    return folder


@pytest.fixture(scope="session")
def tonight(tmp_path_factory) -> Path:
    """Another healthy session."""
    return record(tmp_path_factory.mktemp("target") / "tonight.parquet", 9)


@pytest.fixture(scope="session")
def diagnosed(tmp_path_factory, baseline, tonight) -> Path:
    """The folder of a diagnosis that a command has made; who changes it takes a copy."""
    out = tmp_path_factory.mktemp("diagnosed") / "out"
    code, _, err = called(
        "diagnose", "--baseline", baseline, "--target", tonight, "--out", out, *ALONE
    )
    assert code == 0, err
    return out
