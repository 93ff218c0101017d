"""What ends a command from outside, and streams that cannot be written."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.marks import long

ROOT = Path(__file__).parents[2]
COMMAND = (sys.executable, "-m", "opamc_cli")
LONG = (
    *("simulate", "--config", ROOT / "configs" / "testbed.yaml", "--cycles", "40"),
    *("--sessions", "4"),
)


def heard() -> None:
    """Hear signals also where the tests were started to survive their terminal."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def start(*arguments: object, **options: object) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [*COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
        preexec_fn=heard,
        **options,  # type: ignore[call-overload]
    )


def of_session(leader: int) -> list[int]:
    """Return the living processes that a command started, itself among them."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, _, _, session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
            except OSError:
                continue
            if int(session) == leader and state != "Z":
                found.append(int(entry.name))
    return found


def wait_for(condition, seconds: float) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.05)
    return bool(condition())


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are counted in /proc")
@pytest.mark.parametrize("number", [signal.SIGKILL, long(signal.SIGTERM), long(signal.SIGINT)])
def test_nothing_outlives_a_command(tmp_path, number):
    """Two workers at work, and the command is killed or interrupted."""
    process = start(*LONG, "--jobs", 2, "--out", tmp_path / "out")
    # the command, the tracker of resources and two workers
    assert wait_for(lambda: len(of_session(process.pid)) >= 4, 60)
    time.sleep(1)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert wait_for(lambda: not of_session(process.pid), 20), of_session(process.pid)
    assert "Traceback" not in err
    if number != signal.SIGKILL:
        assert process.returncode == 128 + number
        (sentence,) = err.splitlines()
        assert sentence.startswith(f"opamc: ended by {number.name}")
        assert not [path for path in (tmp_path / "out").rglob("*") if path.name != ".opamc.lock"]


class Last:
    """Its end is a place from which no exception gets out."""

    def __del__(self):
        signal.raise_signal(signal.SIGINT)


def answered_by_a_library(_):
    try:
        signal.raise_signal(signal.SIGTERM)
    except SystemExit:
        msg = "half imported"
        raise ValueError(msg) from None


def come_in_a_destructor(_):
    last = Last()
    del last
    time.sleep(10)


@pytest.mark.parametrize(
    ("work", "code"), [(answered_by_a_library, 143), (come_in_a_destructor, 130)]
)
def test_a_signal_is_the_end_whatever_a_library_makes_of_it(opamc, monkeypatch, work, code):
    monkeypatch.setattr("opamc_cli.__main__._run", work)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    begun = time.monotonic()
    ended = opamc("--help")
    assert ended.code == code
    assert time.monotonic() - begun < 5
    (sentence,) = ended.err.splitlines()
    assert sentence.startswith("opamc: ended by SIG")


def test_what_a_killed_run_left_goes_with_the_next(opamc, tmp_path, tonight):
    out = tmp_path / "out"
    (out / ".result.part" / "baseline").mkdir(parents=True)
    (out / ".segments.parquet.abcd1234.part").write_text("half")
    (out / "baseline").mkdir()
    (out / "baseline" / ".motions.parquet.x7_aaaaa.part").write_text("half")
    (out / ".mine.part").write_text("mine")
    assert opamc("segment", tonight, "--out", out).code == 0
    left = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert left == {".mine.part", ".opamc.lock", "segments.parquet"}


def run(*arguments: object, shell: str) -> tuple[int, str]:
    words = " ".join(f"'{word}'" for word in (*COMMAND, *map(str, arguments)))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ended = subprocess.run(
        ["sh", "-c", f"{words} {shell}"],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    return ended.returncode, ended.stderr


NO_FULL = pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
FULL = pytest.param(">/dev/full", marks=NO_FULL)


@pytest.mark.long
@pytest.mark.parametrize("shell", [FULL, ">&- 2>&- <&-"])
def test_the_exit_code_is_the_verdicts_whatever_becomes_of_the_output(diagnosed, tmp_path, shell):
    out = shutil.copytree(diagnosed, tmp_path / "out", symlinks=True)
    before = (out / "verdict.json").stat().st_mtime_ns
    code, err = run("decide", "--out", out, shell=shell)
    assert code == 0
    assert (out / "verdict.json").stat().st_mtime_ns > before
    assert "a bug" not in err
    assert "Exception ignored" not in err
    code, err = run("segment", tmp_path / "nothing", "--json", shell=shell)
    assert code == 3
    assert "a bug" not in err


@pytest.mark.parametrize("shell", [FULL, ">&-"])
def test_help_that_cannot_be_printed(shell):
    code, err = run("--help", shell=shell)
    assert code in (0, 2)
    assert "a bug" not in err


# -- what is no regular file -----------------------------------------------------------------


@pytest.fixture(params=["pipe", "device"])
def endless(request, tmp_path):
    """Return what a reader would wait for, or read, for ever."""
    if request.param == "device":
        return Path("/dev/zero")
    path = tmp_path / "pipe.parquet"
    os.mkfifo(path)
    return path


@pytest.mark.parametrize(
    "arguments",
    [
        ["segment", "{}"],
        ["identify", "{}"],
        ["patterns", "{}"],
        ["score", "--baseline", "{}", "--target", "{}"],
        ["score", "--baseline", "{}", "--target", "{}", "--lda", "{}"],
        ["diagnose", "--baseline", "{}", "--target", "{}"],
        ["config", "check", "--config", "{}"],
        ["simulate", "--config", "{}"],
        ["model", "fit", "{}", "--model", "{}"],
        ["ingest", "{}", "--map", "{}"],
        ["ingest", "{}", "--map", "configs/maps/itsc.yaml"],
    ],
    ids=lambda arguments: " ".join(arguments[:2]),
)
@pytest.mark.usefixtures("in_time")
def test_only_regular_files_are_read(opamc, tmp_path, monkeypatch, endless, arguments):
    monkeypatch.chdir(ROOT)
    given = [a.replace("{}", str(endless)) for a in arguments]
    if given[0] != "config":
        given += ["--out", str(tmp_path / "out")]
    ended = opamc(*given)
    assert ended.code in (2, 3), ended
    (sentence,) = ended.sentences
    assert str(endless) in sentence


@pytest.mark.usefixtures("in_time")
def test_a_pipe_among_the_runs_of_a_folder(opamc, tmp_path, tonight):
    folder = tmp_path / "runs"
    folder.mkdir()
    os.mkfifo(folder / "pipe.parquet")
    (folder / "tonight.parquet").write_bytes(tonight.read_bytes())
    ended = opamc("segment", folder, "--out", tmp_path / "out")
    assert ended.code == 4
    assert "pipe.parquet: cannot be read, it is a named pipe" in ended.err


@pytest.mark.usefixtures("in_time")
@pytest.mark.parametrize("name", ["verdict.json", "scores.parquet", "findings.json"])
def test_a_pipe_in_an_output_folder(opamc, tmp_path, name):
    os.mkfifo(tmp_path / name)
    assert opamc("report", "--out", tmp_path).code == 3
