"""Recordings that are given twice: they hide a fault, since they are their own baseline."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from opamc_cli.errors import InputError, OpamcError
from opamc_cli.stages.chain.kept import KeptResults, remembered
from opamc_cli.storage.runs import Run, find_runs


def repeated(
    baseline: Sequence[Path], target: Sequence[Path], kept: KeptResults | None = None
) -> tuple[dict[str, set[Path]], tuple[str, ...]]:
    """Return the runs to be left out of "baseline" and "target", and one sentence for each.

    Of equal recordings, the target's is kept rather than the baseline's, and the first name of
    one side. A copy, a link, or the same samples written by another program are equal.

    Parameters
    ----------
    baseline, target
        Run files and folders of them.
    kept
        Where results of the same work on the baseline may lie.

    Raises
    ------
    InputError
        If nothing is left of the baseline.
    """
    seen: dict[str, tuple[str, Path]] = {}
    left_out: dict[str, set[Path]] = {"baseline": set(), "target": set()}
    notes = []
    sides = (
        ("target", target, _fingerprint),
        ("baseline", baseline, remembered(_fingerprint, kept)),
    )
    for role, paths, fingerprint in sides:
        runs = find_runs(paths)
        for _, path in runs:
            try:
                key = fingerprint(path)
            except OpamcError:
                continue  # reported with its reason when its turn comes
            if key is None:
                continue
            if key not in seen:
                seen[key] = role, path
                continue
            first_role, first = seen[key]
            left_out[role].add(path)
            where = f"{role}'s {path} is the same recording as the {first_role}'s {first}"
            notes.append(f"left out: the {where}")
        if runs and all(path in left_out[role] for _, path in runs):
            msg = (
                f"{runs[0][1]}: every run of the {role} is also one of the target; a baseline "
                "needs other recordings than those that it judges"
            )
            raise InputError(msg)
    return left_out, tuple(notes)


def _fingerprint(path: Path) -> str | None:
    """Hash the currents at the beginning of a run; None if none of them moves."""
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
    # recordings of dead sensors are alike without being the same
    return state.hexdigest() if moving else None


_COMPARED = 1 << 16
"""Samples of each axis: no two recordings have the same noise for so long."""
