"""Stage `model`: runs and a declared model in; fit, candidates, loop and extended model out."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa

from opamc_cli.config.joint_model import JointModelConfig
from opamc_cli.config.yaml.values import yaml_of
from opamc_cli.errors import UsageError
from opamc_cli.joint.explain.saturated import saturated, unnamed_library, with_links
from opamc_cli.joint.fit.intervals import certainty, drag_t
from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.loop import Loop, close_loop, untestable
from opamc_cli.joint.name.chain import chain_of
from opamc_cli.joint.name.search import Pool, trials
from opamc_cli.stages.model.arm import LEAVES_MORE, NOT_FOUND, FoundArm, arm_told, on_axis
from opamc_cli.stages.model.axes import Outcome, Runs, on_each_axis
from opamc_cli.stages.model.axis_model import OPPOSITE, AxisModel, lay
from opamc_cli.stages.model.doubts import DRIVEN_T, INERTIA_T, doubts_of
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
from opamc_cli.storage.files.atomic import ensure_directory, write_json, write_text
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files
from opamc_cli.storage.schemas.tables import CANDIDATES, FIT
from opamc_cli.storage.tables import write_table

Entry = dict[str, Any]
TURNED = (
    "axis {}: {} strokes' current is taken with the opposite sign: beside what was found the "
    "phases lie on the other side of the torque axis than friction and inertia alone tell"
)

CLOSE_FILES = (
    files.LOOP,
    files.MODEL,
    files.CANDIDATES,
    files.FIT,
    files.RESIDUALS,
    files.ORDER_SPECTRUM,
)
"""What closing the loop leaves, beside `model_axis1.yaml` and so on where there are many axes."""


def close_files(folder: Path) -> tuple[str, ...]:
    """Return what a close writes into a folder or removes from it, models of many axes too.

    Raises
    ------
    UsageError
        If a model lies there that no close has written: a user has declared it.
    """
    extended = [path.name for path in folder.glob("model_axis*.yaml")]
    for path in (folder / name for name in (files.MODEL, *extended)):
        if path.is_file() and b"\nclosed:" not in path.read_bytes():
            msg = f"{path}: is no model of a close and would be replaced; choose another --out"
            raise UsageError(msg)
    return (*CLOSE_FILES, *extended)


def fit(
    model: JointModelConfig,
    paths: Runs,
    axes: Sequence[int],
    out: Path,
    *,
    jobs: int = 1,
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
    jobs : int
        Worker processes; 0: one per core, where they are worth their start.
    watch : callable
        Called as axes get done.
    """
    done, errors, inputs = on_each_axis(_fitted, model, paths, axes, jobs, watch)
    rows = [row for _, each in done for row in each]
    written = _write(out / files.FIT, rows, FIT, model, inputs)
    return Outcome(tuple(result for result, _ in done), (written,), tuple(errors))


def _fitted(model: JointModelConfig, runs: Sequence[Run], axis: int) -> tuple[Entry, list[Entry]]:
    laid = lay(model, runs, axis)
    known = certainty(laid.fit)
    return fit_summary(laid, laid.fit, known), fit_rows(axis, laid.fit, known, laid.unit)


def trace(
    model: JointModelConfig,
    paths: Runs,
    axes: Sequence[int],
    out: Path,
    *,
    jobs: int = 1,
    watch: Watch = unwatched,
) -> Outcome:
    """Trace the residual of a declared model on each axis; writes candidates.parquet."""
    done, errors, inputs = on_each_axis(_traced, model, paths, axes, jobs, watch)
    rows = [row for _, each in done for row in each]
    written = _write(out / files.CANDIDATES, rows, CANDIDATES, model, inputs)
    return Outcome(tuple(result for result, _ in done), (written,), tuple(errors))


def _traced(model: JointModelConfig, runs: Sequence[Run], axis: int) -> tuple[Entry, list[Entry]]:
    laid = lay(model, runs, axis)
    base = laid.fit
    start = chain_of(base, 0)
    explained = saturated(start, with_links(Pool.of(base.dataset, unnamed_library())))
    tried = trials(start, Pool.of(base.dataset, laid.library))
    entry = {
        "axis": axis,
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
        **laid.read.said(),
        "untestable": [
            {"effect": name, "why": why} for name, why in untestable(base, laid.library).items()
        ],
    }
    return entry, [candidate_row(axis, 0, trial.told, False) for trial in tried]


@dataclass(frozen=True)
class _Closed:
    """What closing the loop leaves of one axis."""

    entry: Entry
    candidates: list[Entry]
    fit: list[Entry]
    residuals: pa.Table
    spectrum: pa.Table
    extended: Entry


