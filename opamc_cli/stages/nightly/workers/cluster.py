"""A Dask cluster in the place of this machine's processes: the same function, the same results."""

import importlib
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from opamc_cli.errors import OpamcError, UsageError
from opamc_cli.stages.nightly.workers.workers import Broken, called

Job = TypeVar("Job")

CONNECT_S = 30.0
LOOK_EVERY_S = 0.05
AHEAD = 2
"""Nights per thread of the cluster that are handed out beforehand: a lost scheduler costs them."""


class SchedulerLostError(UsageError):
    """The scheduler has gone; what was done is kept."""


def run_all(
    function: str, jobs: Sequence[Job], address: str, *, seconds: float
) -> Iterator[tuple[Job, Any]]:
    """Yield every job with its result, or why it has none, as they end.

    A worker that dies is none of our business: Dask hands its nights to another. Memory is limited
    by the workers' own `--memory-limit`; a worker that takes longer than `seconds` is restarted.

    Parameters
    ----------
    function
        ``module:name`` of a function of one job, importable on the workers.
    jobs
        What it is applied to, in this order.
    address
        Of the scheduler.
    seconds
        Longest time of one job once it has begun.

    Raises
    ------
    UsageError
        If Dask is not installed or the scheduler does not answer.
    SchedulerLostError
        If it goes away on the way.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        msg = "--scheduler needs Dask; install it with `pip install 'opamc[cluster]'`"
        raise UsageError(msg) from error
    try:
        client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
    except (TimeoutError, OSError, ValueError) as error:
        msg = f"--scheduler {address}: does not answer ({error}); start it, or check the address"
        raise UsageError(msg) from error
    waiting = list(reversed(jobs))
    job_of: dict[Any, Job] = {}
    begun: dict[Any, float] = {}
    n_done = 0
    try:
        completed = distributed.as_completed([], loop=client.loop, raise_errors=False)

        def hand_out() -> None:
            threads = sum(client.nthreads().values()) or 1
            while waiting and len(job_of) < AHEAD * threads:
                job = waiting.pop()
                future = client.submit(_call, function, job, pure=False)
                job_of[future.key] = job
                completed.add(future)

        hand_out()
        while job_of:
            if not completed.has_ready():
                if client.status != "running":
                    raise _lost(address, n_done, len(jobs))
                _end_overdue(client, begun, job_of, seconds)
                time.sleep(LOOK_EVERY_S)
                continue
            for future in completed.next_batch(block=False):
                if future.status == "lost":
                    # its worker died with the result: the scheduler has it computed once more
                    completed.add(future)
                    continue
                answer = _answer(future)
                if client.status != "running":
                    raise _lost(address, n_done, len(jobs))
                n_done += 1
                yield job_of.pop(future.key), answer
            hand_out()
    except (TimeoutError, OSError) as error:
        raise _lost(address, n_done, len(jobs)) from error
    finally:
        with suppress(Exception):
            client.close(timeout=2)


def _lost(address: str, n_done: int, n_all: int) -> SchedulerLostError:
    return SchedulerLostError(
        f"--scheduler {address}: is lost; {n_done} of {n_all} nights are done and kept, start "
        "again for the others"
    )


def _call(function: str, job: Any) -> Any:
    """Run on a worker: an error of ours is an answer, so that it is not tried elsewhere."""
    try:
        return called(function)(job)
    except OpamcError as error:
        return Broken("refused", str(error))
    except Exception as error:  # noqa: BLE001 - one robot's bug must not stop the others
        return Broken("bug", f"a bug: {type(error).__name__}: {error}")


def _answer(future: Any) -> Any:
    if future.status == "finished":
        return future.result()
    error = future.exception() if future.status == "error" else None
    kind = type(error).__name__ if error is not None else future.status
    return Broken("died", f"its workers were lost ({kind})")


def _end_overdue(
    client: Any, begun: dict[Any, float], job_of: dict[Any, Any], seconds: float
) -> None:
    """Restart the workers of nights that take too long; Dask tells who computes what."""
    with suppress(OSError):
        now = time.monotonic()
        for worker, keys in client.processing().items():
            for key in keys:
                if key in job_of and now - begun.setdefault(key, now) > seconds:
                    client.restart_workers([worker], timeout=CONNECT_S)
                    return
