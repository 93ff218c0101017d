"""Whether `opamc nightly` ends the same after kills, full disks and many starts at once.

A cell of 6 robots and 4 nights is brought to its end undisturbed, then again and again with a
disturbance on the way, and the next start must end with the same bytes: the history (in order),
every report and verdict, index.html and metrics.prom; what holds a clock is left out. Most trials
have a stand-in in the place of the diagnosis, which takes 20 ms: it is the bookkeeping that is
tried. `--real` has the true one.

    python benchmarks/nightly/nightly_kills.py --kills 270 --worker-kills 30 --disk 10 --starts 50
    python benchmarks/nightly/nightly_kills.py --real --kills 20 --worker-kills 10
"""

import argparse
import ctypes
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import cell_logs

from opamc_cli.__main__ import main
from opamc_cli.stages.nightly.start import run as stage
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import OF_ROBOT

DERIVED = (*OF_ROBOT, "judged-anew", "lacking", "missing")  # by the nights, not by a user
STAND_IN = "night_stand_in:stand_in"
OURS = (".opamc-work", ".kept", ".copies", ".opamc.lock", ".opamc.cell")
SECONDS = 300.0
VERDICT_HASH = re.compile(rb'(<td>verdict.json</td><td>[^<]*</td><td class="hash">)[0-9a-f]{64}')

SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>
static long left = -1;
static long count = 0;
void fail_after(long n) { left = n; count = 0; }
long written(void) { return count; }
__attribute__((constructor)) static void begin(void) {
  const char *text = getenv("OPAMC_WRITES_LEFT");
  if (text) left = atol(text);
}
static int full(int fd) {
  struct stat state;
  if (fstat(fd, &state) || !S_ISREG(state.st_mode)) return 0;
  count++;
  if (left < 0) return 0;
  if (left > 0) { left--; return 0; }
  errno = ENOSPC;
  return 1;
}
ssize_t write(int fd, const void *data, size_t n) {
  static ssize_t (*next)(int, const void *, size_t);
  if (!next) next = dlsym(RTLD_NEXT, "write");
  return full(fd) ? -1 : next(fd, data, n);
}
ssize_t pwrite(int fd, const void *data, size_t n, off_t at) {
  static ssize_t (*next)(int, const void *, size_t, off_t);
  if (!next) next = dlsym(RTLD_NEXT, "pwrite");
  return full(fd) ? -1 : next(fd, data, n, at);
}
ssize_t pwrite64(int fd, const void *data, size_t n, off64_t at) {
  static ssize_t (*next)(int, const void *, size_t, off64_t);
  if (!next) next = dlsym(RTLD_NEXT, "pwrite64");
  return full(fd) ? -1 : next(fd, data, n, at);
}
"""


def dump(path: Path) -> dict[str, list[tuple]]:
    """Return everything that a history holds but for what holds a clock, in a fixed order.

    A file's modification time and the time at which a user declared something are left out.
    """
    with History(path, read_only=True) as history:
        tables = [
            row["name"]
            for row in history.rows("SELECT name FROM sqlite_master WHERE type = 'table'")
        ]
        found = {}
        for table in sorted(tables):
            rows = history.rows(f"SELECT * FROM {table}")
            for row in rows:
                row.pop("mtime_ns", None)
                if table == "declared" or (table == "event" and row["kind"] not in DERIVED):
                    row.pop("time")
            found[table] = sorted((tuple(row.values()) for row in rows), key=repr)
        return found


def end_state(out: Path) -> dict[str, object]:
    """Return everything that a cell's folder ends with, but for what holds a clock."""
    state: dict[str, object] = {"history": dump(out / "history.sqlite")}
    for path in sorted(out.rglob("*")):
        name = path.relative_to(out).as_posix()
        if not path.is_file() or name.startswith((*OURS, "history.sqlite")):
            continue
        content = path.read_bytes()
        if path.name == "verdict.json" and content.startswith(b"{"):
            values = json.loads(content)
            values.pop("created_at", None)
            content = json.dumps(values, sort_keys=True).encode()
        if path.name == "report.html":  # it names the verdict by hash, which tells the time
            content = VERDICT_HASH.sub(rb"\1", content)
        state[name] = content
    return state


def start(cell: Path, jobs: int = 1, before: Callable[[], None] = lambda: None) -> int:
    """Start `opamc nightly` in a child process that has everything loaded already."""
    child = os.fork()
    if child:
        return child
    code = 70
    try:
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        before()
        vars(sys.modules["__main__"]).pop("__file__", None)  # workers need not load this script
        main(["nightly", str(cell), "--quiet", "--jobs", str(jobs)])
    except SystemExit as ended:
        code = int(ended.code or 0)
    finally:
        os._exit(code)