def close(
    model: JointModelConfig,
    paths: Runs,
    axes: Sequence[int],
    out: Path,
    seed: int = 0,
    *,
    jobs: int = 1,
    watch: Watch = unwatched,
) -> Outcome:
    """Close the loop on each axis; writes loop.json, the extended model and the tables.

    Parameters
    ----------
    model, paths, axes, out, jobs, watch
        As of `fit`.
    seed : int
        For the decoys.
    """
    work = partial(_closed, seed, arm_told(model, paths))
    done, errors, inputs = on_each_axis(work, model, paths, axes, jobs, watch)
    ensure_directory(out)
    candidates = [row for each in done for row in each.candidates]
    fits = [row for each in done for row in each.fit]
    written = [
        _write(out / files.CANDIDATES, candidates, CANDIDATES, model, inputs),
        _write(out / files.FIT, fits, FIT, model, inputs),
        _write_tables(out / files.RESIDUALS, [each.residuals for each in done], model, inputs),
        _write_tables(out / files.ORDER_SPECTRUM, [each.spectrum for each in done], model, inputs),
    ]
    for each in done:
        name = files.MODEL if len(done) == 1 else f"model_axis{each.entry['axis']}.yaml"
        text = yaml_of(each.extended, sort_keys=False, default_flow_style=None)
        write_text(out / name, text)
        written.append(out / name)
    entries = tuple(each.entry for each in done)
    write_json(out / files.LOOP, {"axes": entries})
    written.append(out / files.LOOP)
    return Outcome(entries, tuple(written), tuple(errors))


def _drives(closed: Fit) -> bool:
    """Whether friction or inertia of a closed model are surely of the opposite sign."""
    return drag_t(closed) < -DRIVEN_T or _least_t(closed, "inertia") < -INERTIA_T


def _least_t(closed: Fit, name: str) -> float:
    """Least first coefficient of an effect of this name over its error; 0 where there is none."""
    pairs = zip(closed.terms, closed.coefficients, certainty(closed).standard_errors, strict=True)
    found = [float(v[0] / max(e[0], 1e-300)) for term, v, e in pairs if term.effect.name == name]
    return min(found, default=0.0)


def _closed(
    seed: int,
    told: FoundArm | str | None,
    model: JointModelConfig,
    runs: Sequence[Run],
    axis: int,
) -> _Closed:
    declared = model
    model, of_arm = on_axis(declared, told, axis)
    laid, loop = _loop(seed, model, runs, axis)
    if model is not declared and loop.verdict in ("partial", "not-in-library"):
        # Couplings may hold what the arm that was found does not.
        beside, other = _loop(seed, declared, runs, axis)
        if other.after.rmse(sealed=False) < loop.after.rmse(sealed=False):
            model, laid, loop = declared, beside, other
            of_arm = NOT_FOUND.format(axis, LEAVES_MORE)
    if of_arm is not None:
        laid.notes.append(of_arm)
    if laid.ways.strokes_turned:
        laid.notes.append(TURNED.format(axis, laid.ways.strokes_turned))
    sure = certainty(loop.after)
    notes, doubts = doubts_of(laid, loop, sure, runs)
    laid.notes.extend(notes)
    laid.notes.extend(doubts)
    laid.read.doubts.extend(doubts)
    added = {id(step.term) for step in loop.steps}
    return _Closed(
        entry=loop_entry(laid, loop),
        candidates=[
            candidate_row(axis, number, trial, id(trial.term) in added)
            for number, trial in loop.tried
        ],
        fit=fit_rows(axis, loop.after, sure, laid.unit),
        residuals=residual_table(axis, loop),
        spectrum=spectrum_table(axis, loop),
        extended=extended_model(model, laid, loop),
    )


def _loop(
    seed: int, model: JointModelConfig, runs: Sequence[Run], axis: int
) -> tuple[AxisModel, Loop]:
    """Close the loop on an axis, on the negative of its current where that is what was logged."""
    laid = lay(model, runs, axis)
    loop = close_loop(laid.fit, laid.library, seed, ways=laid.ways)
    # What a heavy joint of an arm that moves all of them draws tells its sign only beside what the
    # others ask.
    others = laid.dataset.fine.track.others is not None
    if others and not laid.read.opposite and _drives(loop.after):
        negative = lay(model, runs, axis, opposite=True)
        if negative.read.opposite:  # Of phase currents there is none.
            again = close_loop(negative.fit, negative.library, seed, ways=negative.ways)
            # Or something else than the sign is wrong. What moves in step with the joint may stand
            # in its inertia and viscous friction, but hardly in its dry friction.
            if not _drives(again.after) and _least_t(again.after, "coulomb") >= -DRIVEN_T:
                laid, loop = negative, again
                laid.notes.append(OPPOSITE.format(axis))
    return laid, loop


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
