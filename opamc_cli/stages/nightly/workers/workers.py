"""Worker processes that may die: one robot's crash, memory or time is its own line and no other's.

`concurrent.futures` gives up the whole pool when one worker dies, and has no time limit for a task;
that is why this is here. Workers live for many nights, since starting one takes longer than
a short night; one that failed is replaced. They are forked where nothing speaks against it: what
the start has loaded they need as well, and to load it anew is a tenth of a single night.
"""

import gc
import importlib
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from multiprocessing import connection, get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar

from opamc_cli.errors import OpamcError
from opamc_cli.stages.processes.documentation import forgo_compiler, forgo_documentation
from opamc_cli.stages.processes.garbage import look_for_garbage_seldom
from opamc_cli.stages.processes.interruption import SIGNALS
from opamc_cli.stages.processes.parallel import die_with, one_thread_each
from opamc_cli.storage.files.parquet import forgo_pandas

Job = TypeVar("Job")

GIGABYTE = 1 << 30
DEATHS = 2
"""Times that a job's worker may be killed from outside before the job is given up."""


@dataclass(frozen=True)
class Broken:
    """Why a job has no result."""

    kind: Literal["time", "memory", "died", "refused", "bug"]
    """time, memory, died, refused (an error with an exit code of its own) or bug."""
    text: str
    """One sentence."""


@dataclass
class _Worker(Generic[Job]):
    process: BaseProcess
    pipe: Connection
    job: Job | None = None
    until: float = float("inf")


class _Pool(Generic[Job]):
    def __init__(self, function: str, seconds: float, memory_gb: float | None) -> None:
        self._function = function
        self._seconds = seconds
        self._memory = None if memory_gb is None else round(memory_gb * GIGABYTE)
        self._workers: list[_Worker[Job]] = []

    def start(self) -> _Worker[Job]:
        forked = can_fork()
        gc.freeze()  # else a copy that looks for garbage copies every page of its parent's
        context = get_context("fork") if forked else get_context("spawn")
        here, there = context.Pipe()
        arguments = (there, self._function, self._memory, os.getpid(), forked)
        process: BaseProcess = context.Process(target=_serve, args=arguments, daemon=True)
        # what ends this process must not unwind its copy
        before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        there.close()
        worker: _Worker[Job] = _Worker(process, here)
        self._workers.append(worker)
        return worker

    def hand(self, worker: _Worker[Job], job: Job) -> None:
        worker.job = job
        worker.until = time.monotonic() + self._seconds
        with suppress(OSError):  # a worker that is dead is found dead in a moment
            worker.pipe.send(job)

    def end(self, worker: _Worker[Job]) -> None:
        worker.process.kill()
        worker.process.join()
        worker.pipe.close()
        self._workers.remove(worker)

    def wait(self) -> list[tuple[_Worker[Job], Any]]:
        """Return the workers that have an answer, or will never have one."""
        busy = [worker for worker in self._workers if worker.job is not None]
        soonest = min(worker.until for worker in busy)
        ready = connection.wait(
            [worker.pipe for worker in busy], max(soonest - time.monotonic(), 0)
        )
        ended: list[tuple[_Worker[Job], Any]] = []
        for worker in busy:
            if worker.pipe in ready:
                ended.append((worker, self._answer(worker)))
            elif time.monotonic() >= worker.until:
                text = f"took longer than {self._seconds:g} s (limits.seconds)"
                ended.append((worker, Broken("time", text)))
        return ended

    def _answer(self, worker: _Worker[Job]) -> Any:
        try:
            answer = worker.pipe.recv()
        except (EOFError, OSError):
            worker.process.join()
            code = worker.process.exitcode or 0
            how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
            return Broken("died", f"its worker was ended {how}")
        return answer

    def close(self) -> None:
        for worker in list(self._workers):
            self.end(worker)