def ended(child: int) -> int:
    """Wait for a child and return how it ended."""
    deadline = time.monotonic() + SECONDS
    while time.monotonic() < deadline:
        pid, status = os.waitpid(child, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    msg = f"a start hangs after {SECONDS:g} s"
    raise AssertionError(msg)


def children(of: int) -> list[int]:
    """Return the processes that a process has started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == of and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def check_gone(pids: list[int]) -> None:
    """Check that no worker outlives its parent by more than the loading of its libraries."""
    deadline = time.monotonic() + 30
    while any(_alive(pid) for pid in pids):
        assert time.monotonic() < deadline, f"workers {pids} outlive their parent"
        time.sleep(0.01)


def _alive(pid: int) -> bool:
    try:
        return (Path("/proc") / str(pid) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class Trial:
    """A cell, how it ends undisturbed, and how long that takes."""

    def __init__(self, folder: Path) -> None:
        self.cell = folder / "cell.yaml"
        self.out = folder / "nightly"
        self.undisturbed = 0.0
        shutil.rmtree(self.out, ignore_errors=True)
        begun = time.monotonic()
        code = ended(start(self.cell))
        assert code in (0, 1), code
        self.took = time.monotonic() - begun
        self.expected = end_state(self.out)

    def finish(self) -> None:
        """Start until nothing is left to do, and compare the end with the undisturbed one."""
        code = ended(start(self.cell))
        assert code in (0, 1), code
        found = end_state(self.out)
        assert found.keys() == self.expected.keys(), found.keys() ^ self.expected.keys()
        for name, content in found.items():
            assert content == self.expected[name], (name, content, self.expected[name])

    def kill(self, draw: random.Random, most: int = 1) -> None:
        """Kill up to `most` starts, one after the other, then finish."""
        shutil.rmtree(self.out, ignore_errors=True)
        for _ in range(most):
            child = start(self.cell)
            time.sleep(draw.uniform(0, self.took))
            workers = children(child)
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            check_gone(workers)
        self.finish()

    def kill_worker(self, draw: random.Random) -> None:
        """Kill a worker of a start: that start itself must reach the end."""
        shutil.rmtree(self.out, ignore_errors=True)
        child = start(self.cell, jobs=2)
        until = time.monotonic() + draw.uniform(0.3, 1.0) * self.took
        while time.monotonic() < until:
            time.sleep(0.002)
        workers = [pid for pid in children(child) if _is_worker(pid)]
        if workers:
            os.kill(draw.choice(workers), signal.SIGKILL)
        code = ended(child)
        assert code in (0, 1), code
        self.finish()

    def fill_disk(self, writes: int) -> int:
        """Let every write to a file fail from one on; the start says so, the next one finishes."""
        shutil.rmtree(self.out, ignore_errors=True)

        def full() -> None:
            ctypes.CDLL(None).fail_after(ctypes.c_long(writes))
            os.environ["OPAMC_WRITES_LEFT"] = str(writes)

        code = ended(start(self.cell, before=full))
        self.finish()
        return code

    def start_at_once(self, n: int) -> list[int]:
        """Start many at once; those who find the folder held end with 6."""
        shutil.rmtree(self.out, ignore_errors=True)
        codes = [ended(child) for child in [start(self.cell) for _ in range(n)]]
        self.finish()
        return codes


def _is_worker(pid: int) -> bool:
    try:
        # what multiprocessing starts beside the workers, where they are not forked
        return b"resource_tracker" not in (Path("/proc") / str(pid) / "cmdline").read_bytes()
    except OSError:
        return False


@contextmanager
def with_stand_in() -> Iterator[None]:
    """Put the stand-in in the place of the diagnosis."""
    true = stage.COMPUTE
    stage.COMPUTE = STAND_IN
    paths = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(
        [str(Path(__file__).resolve().parent), *([paths] if paths else [])]
    )
    try:
        yield
    finally:
        stage.COMPUTE = true
        os.environ.pop("PYTHONPATH")
        if paths:
            os.environ["PYTHONPATH"] = paths


def build_shim(folder: Path) -> Path:
    """Compile what makes writes fail."""
    source, library = folder / "full.c", folder / "full.so"
    source.write_text(SHIM)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    return library


def _with_shim(arguments: list[str]) -> None:
    """Start this script again with the shim loaded."""
    with tempfile.TemporaryDirectory() as name:
        library = build_shim(Path(name))
        environment = {**os.environ, "LD_PRELOAD": str(library)}
        done = subprocess.run([sys.executable, __file__, *arguments], env=environment, check=False)
    sys.exit(done.returncode)


def trials(options: argparse.Namespace, folder: Path) -> None:
    """Do what was asked for and print what became of it."""
    trial = Trial(folder)
    print(f"undisturbed: {trial.took:.1f} s, {len(trial.expected) - 1} files", flush=True)
    draw = random.Random(options.seed)
    begun = time.monotonic()
    killed = 0
    while killed < options.kills:
        most = min(draw.choice((1, 1, 2, 3)), options.kills - killed)
        trial.kill(draw, most)
        killed += most
    print(f"kills: {killed}, all ended the same ({time.monotonic() - begun:.0f} s)", flush=True)
    for _ in range(options.worker_kills):
        trial.kill_worker(draw)
    print(f"kills of workers: {options.worker_kills}, all ended the same", flush=True)
    if options.disk:
        codes: list[int] = []
        while not codes or codes[-1] not in (0, 1):
            codes.append(trial.fill_disk(options.disk * len(codes)))
        print(f"full disks: {len(codes)}, exit codes {sorted(set(codes))}, all ended the same")
    if options.starts:
        codes = trial.start_at_once(options.starts)
        print(f"starts at once: {options.starts}, refused {codes.count(6)}, {sorted(set(codes))}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--worker-kills", type=int, default=5)
    parser.add_argument("--disk", type=int, default=0, metavar="N", help="fail every Nth write")
    parser.add_argument("--starts", type=int, default=0)
    parser.add_argument("--robots", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--real", action="store_true")
    chosen = parser.parse_args()
    if chosen.disk and "full.so" not in os.environ.get("LD_PRELOAD", ""):
        _with_shim(sys.argv[1:])
    with tempfile.TemporaryDirectory() as where:
        cell_logs.record_cell(Path(where), chosen.robots, 4, {1: [0.0, 0.0, 0.8, 1.0]})
        if chosen.real:
            trials(chosen, Path(where))
        else:
            with with_stand_in():
                trials(chosen, Path(where))
