"""Stage `model`: runs and a declared model in; fit, candidates, loop and extended model out."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import yaml

from opamc_cli.config.joint_model import JointModelConfig
from opamc_cli.errors import ConfigError, InputError, OpamcError
from opamc_cli.joint.explain.saturated import saturated, unnamed_library
from opamc_cli.joint.fit.intervals import certainty
from opamc_cli.joint.loop import close_loop, untestable
from opamc_cli.joint.name.chain import chain_of
from opamc_cli.joint.name.search import Pool, trials
from opamc_cli.stages.model.axis_model import AxisModel, lay
from opamc_cli.stages.model.tables import (
    candidate_row,
    explained_entry,
    extended_model,
    fit_rows,
    fit_summary,
    loop_entry,
    residual_table,
    shown_parameters,
    spectrum_table,
)
from opamc_cli.stages.processes.parallel import Watch, unwatched
from opamc_cli.stages.recordings.axis_recording import axes_of
from opamc_cli.storage.files.atomic import atomic_path, ensure_directory
from opamc_cli.storage.runs import Run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import CANDIDATES, FIT
from opamc_cli.storage.tables import write_table

CLOSE_FILES = (
    files.LOOP,
    files.MODEL,
    files.CANDIDATES,
    files.FIT,
    files.RESIDUALS,
    files.ORDER_SPECTRUM,
)
"""What closing the loop leaves, beside `model_axis1.yaml` and so on where there are many axes."""


@dataclass(frozen=True)
class Outcome:
    """What a model command did, and what could not be done."""

    results: tuple[dict[str, Any], ...]
    written: tuple[Path, ...]
    errors: tuple[OpamcError, ...]


def fit(
    model: JointModelConfig,
    paths: Sequence[tuple[str, Path]],
    axes: Sequence[int],
    out: Path,
    *,
    watch: Watch = unwatched,
) -> Outcome:
    """Fit a declared model on each axis; writes fit.parquet.

    Parameters
    ----------
    model : JointModelConfig
        Declared model.
    paths : sequence of (str, Path)
        Names and files of the runs.
    axes : sequence of int
        Axes; empty for all.
    out : Path
        Output folder.
    watch : callable
        Called as axes get done.
    """
    rows: list[dict[str, Any]] = []

    def one(laid: AxisModel) -> dict[str, Any]:
        result = laid.fit
        known = certainty(result)
        rows.extend(fit_rows(laid.axis, result, known, laid.unit))
        return fit_summary(laid, result, known)

    results, errors, inputs = each_axis(
        paths, axes, lambda runs, axis: one(lay(model, runs, axis)), watch
    )
    written = [_write(out / files.FIT, rows, FIT, model, inputs)] if results else []
    return Outcome(tuple(results), tuple(written), tuple(errors))


def trace(
    model: JointModelConfig,
    paths: Sequence[tuple[str, Path]],
    axes: Sequence[int],
    out: Path,
    *,
    watch: Watch = unwatched,
) -> Outcome:
    """Trace the residual of a declared model on each axis; writes candidates.parquet."""
    rows: list[dict[str, Any]] = []

    def one(laid: AxisModel) -> dict[str, Any]:
        base = laid.fit
        start = chain_of(base, 0)
        explained = saturated(start, Pool.of(base.session, unnamed_library()))
        tried = trials(start, Pool.of(base.session, laid.library))
        rows.extend(candidate_row(laid.axis, 0, trial, False) for trial in tried)
        return {
            "axis": laid.axis,
            "unit": laid.unit,
            "declared": [term.effect.name for term in base.terms],
            "explained": explained_entry(start, explained),
            "candidates": [
                {
                    "effect": trial.term.effect.name,
                    "domain": trial.term.effect.domain,
                    "parameters": shown_parameters(trial.term),
                    "gain": trial.gain,
                    "p_value": trial.p_value,
                    "why_not": trial.why_not,
                }
                for trial in tried
            ],
            "untestable": [
                {"effect": one.effect, "why": one.why} for one in untestable(base, laid.library)
            ],
        }

    results, errors, inputs = each_axis(
        paths, axes, lambda runs, axis: one(lay(model, runs, axis)), watch
    )
    written = [_write(out / files.CANDIDATES, rows, CANDIDATES, model, inputs)] if results else []
    return Outcome(tuple(results), tuple(written), tuple(errors))


def close(
    model: JointModelConfig,
    paths: Sequence[tuple[str, Path]],
    axes: Sequence[int],
    out: Path,
    seed: int = 0,
    *,
    watch: Watch = unwatched,
) -> Outcome:
    """Close the loop on each axis; writes loop.json, the extended model and the tables.

    Parameters
    ----------
    model : JointModelConfig
        Declared model.
    paths : sequence of (str, Path)
        Names and files of the runs.
    axes : sequence of int
        Axes; empty for all.
    out : Path
        Output folder.
    seed : int
        For the decoys.
    watch : callable
        Called as axes get done.
    """
    candidates: list[dict[str, Any]] = []
    fits: list[dict[str, Any]] = []
    residuals: list[pa.Table] = []
    spectra: list[pa.Table] = []
    extended: dict[int, dict[str, Any]] = {}

    def one(laid: AxisModel) -> dict[str, Any]:
        loop = close_loop(laid.fit, laid.library, seed)
        added = {id(step.term) for step in loop.steps}
        candidates.extend(
            candidate_row(laid.axis, number, trial, id(trial.term) in added)
            for number, trial in loop.tried
        )
        fits.extend(fit_rows(laid.axis, loop.after, certainty(loop.after), laid.unit))
        residuals.append(residual_table(laid.axis, loop))
        spectra.append(spectrum_table(laid.axis, loop))
        extended[laid.axis] = extended_model(model, laid, loop)
        return loop_entry(laid, loop)

    results, errors, inputs = each_axis(
        paths, axes, lambda runs, axis: one(lay(model, runs, axis)), watch
    )
    if not results:
        return Outcome((), (), tuple(errors))
    ensure_directory(out)
    written = [
        _write(out / files.CANDIDATES, candidates, CANDIDATES, model, inputs),
        _write(out / files.FIT, fits, FIT, model, inputs),
        _write_tables(out / files.RESIDUALS, residuals, model, inputs),
        _write_tables(out / files.ORDER_SPECTRUM, spectra, model, inputs),
    ]
    for axis, values in extended.items():
        name = files.MODEL if len(extended) == 1 else f"model_axis{axis}.yaml"
        with atomic_path(out / name) as temporary:
            temporary.write_text(
                yaml.safe_dump(values, sort_keys=False, default_flow_style=None), encoding="utf-8"
            )
        written.append(out / name)
    with atomic_path(out / files.LOOP) as temporary:
        text = json.dumps({"axes": results}, indent=2, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    written.append(out / files.LOOP)
    return Outcome(tuple(results), tuple(written), tuple(errors))


def each_axis(
    paths: Sequence[tuple[str, Path]],
    axes: Sequence[int],
    one: Callable[[Sequence[Run], int], dict[str, Any]],
    watch: Watch,
) -> tuple[list[dict[str, Any]], list[OpamcError], list[tuple[Path, str]]]:
    """Do something with each axis of some runs; return results, what failed, and the runs' hashes.

    Raises
    ------
    OpamcError
        If nothing can be done.
    """
    runs: list[Run] = []
    results: list[dict[str, Any]] = []
    errors: list[OpamcError] = []
    for name, path in paths:
        try:
            runs.append(Run(path, name))
        except OpamcError as error:
            errors.append(error)
    if not runs:
        raise errors[0]
    try:
        wanted = list(axes) or axes_of(runs)
        if not wanted:
            msg = f"{runs[0].path}: the runs have no axis in common; name one with --axis"
            raise InputError(msg)
        for done, axis in enumerate(wanted):
            watch(done, len(wanted))
            try:
                results.append(one(runs, axis))
            except ConfigError:
                raise
            except OpamcError as error:
                if len(wanted) == 1:
                    raise
                errors.append(error)
        inputs = [(run.path, run.sha256) for run in runs]
    finally:
        for run in runs:
            run.close()
    if errors and not results:
        raise errors[0]
    return results, errors, inputs


def _write(
    path: Path,
    rows: list[dict[str, Any]],
    schema: pa.Schema,
    model: JointModelConfig,
    inputs: Sequence[tuple[Path, str]],
) -> Path:
    return _write_tables(path, [pa.Table.from_pylist(rows, schema=schema)], model, inputs)


def _write_tables(
    path: Path,
    tables: list[pa.Table],
    model: JointModelConfig,
    inputs: Sequence[tuple[Path, str]],
) -> Path:
    config = model.model_dump(mode="json") | {"library": [file.name for file in model.library]}
    write_table(path, pa.concat_tables(tables), stage="model", config=config, inputs=inputs)
    return path
