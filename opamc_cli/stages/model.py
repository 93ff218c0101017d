"""Stage `model`: runs and a declared model in; fit, candidates, loop and extended model out."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import yaml

from opamc_cli.config.joint_model import DeclaredEffect, JointModelConfig
from opamc_cli.errors import ConfigError, InputError, NotEnoughDataError, OpamcError
from opamc_cli.joint.domains import Ceiling, Structure, ceiling, structures
from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.library import (
    Library,
    built_in_library,
    effect_named,
    load_user_effects,
)
from opamc_cli.joint.intervals import Certainty, certainty
from opamc_cli.joint.kinematics import Recording
from opamc_cli.joint.loop import Loop, close_loop, declared_fit, find_candidates
from opamc_cli.joint.model import Fit, Session, Term, open_session
from opamc_cli.joint.recordings import grouped_track, is_moving
from opamc_cli.joint.spectra import order_spectrum
from opamc_cli.joint.trace import Candidate
from opamc_cli.joint.track import Floats, Joint
from opamc_cli.stages.declared_terms import declared_term
from opamc_cli.storage.atomic import atomic_path, ensure_directory
from opamc_cli.storage.runs import Array, Run
from opamc_cli.storage.tables import write_table

FIT_NAME = "fit.parquet"
CANDIDATES_NAME = "candidates.parquet"
LOOP_NAME = "loop.json"
MODEL_NAME = "model.yaml"
RESIDUALS_NAME = "residuals.parquet"
SPECTRUM_NAME = "order_spectrum.parquet"

MOST_RESIDUALS = 20_000
MOST_ORDERS = 4_000

FIT = pa.schema(
    [
        ("axis", pa.int16()),
        ("effect", pa.string()),
        ("parameters", pa.string()),
        ("regressor", pa.int16()),
        ("coefficient", pa.float64()),
        ("standard_error", pa.float64()),
        ("low", pa.float64()),
        ("high", pa.float64()),
        ("condition_number", pa.float64()),
        ("rmse_a", pa.float64()),
    ]
)
CANDIDATES = pa.schema(
    [
        ("axis", pa.int16()),
        ("round", pa.int16()),
        ("effect", pa.string()),
        ("domain", pa.string()),
        ("parameters", pa.string()),
        ("likelihood", pa.float64()),
        ("score", pa.float64()),
        ("p_value", pa.float64()),
        ("gain", pa.float64()),
        ("decoy_gain", pa.float64()),
        ("t_value", pa.float64()),
        ("consistency", pa.float64()),
        ("added", pa.bool_()),
        ("why_not", pa.string()),
    ]
)
RESIDUALS = pa.schema(
    [
        ("axis", pa.int16()),
        ("time_s", pa.float64()),
        ("position_rad", pa.float64()),
        ("velocity_rad_s", pa.float64()),
        ("residual_before_a", pa.float64()),
        ("residual_after_a", pa.float64()),
    ]
)
SPECTRUM = pa.schema(
    [
        ("axis", pa.int16()),
        ("order", pa.float64()),
        ("before_a", pa.float64()),
        ("after_a", pa.float64()),
    ]
)


@dataclass(frozen=True)
class AxisModel:
    """A declared model laid on one axis's recordings.

    Attributes
    ----------
    axis : int
        Counted from 1.
    session : Session
        Recordings, groups, sealed ones.
    declared : tuple of Term
        Model as declared; parameters that were not given are still open.
    library : Library
        Effects that may be added.
    """

    axis: int
    session: Session
    declared: tuple[tuple[Effect, DeclaredEffect], ...]
    library: Library


@dataclass(frozen=True)
class Outcome:
    """What a model command did, and what could not be done."""

    results: tuple[dict[str, Any], ...]
    written: tuple[Path, ...]
    errors: tuple[OpamcError, ...]


def library_of(model: JointModelConfig) -> Library:
    """Return the library with the user's effects, without those that the model excludes.

    Raises
    ------
    ConfigError
        If a file defines no effect, or a name is unknown.
    """
    library = built_in_library()
    for path in model.library:
        for effect in load_user_effects(path):
            library[effect.name] = effect
    for name in model.without:
        effect_named(library, name)
    return library


def axes_of(runs: Sequence[Run]) -> list[int]:
    """Axes that every run holds."""
    common = set(runs[0].axes)
    for run in runs[1:]:
        common &= set(run.axes)
    return sorted(common)


def read_recording(run: Run, axis: int, stop: int | None = None) -> Recording:
    """Read one axis of a run, up to sample `stop` (half-open) if that is given.

    Raises
    ------
    InputError
        If the run has no such axis, or neither a signed current nor three phases.
    """
    channels = run.channels(axis)
    run.check_time()
    three = len(channels.phases) == 3
    if channels.current is None and not three:
        msg = (
            f"{run.path}: axis {axis} has {len(channels.phases)} phase current(s) and no "
            f"axis{axis}_current; a model needs the signed current or all three phases"
        )
        raise InputError(msg)
    if not three and channels.position is None and channels.velocity is None:
        msg = (
            f"{run.path}: axis {axis} has no axis{axis}_position, no axis{axis}_velocity and not "
            "three phases; log one of them, a model needs the motion"
        )
        raise InputError(msg)
    named = {
        "current": None if three else channels.current,
        "position": channels.position,
        "velocity": channels.velocity,
        "temperature": channels.temperature,
    }
    wanted = [name for name in named.values() if name] + list(channels.phases if three else ())
    samples = run.read(wanted, 0, stop)
    arrays = {
        key: None if name is None else np.asarray(samples[name], dtype=np.float64)
        for key, name in named.items()
    }
    phases = None
    if three:
        phases = np.stack(
            [np.asarray(samples[name], dtype=np.float64) for name in channels.phases], axis=1
        )
    for channel, values in samples.items():
        _check_channel(run, channel, values)
    return Recording(
        name=run.name,
        rate_hz=run.sampling_rate_hz,
        current_a=arrays["current"],
        phases_a=phases,
        position_rad=arrays["position"],
        velocity_rad_s=arrays["velocity"],
        temperature_c=arrays["temperature"],
        started_s=_seconds(run),
    )


def _check_channel(run: Run, name: str, values: Array) -> None:
    known = np.isfinite(values)
    if not known.any():
        msg = f"{run.path}: column {name} holds no number; check the sensor or leave the column out"
        raise InputError(msg)
    is_current = not name.endswith(("position", "velocity", "temperature"))
    if is_current and np.ptp(values[known]) == 0:
        msg = (
            f"{run.path}: column {name} is constant at {float(values[known][0]):g} A in all "
            f"{len(values)} samples; check the sensor"
        )
        raise InputError(msg)


def _seconds(run: Run) -> float | None:
    if run.info.started_at is None:
        return None
    try:
        return datetime.fromisoformat(run.info.started_at).timestamp()
    except ValueError as error:
        msg = (
            f"{run.path}: started_at is {run.info.started_at!r}, an ISO 8601 time is needed; "
            "correct it or leave it out"
        )
        raise InputError(msg) from error


def lay(model: JointModelConfig, runs: Sequence[Run], axis: int) -> AxisModel:
    """Lay a declared model on one axis of some runs.

    Raises
    ------
    ConfigError
        If an effect is unknown, or needs what the runs do not have.
    InputError
        If rates differ or a channel is missing.
    NotEnoughDataError
        If the axis does not move, or too little to seal anything off.
    """
    library = library_of(model)
    declared = tuple((effect_named(library, d.effect), d) for d in model.declared())
    recordings = [read_recording(run, axis) for run in runs]
    rates = {recording.rate_hz for recording in recordings}
    if len(rates) > 1:
        msg = (
            f"{runs[0].path}: the runs have different rates "
            f"({', '.join(f'{rate:g}' for rate in sorted(rates))} Hz); give runs of one rate"
        )
        raise InputError(msg)
    if all(recording.started_s is not None for recording in recordings):
        recordings.sort(key=lambda recording: recording.started_s or 0.0)
    for recording, run in zip(recordings, runs, strict=True):
        if recording.size < 64:
            msg = f"{run.path}: {recording.size} samples of axis {axis}; record at least one cycle"
            raise NotEnoughDataError(msg)
    track, grouping = grouped_track(
        recordings, Joint(model.joint.gear_ratio, model.joint.pole_pairs)
    )
    named = ", ".join(str(run.path) for run in runs[:3]) + (", ..." if len(runs) > 3 else "")
    if not is_moving(track):
        msg = (
            f"{named}: axis {axis} does not move (travel {np.ptp(track.position_rad):.2g} rad); "
            "give runs in which it does"
        )
        raise NotEnoughDataError(msg)
    if grouping is None:
        moving = np.count_nonzero(track.moving) / track.rate_hz
        msg = (
            f"{named}: axis {axis} moves for {moving:.2g} s in all, too little to seal a part off; "
            "record at least two cycles, or 3 s of motion"
        )
        raise NotEnoughDataError(msg)
    session = open_session(track, grouping)
    for effect, _ in declared:
        why = None if effect.name == "load_friction" else effect.untestable(session.fine.track)
        if why is not None:
            msg = (
                f"Effect {effect.name!r} is declared, but axis {axis} of {named} cannot show it: "
                f"{why}; log the channel or drop the effect from the model"
            )
            raise ConfigError(msg)
    allowed = {name: effect for name, effect in library.items() if name not in model.without}
    return AxisModel(axis, session, declared, allowed)


def fitted(laid: AxisModel) -> Fit:
    """Fit the declared model; parameters that were not given are searched."""
    track = laid.session.coarse.track
    return declared_fit(
        laid.session,
        tuple((effect, declared_term(effect, entry, track)) for effect, entry in laid.declared),
    )


def fit(
    model: JointModelConfig, paths: Sequence[tuple[str, Path]], axes: Sequence[int], out: Path
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
    """
    rows: list[dict[str, Any]] = []

    def one(laid: AxisModel) -> dict[str, Any]:
        result = fitted(laid)
        known = certainty(result)
        rows.extend(_fit_rows(laid.axis, result, known))
        return _fit_summary(laid, result, known)

    results, errors, inputs = _each_axis(model, paths, axes, one)
    written = [_write(out / FIT_NAME, rows, FIT, model, inputs)] if results else []
    return Outcome(tuple(results), tuple(written), tuple(errors))


