"""Stage `evaluate`: runs and a closed model in, evaluation.json out; nothing is estimated."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from opamc_cli.config.joint_model import ClosedConfig, JointModelConfig
from opamc_cli.errors import ConfigError, InputError
from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.explain.declared import BETTER, judged_of
from opamc_cli.joint.fit.frozen import Applied, apply_frozen, may_extrapolate, why_not_applied
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.kinematics import Recording, Smoothing, build_track, smoothings
from opamc_cli.joint.motion.recordings import (
    FEWEST_MOVING_SAMPLES,
    excerpts,
    grouped_track,
    is_moving,
)
from opamc_cli.joint.motion.track import Bools, Floats, Joint, Reference, Track
from opamc_cli.signal.transform.least_squares import leverage
from opamc_cli.stages.model.axes import Outcome, Runs, on_each_axis
from opamc_cli.stages.model.axis_model import (
    declared_effects,
    library_of,
    recordings_of,
    too_little_motion,
)
from opamc_cli.stages.model.declared.terms import declared_term
from opamc_cli.stages.processes.parallel import Watch, unwatched
from opamc_cli.storage.files.atomic import ensure_directory, write_json
from opamc_cli.storage.runs.run import Run
from opamc_cli.storage.schemas import files

FAMILIAR = 10.0
"""Leverage, in means of the recordings that a model was closed on, up to which it knows a sample:
of 53 measured joints those whose error rose eightfold on another program had 83 to 100 % of it
beyond, all others 0 to 75 %; of a robot met later three of four such were beyond
(docs/validation/machines.md)."""
UNTOLD = (
    "axis {}: the model does not tell on what motion it was closed; close it again to hear whether "
    "these runs go beyond it"
)
ROWS = 50_000
"""Samples whose regressors are laid beside each other at once."""


def evaluate(
    model: JointModelConfig,
    paths: Runs,
    axes: Sequence[int],
    out: Path,
    *,
    jobs: int = 1,
    watch: Watch = unwatched,
) -> Outcome:
    """Apply a closed model's frozen coefficients to each axis; writes evaluation.json.

    Parameters
    ----------
    model : JointModelConfig
        As `opamc model close` wrote it.
    paths, axes, out, jobs, watch
        As of `model.fit`.

    Raises
    ------
    ConfigError
        If the model has no coefficients, or not as many as its effects have regressors.
    """
    if model.closed is None:
        msg = "the model has not been closed, it has no coefficients; run `opamc model close` first"
        raise ConfigError(msg)
    own = model.closed.axis
    results, errors, _ = on_each_axis(_on_axis, model, paths, axes, jobs, watch, own)
    ensure_directory(out)
    write_json(out / files.EVALUATION, {"axes": results})
    return Outcome(tuple(results), (out / files.EVALUATION,), tuple(errors))


def _on_axis(model: JointModelConfig, runs: Sequence[Run], axis: int) -> dict[str, Any]:
    closed = model.closed
    assert closed is not None
    effects = declared_effects(model, library_of(model))
    read = recordings_of(runs, axis, closed.opposite_sign)
    recordings, unit = read.recordings, read.unit
    if unit != closed.unit:
        msg = f"{runs[0].path}: is in {unit}, the model was closed in {closed.unit}; give such runs"
        raise InputError(msg)
    joint = Joint(model.joint.ratio_of(axis), model.joint.poles_of(axis))
    track, _ = grouped_track(recordings, joint)
    if not is_moving(track):
        raise too_little_motion(track, axis, str(runs[0].path), FEWEST_MOVING_SAMPLES)
    if any(recording.position_rad is None for recording in recordings):
        # a speed is summed up from wherever the recording begins
        track = replace(track, channels=track.channels - {"logged"})
    smoothing = _best_of(
        smoothings(recordings), excerpts(recordings, track), track, effects, closed
    )
    if smoothing is not None:
        track = replace(build_track(recordings, joint, smoothing), **judged_of(track))
    applied, left_out = _apply(track, effects, closed)
    known = _familiar(applied, effects, closed, {entry["effect"] for entry in left_out})
    return {
        "axis": axis,
        "unit": unit,
        "rmse_a": applied.rmse(),
        "r2": applied.r2(),
        "familiar": None if known is None else _familiar_entry(applied, known),
        "closed": {"axis": closed.axis, "rmse_a": closed.rmse, "r2": closed.r2},
        "runs": [
            {
                "run": recording.name,
                "rmse_a": applied.rmse(_within(applied, place)),
                "r2": applied.r2(_within(applied, place)),
            }
            for place, recording in enumerate(recordings)
        ],
        "opposite_sign": [
            recording.name
            for place, recording in enumerate(recordings)
            if _is_opposed(applied, _within(applied, place))
        ],
        "not_applied": left_out,
        **read.said(),
        "notes": [*read.notes, *([UNTOLD.format(axis)] if known is None else [])],
    }


def _best_of(
    ways: list[Smoothing],
    recordings: list[Recording],
    whole: Track,
    effects: Sequence[tuple[Effect, Any]],
    closed: ClosedConfig,
) -> Smoothing | None:
    """Return the way to differentiate with which the model predicts best, as it was closed.

    None for what the noise asks for.
    """
    first = grouped_track(recordings, whole.joint)[0]
    first = replace(first, channels=whole.channels)
    best, least = None, _apply(first, effects, closed)[0].rmse()
    for smoothing in ways:
        other = replace(build_track(recordings, whole.joint, smoothing), **judged_of(first))
        found = _apply(other, effects, closed)[0].rmse()
        if found**2 < BETTER * least**2:
            best, least = smoothing, found
    return best


def _familiar(
    applied: Applied,
    effects: Sequence[tuple[Effect, Any]],
    closed: ClosedConfig,
    left_out: set[str],
) -> Bools | None:
    """Mark samples that lie where the model was closed; None where its file does not tell.

    Elsewhere regressors that cancelled each other on the model's own recordings may not do so.
    """
    counted = [(effect, entry) for effect, entry in effects if may_extrapolate(effect)]
    widths = [len(entry.coefficients) for _, entry in counted]
    size = sum(widths)
    if closed.regressors is None or [*map(len, closed.regressors)] != list(range(size, 0, -1)):
        return None
    root = np.zeros((size, size))
    root[np.triu_indices(size)] = [value for row in closed.regressors for value in row]
    root = root[:, np.repeat([effect.name not in left_out for effect, _ in counted], widths)]
    terms = [term for term in applied.terms if may_extrapolate(term.effect)]
    known = np.zeros(applied.track.size, dtype=bool)
    rows = np.flatnonzero(applied.judged)
    for some in np.array_split(rows, -(-rows.size // ROWS) or 1):
        columns = [np.zeros((some.size, 0)), *(t.columns(applied.track, some) for t in terms)]
        known[some] = leverage(np.concatenate(columns, axis=1), root) <= FAMILIAR
    return known


def _familiar_entry(applied: Applied, known: Bools) -> dict[str, float | None]:
    share = float(np.mean(known[applied.judged]))
    some = share > 0
    return {
        "share": share,
        "rmse_a": applied.rmse(known) if some else None,
        "r2": applied.r2(known) if some else None,
    }


def _is_opposed(applied: Applied, among: Bools) -> bool:
    """Whether the model explains most of the negative of the current, and less of itself."""
    negative = replace(applied, residual_a=applied.residual_a - 2 * applied.current_a)
    return negative.r2(among) > max(0.5, applied.r2(among))


def _within(applied: Applied, place: int) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Mark the samples of one recording."""
    start, stop = applied.track.bounds[place]
    among = np.zeros(applied.track.size, dtype=bool)
    among[start:stop] = True
    return among


def _apply(
    track: Track, effects: Sequence[tuple[Effect, Any]], closed: ClosedConfig
) -> tuple[Applied, list[dict[str, str]]]:
    track = replace(track, reference=Reference(closed.speed_rad_s, closed.temperature_c))
    terms: list[Term] = []
    coefficients: list[Floats] = []
    left_out = []
    for effect, entry in effects:
        if entry.coefficients is None:
            msg = (
                f"effect {effect.name!r} has no coefficients: it was added by hand; close the "
                "model again, or take the effect out"
            )
            raise ConfigError(msg)
        term = declared_term(effect, entry, track) or Term(effect, {}, entry.columns)
        why = why_not_applied(term, track)
        if why is not None:
            left_out.append({"effect": effect.name, "why": why})
            continue
        needed = term.columns(track).shape[1]
        if needed != len(entry.coefficients):
            msg = (
                f"effect {effect.name!r} has {len(entry.coefficients)} coefficients for {needed} "
                "regressors; close the model again"
            )
            raise ConfigError(msg)
        terms.append(term)
        coefficients.append(np.asarray(entry.coefficients, dtype=np.float64))
    return apply_frozen(track, terms, coefficients), left_out
