"""One step of a model's work on every axis of some runs, the axes side by side."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from threadpoolctl import threadpool_limits

from opamc_cli.config.joint_model import JointModelConfig
from opamc_cli.errors import ConfigError, InputError, OpamcError
from opamc_cli.stages.model.axis_model import declared_effects, library_of
from opamc_cli.stages.model.declared.users_effects import users_effects_named
from opamc_cli.stages.processes.freed_memory import keep_freed_memory
from opamc_cli.stages.processes.parallel import Watch, map_items
from opamc_cli.stages.recordings.axis_recording import axes_of
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas.channels import axes_phrase

Result = TypeVar("Result")
Runs = Sequence[tuple[str, Path]]
OnAxis = Callable[[JointModelConfig, Sequence[Run], int], Result]


@dataclass(frozen=True)
class Outcome:
    """What a model command did, and what could not be done."""

    results: tuple[dict[str, Any], ...]
    written: tuple[Path, ...]
    errors: tuple[OpamcError, ...]


def on_each_axis(
    work: OnAxis[Result],
    model: JointModelConfig,
    paths: Runs,
    axes: Sequence[int],
    jobs: int,
    watch: Watch,
    own: int | None = None,
) -> tuple[list[Result], list[OpamcError], list[tuple[Path, str]]]:
    """Do something with each axis of some runs; return results, what failed, and the runs' hashes.

    Parameters
    ----------
    work : callable
        Importable by name; model, runs and axis in, what can be pickled out.
    model, paths, axes, jobs, watch
        As of `model.fit`.
    own
        The axis that is meant where none is named and the runs have it.

    Raises
    ------
    ConfigError
        If the model cannot be used, on whatever axis.
    OpamcError
        If nothing can be done.
    """
    declared_effects(model, library_of(model))
    errors: list[OpamcError] = []
    usable: list[tuple[str, Path]] = []
    with ExitStack() as stack:
        runs: list[Run] = []
        for name, path in paths:
            try:
                runs.append(stack.enter_context(Run(path, name)))
            except OpamcError as error:
                errors.append(error)
            else:
                usable.append((name, path))
        if not runs:
            raise errors[0]
        logged = axes_of(runs)
        wanted = list(axes) or ([own] if own in logged else logged)
        inputs = [(run.path, run.sha256) for run in runs]
        if not wanted:
            msg = f"{runs[0].path}: the runs have no axis in common; name one with --axis"
            raise InputError(msg)
        if not axes and own is None:
            everywhere = {axis for run in runs for axis in run.axes}
            errors += [
                InputError(
                    f"{run.path}: has no {axes_phrase(sorted(lacking))}, which another run has: "
                    "left out; name axes with --axis, or give runs that have them"
                )
                for run in runs
                if (lacking := everywhere - set(run.axes))
            ]
    done = map_items(partial(_on_axis, work, model, usable), wanted, jobs, watch)
    for failed in done.errors:
        if isinstance(failed, ConfigError):
            raise failed
    errors += done.errors
    if not done.results:
        raise errors[0] if len(wanted) > 1 else errors[-1]
    return list(done.results), errors, inputs


def _on_axis(work: OnAxis[Result], model: JointModelConfig, paths: Runs, axis: int) -> Result:
    keep_freed_memory()
    # A worker has one thread: with more, the sums of products here would differ in the last digit.
    with ExitStack() as stack, threadpool_limits(1), users_effects_named():
        runs = [stack.enter_context(Run(path, name)) for name, path in paths]
        return work(model, runs, axis)
