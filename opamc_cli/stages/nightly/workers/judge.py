"""Judges one robot's night: what workers of this machine and of a cluster call."""

import math
import re
import shutil
import tempfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli import __version__
from opamc_cli.errors import InputError, NotEnoughDataError, UsageError
from opamc_cli.stages import diagnose
from opamc_cli.stages.nightly.workers.ahead import look_ahead
from opamc_cli.stages.nightly.workers.night import (
    AxisResult,
    Input,
    NightJob,
    ProgramJob,
    ProgramResult,
)
from opamc_cli.stages.processes.kept import KeptResults
from opamc_cli.stages.verdict.wording.brief import foremost
from opamc_cli.stages.verdict.wording.reasons import excuses_little, lies_outside
from opamc_cli.storage.files.atomic import scratch
from opamc_cli.storage.history.rows import Told
from opamc_cli.storage.logs import fetch
from opamc_cli.storage.runs.hashes import know_sha256
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.channels import axes_phrase
from opamc_cli.storage.schemas.tables import PATTERNS
from opamc_cli.storage.tables import read_table


def compute(job: NightJob) -> tuple[ProgramResult, ...]:
    """Judge one robot's night.

    Returns
    -------
    tuple of ProgramResult
        The program that is worst off first.

    Raises
    ------
    UsageError
        If the worker is of another version, or cannot write.
    """
    if job.version != __version__:
        msg = f"the worker has version {__version__} of opamc, {job.version} is needed; install it"
        raise UsageError(msg)
    folder = _scratch(job)
    try:
        return tuple(
            sorted(
                (_program(job, one, folder / str(n)) for n, one in enumerate(job.programs)),
                key=lambda result: result.rank,
            )
        )
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _scratch(job: NightJob) -> Path:
    """Make a folder for what is thrown away: below `out`, or in the system's where that is not.

    Tables name their recordings by relative paths, and the verdict names its tables by hash: on all
    machines that see `out` the bytes are the same.
    """
    try:
        if job.scratch.parent.is_dir():
            job.scratch.mkdir(exist_ok=True)
            return Path(tempfile.mkdtemp(prefix=f"{job.night}-", dir=job.scratch))
        return Path(tempfile.mkdtemp(prefix=f"{job.night}-"))
    except OSError as error:
        msg = f"{job.scratch}: cannot be written ({error.strerror}); check space and permissions"
        raise UsageError(msg) from error


def _program(job: NightJob, wanted: ProgramJob, folder: Path) -> ProgramResult:
    if wanted.missing:
        return ProgramResult(wanted.program, failures=(wanted.missing,))
    # a machine that does not see `out` throws its copies away
    copies = job.copies if job.copies.parent.is_dir() else folder / "copies"
    kept = None if job.kept is None else KeptResults(job.kept)
    try:
        sides = [
            _laid_out(inputs, folder / role, copies)
            for role, inputs in (("baseline", wanted.baseline), ("target", wanted.targets))
        ]
        with scratch():  # what is kept of the baseline is held against its hash
            outcome = diagnose.run(
                [sides[0]],
                [sides[1]],
                job.config,
                folder / "out",
                kept=kept,
                figures_of_healthy=False,
                worded=lambda note: _plain(note, folder),
                nights_in_folders=True,
            )
            if kept is not None:
                look_ahead(wanted.baseline, folder / "out", job.config, kept)
        temperatures = _temperatures(folder / "out" / "target" / files.PATTERNS)
        written = {
            files.VERDICT: outcome.verdict_path.read_bytes(),
            files.REPORT: outcome.report_path.read_bytes(),
        }
    except (InputError, NotEnoughDataError) as error:
        # the recordings' own fault: it would fail again; all other errors are the caller's
        return ProgramResult(wanted.program, failures=(_plain(str(error), folder),))
    there = [entry["axis"] for entry in outcome.verdict["axes"]]
    lacking = [axis for axis in job.axes or () if axis not in there]
    failures = [_plain(str(error), folder) for error in outcome.errors]
    # the night is judged by the rest of its baseline: no failure of the night
    of_baseline, failures = failures[: outcome.n_of_baseline], failures[outcome.n_of_baseline :]
    if lacking:
        failures.append(
            f"{axes_phrase(lacking)} of program {wanted.program!r} cannot be judged: recorded "
            f"were {axes_phrase(there)} (robots.{job.robot}.axes)"
        )
    first = (foremost(outcome.verdict["axes"]) or {}).get("axis")
    axes = tuple(
        _axis(entry, temperatures.get(entry["axis"]), outcome.in_part, first)
        for entry in outcome.verdict["axes"]
        if job.axes is None or entry["axis"] in job.axes
    )
    return ProgramResult(
        wanted.program,
        axes,
        written,
        tuple(failures),
        tuple(of_baseline),
        tuple(outcome.notes),
    )


