"""One worker process per run: the same results for any number of workers."""

import ctypes
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import active_children, get_context, parent_process
from time import perf_counter
from typing import Generic, TypeVar

from opamc_cli.errors import OpamcError, UsageError
from opamc_cli.stages.processes.interruption import held_back

Item = TypeVar("Item")
Result = TypeVar("Result")

Watch = Callable[[int, int], None]
"""Called with how many items are done and how many there are."""

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


Steps = Callable[[str], Watch]
"""Called with the name of a step as it begins; what it returns, with what is done of it."""


def unwatched(done: int, total: int) -> None:
    """Tell nobody."""


def unshown(step: str) -> Watch:
    """Begin a step that nobody watches."""
    del step
    return unwatched


@dataclass(frozen=True)
class Outcome(Generic[Result]):
    """Results in the items' order, and one sentence for each item that could not be used."""

    results: tuple[Result, ...]
    errors: tuple[OpamcError, ...]

    def __add__(self, other: "Outcome[Result]") -> "Outcome[Result]":
        """Return these and those of the items behind them."""
        return Outcome(self.results + other.results, self.errors + other.errors)


def map_items(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int = 1,
    watch: Watch = unwatched,
) -> Outcome[Result]:
    """Apply a function to every item, in worker processes if that is asked for.

    A user's error (`OpamcError`) in one item does not stop the others. Workers are spawned, never
    forked: threads of compiled libraries do not survive a fork. Each computes on one thread, so
    that workers do not compete for the cores.

    Parameters
    ----------
    function
        Importable by name (workers are spawned).
    items
        What it is applied to.
    jobs
        Number of workers; 0: one per core, if they are worth their start; 1: this process.
    watch
        Called as items get done.
    """
    if jobs == 0:
        return _as_it_pays(function, items, watch)
    workers = min(jobs, len(items))
    if workers <= 1:
        return _gather([partial(function, item) for item in items], watch)
    from concurrent.futures import ProcessPoolExecutor  # who works alone does without
    from concurrent.futures.process import BrokenProcessPool

    pool = ProcessPoolExecutor(workers, get_context("spawn"), _end_with_parent, (os.getpid(),))
    try:
        with one_thread_each():
            with held_back():
                calls = [pool.submit(function, item).result for item in items]
            return _gather(calls, watch)
    except BrokenProcessPool as error:
        msg = "a worker process was killed, most often for want of memory; use fewer --jobs"
        raise UsageError(msg) from error
    except BaseException:
        for worker in active_children():
            worker.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Have the processes that are started meanwhile compute on one thread."""
    saved = {name: os.environ.get(name) for name in THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in saved.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


START_S = 6.0
"""A worker takes some 3 s to start and to load the kernels: two must save more than that."""


def _as_it_pays(
    function: Callable[[Item], Result], items: Sequence[Item], watch: Watch
) -> Outcome[Result]:
    """Work on item after item here, until what is left is worth starting workers for."""
    cores = os.cpu_count() or 1
    done, left = Outcome[Result]((), ()), items
    while left:
        k = len(items) - len(left)
        watch(k, len(items))
        begun = perf_counter()
        done += _gather([partial(function, left[0])], unwatched)
        left = left[1:]
        # the first item pays for what is loaded once
        if k and cores > 1 and (perf_counter() - begun) * len(left) > START_S:
            break
    n_here = len(items) - len(left)
    if left:
        return done + map_items(function, left, cores, lambda n, _: watch(n_here + n, len(items)))
    watch(n_here, len(items))
    return done


def die_with(parent: int) -> None:
    """Have the kernel, where it can, end this process when its parent ends, however that ends."""
    with suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def _end_with_parent(parent: int) -> None:
    """Have this worker end when its parent does: at once, or when the interpreter gets to it."""
    die_with(parent)
    threading.Thread(target=_watch_parent, daemon=True).start()


def _watch_parent() -> None:
    process = parent_process()
    if process is not None:
        process.join()
        os._exit(1)


_PR_SET_PDEATHSIG = 1


def _gather(calls: Sequence[Callable[[], Result]], watch: Watch) -> Outcome[Result]:
    results: list[Result] = []
    errors: list[OpamcError] = []
    for done, call in enumerate(calls):
        watch(done, len(calls))
        try:
            results.append(call())
        except OpamcError as error:
            errors.append(error)
    watch(len(calls), len(calls))
    return Outcome(tuple(results), tuple(errors))
