"""Run cases, every contestant in a child of its own, with a limit of time."""

import multiprocessing
import resource
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from panel import contestants
from panel.case import Case, Logged

Row = dict[str, Any]
FORK = multiprocessing.get_context("fork")
"""A child begins with what the parent has compiled."""


@dataclass
class Task:
    """A contestant at work on a case."""

    row: Row
    contestant: str
    process: BaseProcess
    answer: Connection
    ends: float


def rows(
    cases: Iterable[Case],
    names: Sequence[str],
    without: tuple[str, ...] = (),
    *,
    limit_s: float = 120.0,
    jobs: int = 1,
) -> Iterator[Row]:
    """Yield a row per case, as they are done.

    Parameters
    ----------
    cases : iterable of Case
    names : sequence of str
        Contestants, of `contestants.ALL`.
    without : tuple of str
        Rules that the loop has to do without.
    limit_s : float
        Per case and contestant.
    jobs : int
        Children at a time.
    """
    active: list[Task] = []
    open_rows: dict[int, int] = {}
    for case in cases:
        try:
            recordings = case.make()
        except ValueError as error:
            print(f"  left out: {case.source}, {case.name}: {error}", flush=True)
            continue
        row = _row(case, recordings)
        open_rows[id(row)] = len(names)
        for name in names:
            while len(active) >= jobs:
                yield from _done(active, open_rows)
            active.append(_start(row, name, case, recordings, without, limit_s))
    while active:
        yield from _done(active, open_rows)


def _row(case: Case, recordings: list[Logged]) -> Row:
    kept = ("source", "name", "stroke", "sensing", "declared", "hidden", "present", "size", "seed")
    logged = [one.temperature for one in recordings if one.temperature is not None]
    # Of a joint that warms up by no more than its sensor's step nobody can tell more than that.
    steady = all(np.unique(one).size <= 2 for one in logged)
    right = [case.hidden, *(["warmup"] if case.hidden == "thermal_viscous" and steady else [])]
    return {key: getattr(case, key) for key in kept} | {"right": right, "results": {}}


def _start(
    row: Row,
    name: str,
    case: Case,
    recordings: list[Logged],
    without: tuple[str, ...],
    limit_s: float,
) -> Task:
    answer, inside = FORK.Pipe(duplex=False)
    process = FORK.Process(target=_work, args=(inside, name, case, recordings, without))
    process.start()
    inside.close()
    return Task(row, name, process, answer, time.monotonic() + limit_s)


def _work(
    answer: Connection, name: str, case: Case, recordings: list[Logged], without: tuple[str, ...]
) -> None:
    try:
        result = contestants.ALL[name](case, recordings, without)
    # Whatever goes wrong belongs into the table.
    except Exception as error:  # noqa: BLE001
        result = {"error": f"{type(error).__name__}: {error}"}
    result["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    answer.send(result)


def _done(active: list[Task], open_rows: dict[int, int]) -> Iterator[Row]:
    """Wait for one task or a limit; yield rows whose last contestant is done."""
    next_limit = min(task.ends for task in active)
    wait([task.answer for task in active], timeout=max(next_limit - time.monotonic(), 0.0))
    for task in list(active):
        if task.answer.poll():
            try:
                result = task.answer.recv()
            except EOFError:
                result = {"error": "killed, perhaps for want of memory"}
        elif time.monotonic() >= task.ends:
            task.process.kill()
            result = {"error": "time limit"}
        else:
            continue
        task.process.join()
        active.remove(task)
        task.row["results"][task.contestant] = result | judged(task.row, result)
        open_rows[id(task.row)] -= 1
        if not open_rows[id(task.row)]:
            yield task.row


def judged(row: Row, result: dict[str, Any]) -> dict[str, Any]:
    """Whether the hidden effect is named, or tied, and which names are wrong."""
    if row["hidden"] is None or "added" not in result:
        return {}
    true = {*row["right"], *row["present"]} - {""}
    named = [{step["name"], *step["ties"]} for step in result["added"]]
    return {
        "named": any(names & {*row["right"]} for names in named),
        "wrong": [
            step["name"]
            for step, names in zip(result["added"], named, strict=True)
            if not names & true
        ],
    }