def run_all(
    function: str,
    jobs: Sequence[Job],
    n_workers: int,
    *,
    seconds: float,
    memory_gb: float | None,
) -> Iterator[tuple[Job, Any]]:
    """Yield every job with its result, or why it has none, as they end.

    Parameters
    ----------
    function
        ``module:name`` of a function of one job; workers load it before their memory is limited.
    jobs
        What it is applied to, in this order.
    n_workers
        Processes; 0: one per core. Each computes on one thread.
    seconds
        Longest time of one job.
    memory_gb
        Most address space of a worker beyond what the program itself takes; None: no limit.
    """
    workers = min(n_workers or os.cpu_count() or 1, len(jobs))
    pool: _Pool[Job] = _Pool(function, seconds, memory_gb)
    waiting = list(reversed(jobs))
    deaths: dict[int, int] = {}
    with one_thread_each(), closing(pool):
        for _ in range(workers):
            pool.hand(pool.start(), waiting.pop())
        running = workers
        while running:
            for worker, answer in pool.wait():
                job = worker.job
                assert job is not None
                worker.job = None
                if isinstance(answer, Broken):
                    pool.end(worker)
                    deaths[id(job)] = deaths.get(id(job), 0) + 1
                    if answer.kind == "died" and deaths[id(job)] < DEATHS:
                        pool.hand(pool.start(), job)
                        continue
                if waiting:  # before the answer is recorded, which waits for the disk
                    fresh = isinstance(answer, Broken)
                    pool.hand(pool.start() if fresh else worker, waiting.pop())
                else:
                    running -= 1
                yield job, answer


def called(name: str) -> Callable[[Any], Any]:
    """Return the function that ``module:name`` names."""
    module, _, function = name.partition(":")
    found: Callable[[Any], Any] = getattr(importlib.import_module(module), function)
    return found


FORKS_ITSELF = "jemalloc_bg_thd"
"""Name of a thread of pyarrow's allocator, which sees to itself when a process is forked."""


def can_fork() -> bool:
    """Whether a copy of this process would work: threads are not copied, what they hold stays held.

    Elsewhere than on Linux the system's own libraries do not survive it.
    """
    threads = Path("/proc/self/task")
    if sys.platform != "linux" or not threads.is_dir():
        return False
    try:
        names = [(one / "comm").read_text().strip() for one in threads.iterdir()]
    except OSError:  # one has just ended: ask again another time
        return False
    return sum(name != FORKS_ITSELF for name in names) == 1


def _let_go(pipe: Connection) -> None:
    """Close what a copy has of its parent's files: the lock, the history, other workers' pipes.

    The lock would be held for longer than by a parent that is killed.
    """
    own = {0, 1, 2, pipe.fileno()}
    for one in [int(path.name) for path in Path("/proc/self/fd").iterdir()]:
        if one not in own:
            with suppress(OSError):  # the listing's own is closed
                os.close(one)


def _take_signals() -> None:
    """End as any process does, whatever the parent does about its own signals.

    An interrupt from the keyboard reaches the whole group: the parent answers it. What is ignored,
    as after nohup, stays ignored.
    """
    for number in SIGNALS:
        if number == signal.SIGINT:
            signal.signal(number, signal.SIG_IGN)
        elif signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


def _serve(pipe: Connection, name: str, memory: int | None, parent: int, forked: bool) -> None:
    """Answer jobs until the parent is gone."""
    if forked:
        _let_go(pipe)
    die_with(parent)
    _take_signals()
    look_for_garbage_seldom()
    forgo_documentation()
    function = called(name)
    forgo_compiler()
    forgo_pandas()
    if memory is not None:
        _limit_memory(memory)
    while True:
        try:
            job = pipe.recv()
        except (EOFError, OSError):
            return
        with suppress(OSError):  # the parent has gone
            pipe.send(_attempt(function, job, memory))


def _attempt(function: Callable[[Any], Any], job: Any, memory: int | None) -> Any:
    try:
        return function(job)
    except MemoryError:
        gigabytes = (memory or 0) / GIGABYTE
        return Broken("memory", f"needed more than {gigabytes:g} GB (limits.memory_gb)")
    except OpamcError as error:
        return Broken("refused", str(error))
    except Exception as error:  # noqa: BLE001 - one robot's bug must not stop the others
        return Broken("bug", f"a bug: {type(error).__name__}: {error}")


def _limit_memory(memory: int) -> None:
    """Bound the address space by what the program takes once its libraries are loaded, and more."""
    status = Path("/proc/self/statm")
    now = int(status.read_text().split()[0]) * resource.getpagesize() if status.exists() else 0
    with suppress(ValueError, OSError):
        resource.setrlimit(resource.RLIMIT_AS, (now + memory, resource.RLIM_INFINITY))