def _laid_out(inputs: Sequence[Input], folder: Path, copies: Path) -> Path:
    """Lay recordings out under the names that tables and reports are to call them."""
    for one in inputs:
        path = fetch(one.log, copies)
        if not path.exists():
            msg = f"{one.log.path}: is gone since the night was planned; put it back"
            raise InputError(msg)
        state = path.stat()
        if one.log.remote or (state.st_size, state.st_mtime_ns) == (one.log.size, one.log.mtime_ns):
            know_sha256(path, state.st_mtime_ns, state.st_size, one.sha256)
        link = folder / f"{one.name}.parquet"
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(path.resolve())
    return folder


def _temperatures(patterns: Path) -> dict[int, float]:
    """Return the median temperature of each joint, where it is logged."""
    table = read_table(patterns, "patterns", PATTERNS)
    axis = table["axis"].to_numpy()
    warm = table["temperature_c"].to_numpy(zero_copy_only=False).astype(np.float64)
    return {
        int(one): float(np.median(known))
        for one in np.unique(axis)
        if (known := warm[(axis == one) & np.isfinite(warm)]).size
    }


def _axis(
    entry: Mapping[str, Any],
    temperature_c: float | None,
    in_part: Collection[int] = (),
    first: int | None = None,
) -> AxisResult:
    cause = entry.get("cause") or {}
    if cause and lies_outside(cause) and excuses_little(cause):
        cause = {}  # beside it stands what nobody should look away from
    distance = entry.get("distance") or {}
    text = (entry.get("brief") or {}).get("inspect") or [*entry.get("reasons", ()), ""][0]
    behind = entry["state"] in ("changed", "fault") and first != entry["axis"]
    return AxisResult(
        axis=int(entry["axis"]),
        state=str(entry["state"]),
        health_index=entry.get("health_index"),
        p_value=entry.get("p_value"),
        cause=cause.get("effect"),
        harmless=bool(cause.get("harmless")),
        log_distance=_log(distance.get("ratio")),
        log_common=_log(distance.get("allowed")),
        effect=distance.get("effect"),
        temperature_c=temperature_c,
        reason=Told(
            bool(entry.get("excused")), False, first if behind else None, str(text)
        ).as_reason(),
        in_part=entry["axis"] in in_part,
    )


def _log(ratio: float | None) -> float | None:
    return math.log(ratio) if ratio else None


def _plain(text: str, folder: Path) -> str:
    """Take the folder of the work out of a sentence: it is gone, and has another name each time.

    What is kept of a baseline was said in the work of another night, of another machine perhaps:
    of a path as that night's, too, the recording's place alone is left.
    """
    for role in ("baseline", "target"):
        text = text.replace(f"{folder / role}/", "").replace(f"{folder / 'out' / role}/", "")
    text = text.replace(f"{folder}/", "").replace(f"{folder.resolve()}/", "")
    root = folder.parent.parent
    known = "|".join(re.escape(str(one)) for one in (root, root.resolve()))
    others = rf"\S*/{re.escape(root.name)}"
    return re.sub(rf"(?:{known}|{others})/[^/]+/\d+/(?:out/)?(?:baseline|target)/", "", text)
