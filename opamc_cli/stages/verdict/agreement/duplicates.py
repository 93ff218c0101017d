"""Recordings that are given twice: they hide a fault, since they are their own baseline."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from opamc_cli.errors import InputError, OpamcError
from opamc_cli.storage.runs import Run, find_runs


def repeated(
    baseline: Sequence[Path], target: Sequence[Path]
) -> tuple[frozenset[Path], tuple[str, ...]]:
    """Return the runs to be left out, and one sentence for each.

    Of equal recordings, the target's is kept rather than the baseline's, and the first name of
    one side. A copy, a link, or the same samples written by another program are equal.

    Raises
    ------
    InputError
        If nothing is left of the baseline.
    """
    seen: dict[str, tuple[str, Path]] = {}
    left_out: set[Path] = set()
    notes = []
    for role, paths in (("target", target), ("baseline", baseline)):
        runs = find_runs(paths)
        for _, path in runs:
            key = _fingerprint(path)
            if key is None:
                continue
            if key not in seen:
                seen[key] = role, path
                continue
            kept_role, kept = seen[key]
            left_out.add(path)
            where = f"{role}'s {path} is the same recording as the {kept_role}'s {kept}"
            notes.append(f"left out: the {where}")
        if runs and all(path in left_out for _, path in runs):
            msg = (
                f"{runs[0][1]}: every run of the {role} is also one of the target; a baseline "
                "needs other recordings than those that it judges"
            )
            raise InputError(msg)
    return frozenset(left_out), tuple(notes)


def _fingerprint(path: Path) -> str | None:
    """Hash the currents at the beginning of a run; None for one that cannot be told from others."""
    try:
        with Run(path) as run:
            state = hashlib.sha256(f"{run.n_samples} {run.sampling_rate_hz}".encode())
            moving = False
            for axis in run.axes:
                channels = run.channels(axis)
                names = channels.phases or (str(channels.current),)
                for name, values in run.read(names, 0, _COMPARED).items():
                    known = values[np.isfinite(values)]
                    moving = moving or (known.size > 1 and bool(np.ptp(known) > 0))
                    state.update(name.encode() + values.astype(np.float32).tobytes())
    except OpamcError:
        return None  # reported with its reason when its turn comes
    # recordings of dead sensors are alike without being the same
    return state.hexdigest() if moving else None


_COMPARED = 1 << 16
"""Samples of each axis: no two recordings have the same noise for so long."""
