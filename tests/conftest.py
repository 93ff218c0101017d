"""How all tests call the command, and where they find what they share with studies."""

import fcntl
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parents[1]
# a worker for every core has no core for more threads, which wait for each other at full speed;
# set before numpy is loaded, for the processes that tests start as well
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# studies and tests share made-up recordings and plain rivals
sys.path[:0] = [str(ROOT / "benchmarks" / room) for room in (".", "sources", "nightly")]

from opamc_cli.__main__ import main  # noqa: E402

# how long an example takes says how busy the machine is
settings.register_profile("untimed", settings(), deadline=None)
settings.load_profile("untimed")

Made = Callable[[str, Callable[[Path], object]], Path]


@dataclass(frozen=True)
class Ended:
    """What a command left: exit code and both streams."""

    code: int
    out: str
    err: str

    @property
    def sentences(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("opamc: ")]


@pytest.fixture
def opamc(capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
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
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Fill a folder in the first worker that asks for it; the others wait, and take it from there.

    Nobody changes what is in it: who has to takes a copy.
    """
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent

    def once(name: str, make: Callable[[Path], object]) -> Path:
        folder, done = shared / name, shared / f"{name}.done"
        with (shared / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not done.exists():
                folder.mkdir()
                make(folder)
                done.touch()
        return folder

    return once


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures out of reports, five sixths of a short diagnosis, where nobody looks."""
    for section in ("EVIDENCE", "LOOP"):
        monkeypatch.setattr(f"opamc_cli.stages.report.figures.shown.{section}", ())