def trace(
    model: JointModelConfig, paths: Sequence[tuple[str, Path]], axes: Sequence[int], out: Path
) -> Outcome:
    """Trace the residual of a declared model on each axis; writes candidates.parquet."""
    rows: list[dict[str, Any]] = []

    def one(laid: AxisModel) -> dict[str, Any]:
        base = fitted(laid)
        seen = structures(base)
        found, untestable = find_candidates(base, laid.library)
        rows.extend(_candidate_row(laid.axis, 0, candidate, False) for candidate in found)
        return {
            "axis": laid.axis,
            "declared": [term.effect.name for term in base.terms],
            "domains": [_structure_entry(structure) for structure in seen],
            "ceiling": _ceiling_entry(ceiling(base, seen)),
            "candidates": [
                {
                    "effect": candidate.term.effect.name,
                    "domain": candidate.term.effect.domain,
                    "parameters": _shown(candidate.term),
                    "gain": candidate.gain,
                    "p_value": candidate.p_value,
                    "why_not": candidate.why_not,
                }
                for candidate in found
            ],
            "untestable": [{"effect": u.effect, "why": u.why} for u in untestable],
        }

    results, errors, inputs = _each_axis(model, paths, axes, one)
    written = [_write(out / CANDIDATES_NAME, rows, CANDIDATES, model, inputs)] if results else []
    return Outcome(tuple(results), tuple(written), tuple(errors))


