"""The short forms of `make kill` and `make faults`."""

import errno
import shutil
import signal

import pytest
from faults import build, fault
from kills import kill
from trials import Trial, trials

NAMES = ("diagnose", "simulate", "patterns", "score")


@pytest.fixture(scope="module")
def every(tmp_path_factory) -> dict[str, Trial]:
    return {trial.name: trial for trial in trials(tmp_path_factory.mktemp("trials"), NAMES)}


@pytest.mark.parametrize(
    ("name", "after_s", "number"),
    [
        ("diagnose", 4.0, signal.SIGKILL),
        ("diagnose", 6.0, signal.SIGTERM),
        ("simulate", 3.0, signal.SIGKILL),
        ("patterns", 1.5, signal.SIGINT),
    ],
)
def test_killed_commands(every, name, after_s, number):
    assert kill(every[name], after_s, number) is None


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("name", ["score", "simulate"])
def test_failing_system_calls(every, tmp_path, name):
    library = build(tmp_path)
    count = tmp_path / "count"
    assert fault(every[name], library, 0, 0, count) is None
    calls = int(count.read_text())
    assert calls > 10
    for at in (1, calls // 3, 2 * calls // 3, calls):
        assert fault(every[name], library, at, errno.ENOSPC, tmp_path / "ignored") is None
