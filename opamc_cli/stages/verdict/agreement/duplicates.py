"""Recordings that are given twice: they hide a fault, since they are their own baseline."""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np

from opamc_cli.errors import InputError, OpamcError
from opamc_cli.stages.processes.kept import KeptResults, remembered
from opamc_cli.stages.recordings.sessions import started
from opamc_cli.storage.runs.finding import find_runs
from opamc_cli.storage.runs.run import Run


@dataclass
class Repeated:
    """Runs to be left out."""

    baseline: set[Path] = field(default_factory=set)
    target: set[Path] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    """One sentence for each of which nothing is missing."""
    errors: list[InputError] = field(default_factory=list)
    """One for each of the target's that may stand for another recording, which is not judged."""


def repeated(
    baseline: Sequence[Path], target: Sequence[Path], kept: KeptResults | None = None
) -> Repeated:
    """Find the runs that are given twice.

    A copy, a link, or the same samples written by another program are equal. Of equal recordings,
    the first name of one side is kept, and the target's rather than the baseline's. One of the
    target that says to have begun at another time is an error: a logger that is stuck repeats what
    it knows.

    Parameters
    ----------
    baseline, target
        Run files and folders of them.
    kept
        Where results of the same work on the baseline may lie.

    Raises
    ------
    InputError
        If nothing is left of one side.
    """
    found = Repeated()
    judged: dict[str, Path] = {}
    runs = [path for _, path in find_runs(target)]
    for key, path in _hashed(runs, _hash_of_currents):
        first = judged.setdefault(key, path)
        if first != path:
            found.target.add(path)
            if _begun(path) == _begun(first):
                where = f"target's {path} is the same recording as the target's {first}"
                found.notes.append(f"left out: the {where}; nothing is missing by it")
            else:
                why = f"left out, its samples are those of {first}; was it recorded?"
                found.errors.append(InputError(f"{path}: {why}"))
    known: dict[str, Path] = {}
    healthy = [path for _, path in find_runs(baseline)]
    for key, path in _hashed(healthy, remembered(_hash_of_currents, kept)):
        first = known.setdefault(key, path)
        if first != path:
            found.baseline.add(path)
            where = f"baseline's {path} is the same recording as the baseline's {first}"
            found.notes.append(f"left out: the {where}")
        elif key in judged and _begun(path) == _begun(judged[key]):
            found.baseline.add(path)
            where = f"baseline's {path} is the same recording as the target's {judged[key]}"
            found.notes.append(f"left out: the {where}")
        elif key in judged:
            found.target.add(judged[key])
            why = f"left out, its samples are those of the baseline's {path}; was it recorded?"
            found.errors.append(InputError(f"{judged[key]}: {why}"))
    if healthy and found.baseline.issuperset(healthy):
        msg = (
            f"{healthy[0]}: every run of the baseline is also one of the target; a baseline "
            "needs other recordings than those that it judges"
        )
        raise InputError(msg)
    if runs and found.target.issuperset(runs):
        raise found.errors[0]
    return found


def _hashed(
    runs: Sequence[Path], hash_of: Callable[[Path], str | None]
) -> Iterator[tuple[str, Path]]:
    for path in runs:
        try:
            key = hash_of(path)
        except OpamcError:
            continue  # reported with its reason when its turn comes
        if key is not None:
            yield key, path


def _begun(path: Path) -> datetime | None:
    with Run(path) as run:
        return started(run.info.started_at)


def _hash_of_currents(path: Path) -> str | None:
    """Hash the currents at the beginning of a run; None if none of them moves."""
    with Run(path) as run:
        state = hashlib.sha256(f"{run.n_samples}".encode())
        moving = False
        for axis in run.axes:
            channels = run.channels(axis)
            names = channels.phases or (str(channels.current),)
            for name, values in run.read(names, 0, _COMPARED).items():
                known = values[np.isfinite(values)]
                moving = moving or (known.size > 1 and bool(np.ptp(known) > 0))
                state.update(name.encode() + values.astype(np.float32).tobytes())
    # recordings of dead sensors are alike without being the same
    return state.hexdigest() if moving else None


_COMPARED = 1 << 16
"""Samples of each axis: no two recordings have the same noise for so long."""
