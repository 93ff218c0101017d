"""The recordings that the tests of this folder share."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from fuzz import ALONE
from fuzz import call as called
from recordings import record


@pytest.fixture
def in_time() -> Iterator[None]:
    """Fail a test that waits for ever, as the shell's user would."""

    def late(*_: object) -> None:
        pytest.fail("not ended after 60 s")  # which no command answers, unlike a TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, 60, 60)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGALRM, before)


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