def close(
    model: JointModelConfig,
    paths: Sequence[tuple[str, Path]],
    axes: Sequence[int],
    out: Path,
    seed: int = 0,
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
    """
    candidates: list[dict[str, Any]] = []
    fits: list[dict[str, Any]] = []
    residuals: list[pa.Table] = []
    spectra: list[pa.Table] = []
    extended: dict[int, dict[str, Any]] = {}

    def one(laid: AxisModel) -> dict[str, Any]:
        loop = close_loop(fitted(laid), laid.library, seed)
        added = {id(step.term) for step in loop.steps}
        candidates.extend(
            _candidate_row(laid.axis, number, candidate, id(candidate.term) in added)
            for number, candidate in loop.candidates
        )
        fits.extend(_fit_rows(laid.axis, loop.after, certainty(loop.after)))
        residuals.append(_residual_table(laid.axis, loop))
        spectra.append(_spectrum_table(laid.axis, loop))
        extended[laid.axis] = _extended(model, loop.after)
        return _loop_entry(laid, loop)

    results, errors, inputs = _each_axis(model, paths, axes, one)
    if not results:
        return Outcome((), (), tuple(errors))
    ensure_directory(out)
    written = [
        _write(out / CANDIDATES_NAME, candidates, CANDIDATES, model, inputs),
        _write(out / FIT_NAME, fits, FIT, model, inputs),
        _write_tables(out / RESIDUALS_NAME, residuals, model, inputs),
        _write_tables(out / SPECTRUM_NAME, spectra, model, inputs),
    ]
    for axis, values in extended.items():
        name = MODEL_NAME if len(extended) == 1 else f"model_axis{axis}.yaml"
        with atomic_path(out / name) as temporary:
            temporary.write_text(
                yaml.safe_dump(values, sort_keys=False, default_flow_style=None), encoding="utf-8"
            )
        written.append(out / name)
    with atomic_path(out / LOOP_NAME) as temporary:
        text = json.dumps({"axes": results}, indent=2, allow_nan=False, ensure_ascii=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    written.append(out / LOOP_NAME)
    return Outcome(tuple(results), tuple(written), tuple(errors))


def _each_axis(
    model: JointModelConfig,
    paths: Sequence[tuple[str, Path]],
    axes: Sequence[int],
    one: Any,
) -> tuple[list[dict[str, Any]], list[OpamcError], list[tuple[Path, str]]]:
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
        for axis in wanted:
            try:
                results.append(one(lay(model, runs, axis)))
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


def _fit_rows(axis: int, result: Fit, known: Certainty) -> list[dict[str, Any]]:
    rows = []
    rmse = result.rmse(sealed=False)
    for term, values, errors in zip(
        result.terms, result.coefficients, known.standard_errors, strict=True
    ):
        for k, (value, error) in enumerate(zip(values, errors, strict=True)):
            rows.append(
                {
                    "axis": axis,
                    "effect": term.effect.name,
                    "parameters": json.dumps(_shown(term), sort_keys=True),
                    "regressor": k,
                    "coefficient": float(value),
                    "standard_error": float(error),
                    "low": float(value - known.factor * error),
                    "high": float(value + known.factor * error),
                    "condition_number": known.condition_number,
                    "rmse_a": rmse,
                }
            )
    return rows


def _fit_summary(laid: AxisModel, result: Fit, known: Certainty) -> dict[str, Any]:
    return {
        "axis": laid.axis,
        "groups": _groups_entry(laid.session),
        "condition_number": known.condition_number,
        "inseparable": [list(names) for names in known.inseparable],
        "rmse_a": result.rmse(sealed=False),
        "terms": [
            {
                "effect": term.effect.name,
                "parameters": _shown(term),
                "coefficients": [float(value) for value in values],
                "low": [float(v - known.factor * e) for v, e in zip(values, errors, strict=True)],
                "high": [float(v + known.factor * e) for v, e in zip(values, errors, strict=True)],
            }
            for term, values, errors in zip(
                result.terms, result.coefficients, known.standard_errors, strict=True
            )
        ],
    }


def _groups_entry(session: Session) -> dict[str, Any]:
    grouping = session.grouping
    return {
        "kind": grouping.kind,
        "fit": [grouping.names[g] for g in session.fit_groups],
        "sealed": [grouping.names[g] for g in grouping.sealed],
    }


def _candidate_row(axis: int, number: int, candidate: Candidate, added: bool) -> dict[str, Any]:
    term = candidate.term
    return {
        "axis": axis,
        "round": number,
        "effect": term.effect.name,
        "domain": term.effect.domain,
        "parameters": json.dumps(_shown(term), sort_keys=True),
        "likelihood": candidate.likelihood,
        "score": candidate.score,
        "p_value": candidate.p_value,
        "gain": candidate.gain,
        "decoy_gain": candidate.decoy_gain,
        "t_value": candidate.t_value,
        "consistency": candidate.consistency,
        "added": added,
        "why_not": candidate.why_not,
    }


def _shown(term: Term) -> dict[str, float]:
    return {name: float(f"{value:.6g}") for name, value in term.parameters.items()}


def _structure_entry(structure: Structure) -> dict[str, Any]:
    return {
        "domain": structure.domain,
        "gain": structure.gain,
        "t_value": structure.t_value,
    }


def _ceiling_entry(found: Ceiling) -> dict[str, Any]:
    return {"share": found.share, "t_value": found.t_value, "how": found.how}


def _loop_entry(laid: AxisModel, loop: Loop) -> dict[str, Any]:
    grouping = laid.session.grouping
    return {
        "axis": laid.axis,
        "declared": [effect.name for effect, _ in laid.declared],
        "sealed": [grouping.names[g] for g in grouping.sealed],
        "before": {"rmse_a": loop.rmse_before_a, "r2": loop.r2_before},
        "steps": [
            {
                "effect": step.term.effect.name,
                "domain": step.term.effect.domain,
                "parameters": _shown(step.term),
                "interpretation": step.interpretation,
                "gain": step.gain,
                "p_value": step.p_value,
                "decoy_gain": step.decoy_gain,
                "ties": list(step.ties),
                "separating_experiment": step.experiment,
                "rmse_before_a": step.rmse_before_a,
                "rmse_after_a": step.rmse_after_a,
            }
            for step in loop.steps
        ],
        "after": {"rmse_a": loop.rmse_after_a, "r2": loop.r2_after},
        "floor_a": loop.floor_a,
        "explained_share": loop.explained_share,
        "rejected": [
            {
                "effect": rejected.effect,
                "domain": rejected.domain,
                "parameters": rejected.parameters,
                "gain": rejected.gain,
                "p_value": rejected.p_value,
                "why": rejected.why,
            }
            for rejected in loop.rejected
        ],
        "untestable": [{"effect": u.effect, "why": u.why} for u in loop.untestable],
        "verdict": loop.verdict,
        "domain": loop.remaining_domain,
        "remains": [_structure_entry(structure) for structure in loop.remains],
        "ceiling": {
            "before": _ceiling_entry(loop.ceiling_before),
            "after": _ceiling_entry(loop.ceiling_after),
        },
        "groups": grouping.kind,
        "orders": loop.orders_note,
    }


def _extended(model: JointModelConfig, after: Fit) -> dict[str, Any]:
    effects: list[Any] = []
    for term in after.terms:
        if term.parameters or term.keep is not None:
            entry: dict[str, Any] = {"effect": term.effect.name, "parameters": _shown(term)}
            if term.keep is not None:
                entry["columns"] = list(term.keep)
            effects.append(entry)
        else:
            effects.append(term.effect.name)
    return {
        "joint": {"gear_ratio": model.joint.gear_ratio, "pole_pairs": model.joint.pole_pairs},
        "effects": effects,
        "library": [str(path) for path in model.library],
        "without": list(model.without),
    }


def _residual_table(axis: int, loop: Loop) -> pa.Table:
    grid = loop.after.session.fine
    rows = np.flatnonzero(grid.sealed)
    rows = rows[:: max(-(-rows.size // MOST_RESIDUALS), 1)]
    track = grid.track
    columns: dict[str, Floats] = {
        "time_s": track.time_s[rows],
        "position_rad": track.position_rad[rows],
        "velocity_rad_s": track.velocity[rows],
        "residual_before_a": loop.before.residual_a[rows],
        "residual_after_a": loop.after.residual_a[rows],
    }
    axes = pa.array(np.full(rows.size, axis), pa.int16())
    return pa.table([axes, *(pa.array(values) for values in columns.values())], schema=RESIDUALS)


def _spectrum_table(axis: int, loop: Loop) -> pa.Table:
    grid = loop.after.session.fine
    amplitudes = []
    orders = np.empty(0)
    for result in (loop.before, loop.after):
        residual = np.where(grid.fit, result.residual_a, 0.0)
        orders, power, _classes = order_spectrum(grid.track, residual)
        # Power counts in units of white noise: n/4 of it per class is a sine of this amplitude.
        level = float(np.mean(residual[grid.fit] ** 2))
        samples = max(int(grid.fit.sum()), 1)
        amplitudes.append(2 * np.sqrt(power * level / samples))
    block = max(-(-orders.size // MOST_ORDERS), 1)
    usable = orders.size // block * block
    if usable == 0:
        return SPECTRUM.empty_table()
    peaks = [values[:usable].reshape(-1, block).max(axis=1) for values in amplitudes]
    middle = orders[:usable].reshape(-1, block).mean(axis=1)
    return pa.table(
        [
            pa.array(np.full(middle.size, axis), pa.int16()),
            pa.array(middle),
            pa.array(peaks[0]),
            pa.array(peaks[1]),
        ],
        schema=SPECTRUM,
    )
