"""What the model commands write: tables, loop.json's entries, the extended model."""

import json
from collections.abc import Callable, Hashable
from itertools import product
from typing import Any

import numpy as np
import pyarrow as pa

from opamc_cli.config.joint_model import JointModelConfig
from opamc_cli.joint.effects.ripple import meshes, read_order
from opamc_cli.joint.fit.frozen import may_extrapolate
from opamc_cli.joint.fit.intervals import Certainty
from opamc_cli.joint.fit.model import Dataset, Fit, Term, fit_terms
from opamc_cli.joint.loop import Loop, Step
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Tried
from opamc_cli.joint.spectra import highest_order, order_spectrum
from opamc_cli.signal.transform.least_squares import root_of
from opamc_cli.stages.model.axis_model import AxisModel
from opamc_cli.storage.schemas.tables import ORDER_SPECTRUM, RESIDUALS

MOST_RESIDUALS = 20_000
MOST_ORDERS = 4_000
ADVICE = (
    (
        {"thermal_viscous", "warmup", "viscous"},
        "record again with the joint already warm, logging its temperature",
    ),
    (
        {"coulomb", "viscous", "stribeck", "quadratic_friction", "sublinear_friction"},
        "move at more speeds, from a fiftieth of the top speed up to it",
    ),
    (
        {"ripple", "sensor_offset", "sensor_gain", "dead_time"},
        "log all three phases with the position, also while a load is held still at several angles",
    ),
    (
        {"ripple", "mains_hum", "elasticity"},
        "repeat the motion at another speed: what belongs to an angle moves, a line stays",
    ),
    (
        {"inertia", "elasticity", "coupling", "time_delay", "payload_change"},
        "repeat the motion with other accelerations at equal speeds, without a change of tool",
    ),
    (
        {"offset", "asymmetric_friction", "spring", "gravity", "position_drag", "hysteresis"},
        "cover more of the travel, through every place in both directions",
    ),
)
"""Effects that are alike, and what tells them apart."""

POINTS = 40
"""Of a curve: what a plot of some hundred pixels shows."""

WITHIN = "angle within the period"


def _turns(angle_rad: Floats | None) -> Floats | None:
    return None if angle_rad is None else (angle_rad / (2 * np.pi)) % 1


COVARIATES: dict[str, tuple[str, str, bool, Callable[[Track, float], Floats | None]]] = {
    "velocity": ("speed", "rad/s", True, lambda t, _: np.abs(t.velocity)),
    "acceleration": ("acceleration", "rad/s²", False, lambda t, _: t.acceleration),
    "joint-angle": ("joint angle", "rad", True, lambda t, _: t.position_rad),
    "load": ("load", "A", True, lambda t, _: np.abs(t.load_a)),
    "temperature": ("temperature", "°C", True, lambda t, _: t.temperature_c),
    "time": ("time", "s", True, lambda t, _: t.time_s),
    "motor-angle": (WITHIN, "turns", False, lambda t, k: _turns(k * t.machine_angle_rad)),
    "electrical": ("electrical angle", "turns", False, lambda t, _: _turns(t.electrical_rad)),
    "frequency": ("time within the period", "periods", False, lambda t, hz: (hz * t.time_s) % 1),
}
"""Of each domain: name, unit, whether friction resists there, and its values, (n,) or None."""

MEANINGS = {
    "unnamed_response": "a current that goes with the acceleration, its answer or its cause; no "
    "effect of the library has its form",
}
"""Of functions that say too much of themselves: filters of the measured acceleration hold whatever
shakes the joint, too (a belt's tone was called a response)."""


def fit_rows(axis: int, result: Fit, known: Certainty, unit: str) -> list[dict[str, Any]]:
    """Rows of fit.parquet, one per regressor."""
    rows = []
    rmse = result.rmse(sealed=False)
    for term, values, errors in zip(
        result.terms, result.coefficients, known.standard_errors, strict=True
    ):
        units = term.effect.coefficient_units(term.parameters, len(values), unit)
        for k, (value, error) in enumerate(zip(values, errors, strict=True)):
            low, high = _interval(value, error, known)
            rows.append(
                {
                    "axis": axis,
                    "effect": term.effect.name,
                    "parameters": json.dumps(shown_parameters(term), sort_keys=True),
                    "regressor": k,
                    "coefficient": float(value),
                    "unit": units[k],
                    "standard_error": None if low is None else float(error),
                    "low": low,
                    "high": high,
                    "condition_number": known.condition_number,
                    "rmse_a": rmse,
                }
            )
    return rows


def fit_summary(laid: AxisModel, result: Fit, known: Certainty) -> dict[str, Any]:
    """Summarise one axis for the terminal and `--json`."""
    return {
        "axis": laid.axis,
        "unit": laid.unit,
        "groups": _groups_entry(laid.dataset),
        "condition_number": known.condition_number,
        **laid.read.said(),
        "inseparable": [list(names) for names in known.inseparable],
        "rmse_a": result.rmse(sealed=False),
        "terms": [
            {
                "effect": term.effect.name,
                "parameters": shown_parameters(term),
                "coefficients": [float(value) for value in values],
                "units": term.effect.coefficient_units(term.parameters, len(values), laid.unit),
                "low": [_interval(v, e, known)[0] for v, e in zip(values, errors, strict=True)],
                "high": [_interval(v, e, known)[1] for v, e in zip(values, errors, strict=True)],
            }
            for term, values, errors in zip(
                result.terms, result.coefficients, known.standard_errors, strict=True
            )
        ],
    }


def _interval(
    value: float, error: float, known: Certainty
) -> tuple[float, float] | tuple[None, None]:
    """Return the ends of a coefficient's interval; None where the data leave it open."""
    if not np.isfinite(error):
        return None, None
    return float(value - known.factor * error), float(value + known.factor * error)


def _groups_entry(dataset: Dataset) -> dict[str, Any]:
    grouping = dataset.grouping
    return {
        "kind": grouping.kind,
        "fit": [grouping.names[g] for g in grouping.open],
        "sealed": [grouping.names[g] for g in grouping.sealed],
    }


def candidate_row(axis: int, number: int, trial: Tried, added: bool) -> dict[str, Any]:
    """Row of candidates.parquet."""
    term = trial.term
    return {
        "axis": axis,
        "round": number,
        "effect": term.effect.name,
        "domain": term.effect.domain,
        "parameters": json.dumps(shown_parameters(term), sort_keys=True),
        "score": trial.score,
        "p_value": trial.p_value,
        "gain": trial.gain,
        "t_value": trial.t_value,
        "added": added,
        "why_not": trial.why_not,
    }


def shown_parameters(term: Term) -> dict[str, float]:
    """Non-linear parameters, rounded to six digits."""
    return {name: float(f"{value:.6g}") for name, value in term.parameters.items()}


def explained_entry(start: Chain, explained: Chain) -> dict[str, Any]:
    """Say what functions without a name take off the held-out error, and in which domains."""
    share, t_value = explained.gain_over(start)
    return {
        "share": share,
        "t_value": t_value if explained.added else 0.0,
        "domains": [term.effect.domain for term in explained.terms],
    }


def separating_experiment(name: str, ties: tuple[str, ...]) -> str | None:
    """Say what to record to tell an effect from those that tie with it; None where nothing ties."""
    if not ties:
        return None
    for members, advice in ADVICE:
        if name in members and any(tie in members for tie in ties):
            return advice
    return "move over more of the travel, at more speeds and accelerations, in both directions"


def curve_of(fit: Fit, place: int) -> dict[str, Any]:
    """Draw an effect and the residual over the effect's covariate: an object of loop.json.

    In bins of equally many samples: the covariate's mean, the mean of what the effect and the final
    residual hold together, and of what the effect holds. Where friction resists, both are taken
    times the direction.
    """
    dataset = fit.dataset
    grid = dataset.sharp
    term, values = fit.terms[place], fit.coefficients[place]
    rows = np.flatnonzero(grid.fit)
    named = grid.spread(dataset.columns(term, fine=True) @ values)[rows]
    both = named + fit.residual_a[rows]
    name, unit, resists, values_of = COVARIATES[term.effect.domain]
    track = grid.track
    known = values_of(track, next(iter(term.parameters.values()), 0.0))
    over = track.position_rad if known is None else known
    side = track.direction if resists or known is None else np.ones(track.size)
    name, over, side = term.effect.drawn_over(track) or (name, over, side)
    over, side = over[rows], side[rows]
    order = np.argsort(over, kind="stable")
    bins = [piece for piece in np.array_split(order, POINTS) if piece.size]
    drawn = {"x": over, "residual_a": side * both, "named_a": side * named}
    return {
        "covariate": name,
        "unit": unit,
        **{key: [values[piece].mean() for piece in bins] for key, values in drawn.items()},
    }


def order_ties(order: float, track: Track) -> list[str]:
    """Names of the known lines within the order resolution of an order, but that it is read as.

    None where orders, as found per revolution of the track's machine angle, have no meaning.
    """
    ratio = track.joint.gear_ratio
    if track.angle_kind != "motor" or not ratio or not meshes(ratio):
        return []
    lines = [(float(k), f"kinematic error (order {k})") for k in (2, 4)]
    for (formula, teeth), k in product(meshes(ratio), (1, 2, 3)):
        line = 2 * teeth / ratio * k
        lines.append((line, f"flexspline tooth damage ({formula}, order {line:.4g})"))
    close = [line for line in lines if abs(line[0] - order) < track.order_resolution]
    generator = read_order(order, track).kind == "generator"
    close.sort(key=lambda line: (generator and "tooth" in line[1], abs(line[0] - order)))
    return [name for _, name in close[1:]]


def step_entry(step: Step, loop: Loop, track: Track) -> dict[str, Any]:
    """One entry of `steps`; ripples whose orders the travel cannot tell apart are tied."""
    place = [term is step.term for term in loop.after.terms].index(True)
    order = step.term.parameters.get("order")
    ties = list(step.ties)
    if order is not None:
        ties += order_ties(order, track)
        for other in loop.steps:
            near = other.term.parameters.get("order")
            if other is not step and near and abs(near - order) < track.order_resolution:
                ties.append(f"ripple of order {near:.5g}")
    return {
        "effect": step.term.effect.name,
        "domain": step.term.effect.domain,
        "parameters": shown_parameters(step.term),
        "interpretation": MEANINGS.get(step.term.effect.name, step.interpretation),
        "gain": step.trial.gain,
        "t_value": step.trial.t_value,
        "p_value": step.trial.p_value,
        "decoy_gain": step.decoy_gain,
        "ties": ties,
        "separating_experiment": separating_experiment(step.term.effect.name, step.ties),
        "fit_of_name": step.fit_of_name,
        "approximate": step.approximate,
        "rmse_before_a": step.rmse_before_a,
        "rmse_after_a": step.rmse_after_a,
        "curve": {
            key: said if isinstance(said, str) else [float(f"{value:.6g}") for value in said]
            for key, said in curve_of(loop.after, place).items()
        },
    }


def loop_entry(laid: AxisModel, loop: Loop) -> dict[str, Any]:
    """One axis's object in loop.json."""
    grouping = laid.dataset.grouping
    return {
        "axis": laid.axis,
        "unit": laid.unit,
        "declared": [effect.name for effect, _ in laid.declared],
        "sealed": [grouping.names[g] for g in grouping.sealed],
        "before": {
            "rmse_a": loop.rmse_before_a,
            "r2": loop.r2_before,
            "as_logged_a": _as_logged(loop.before),
        },
        "steps": [step_entry(step, loop, laid.dataset.fine.track) for step in loop.steps],
        "after": {
            "rmse_a": loop.rmse_after_a,
            "r2": loop.r2_after,
            "searched_rmse_a": loop.after.rmse(sealed=False),
            "as_logged_a": _as_logged(loop.after),
        },
        "floor_a": loop.floor_a,
        "noise_a": loop.noise_a,
        "explained_share": loop.explained_share,
        "rejected": [
            {
                "effect": rejected.term.effect.name,
                "domain": rejected.term.effect.domain,
                "parameters": rejected.term.parameters,
                "gain": rejected.gain,
                "p_value": rejected.p_value,
                "why": rejected.why_not,
            }
            for rejected in loop.rejected
        ],
        "unconfirmed": [*loop.unconfirmed],
        "untestable": [{"effect": name, "why": why} for name, why in loop.untestable.items()],
        "verdict": loop.verdict,
        "domain": loop.remaining_domain,
        "remains": [
            {
                "domain": step.term.effect.domain,
                "gain": step.trial.gain,
                "t_value": step.trial.t_value,
            }
            for step in loop.steps
            if not step.named
        ],
        "ceiling": {
            "share": loop.ceiling.share,
            "standard_error": loop.ceiling.standard_error,
        },
        "groups": grouping.kind,
        "orders": _orders(loop.after.dataset.fine.track),
        "fails": _failure(loop),
        **laid.read.said(),
    }


def _as_logged(fit: Fit) -> float:
    """Root mean square of the sealed residual sample by sample, beside corners, too."""
    grid = fit.opened.dataset.fine
    return float(np.sqrt(np.mean(fit.opened.residual_a[grid.sealed] ** 2)))


def _orders(track: Track) -> str:
    """Say what the recordings can tell of orders."""
    return (
        f"orders count per {track.angle_kind} revolution; orders closer than "
        f"{track.order_resolution:.3g} cannot be told apart, and above "
        f"{highest_order(track):.4g} they fold at the median speed"
    )


def _failure(loop: Loop) -> str | None:
    """Say why the extended model is no model of the sealed data; None where it is one."""
    if loop.predicts:
        return None
    if loop.r2_after <= 0:
        return (
            f"the model predicts sealed data no better than their mean (r2 {loop.r2_after:.2g}): "
            "check gear ratio, pole pairs, units and phases, or record more speeds and both ways"
        )
    times = loop.rmse_after_a / max(loop.after.rmse(sealed=False), 1e-300)
    return f"the sealed part's error is {times:.1f} times that of the rest: the fit fails there"


def extended_model(model: JointModelConfig, laid: AxisModel, loop: Loop) -> dict[str, Any]:
    """Write the extended model as a mapping, with its coefficients."""
    after = loop.after
    elsewhere = _elsewhere(after)
    effects: list[Any] = []
    for term, fitted in zip(after.terms, after.coefficients, strict=True):
        values = elsewhere.get(term.key, fitted)
        entry: dict[str, Any] = {"effect": term.effect.name}
        if term.parameters or term.keep is not None:
            entry["parameters"] = shown_parameters(term)
        if term.keep is not None:
            entry["columns"] = list(term.keep)
        entry["coefficients"] = [float(f"{value:.9g}") for value in values]
        effects.append(entry)
    counted = [may_extrapolate(term.effect) for term in after.terms]
    of = np.repeat(counted, [values.size for values in after.coefficients])
    sums = after.sums
    root = root_of(sums.gram.sum(axis=0)[np.ix_(of, of)] / sums.parts.counts.sum())
    track = after.dataset.fine.track
    warm = track.temperature_c is not None
    return {
        "joint": {
            "gear_ratio": model.joint.ratio_of(laid.axis),
            "pole_pairs": model.joint.poles_of(laid.axis),
        },
        "effects": effects,
        **({} if model.arm is None else {"arm": model.arm.model_dump(mode="json")}),
        "library": [str(path) for path in model.library],
        "without": list(model.without),
        "closed": {
            "axis": laid.axis,
            "unit": laid.unit,
            "rmse": float(f"{loop.rmse_after_a:.6g}"),
            "r2": float(f"{loop.r2_after:.6g}"),
            "speed_rad_s": float(track.speed_scale),
            "temperature_c": track.middle_temperature_c if warm else None,
            "opposite_sign": laid.read.opposite,
            "regressors": [
                [float(f"{value:.6g}") for value in row[place:]] for place, row in enumerate(root)
            ],
        },
    }


def _elsewhere(after: Fit) -> dict[Hashable, Floats]:
    """Return coefficients as they are without functions that other recordings have to do without.

    Beside these they may be anything: friction by the angle and its direction is dry friction, too.
    """
    kept = [t for t in after.terms if not (t.effect.unnamed and t.effect.of_its_recordings)]
    if len(kept) == len(after.terms):
        return {}
    alone = fit_terms(after.dataset, tuple(kept))
    return {term.key: one for term, one in zip(kept, alone.coefficients, strict=True)}


def residual_table(axis: int, loop: Loop) -> pa.Table:
    """Sealed residuals before and after, at most 20 000 rows."""
    before, after = loop.before.opened, loop.after.opened
    grid = after.dataset.fine
    rows = np.flatnonzero(grid.sealed)
    rows = rows[:: max(-(-rows.size // MOST_RESIDUALS), 1)]
    track = grid.track
    columns: dict[str, Floats] = {
        "time_s": track.time_s[rows],
        "position_rad": track.position_rad[rows],
        "velocity_rad_s": track.velocity[rows],
        "residual_before_a": before.residual_a[rows],
        "residual_after_a": after.residual_a[rows],
    }
    axes = pa.array(np.full(rows.size, axis), pa.int16())
    return pa.table([axes, *(pa.array(values) for values in columns.values())], schema=RESIDUALS)


def spectrum_table(axis: int, loop: Loop) -> pa.Table:
    """Order spectrum of the open residual, before and after, at most 4 000 rows."""
    grid = loop.after.dataset.fine
    amplitudes = []
    orders = np.empty(0)
    for result in (loop.before, loop.after):
        residual = np.where(grid.fit, result.residual_a, 0.0)
        orders, power = order_spectrum(grid.track, residual)
        # Power counts in units of white noise: n/4 of it per class is a sine of this amplitude.
        level = float(np.mean(residual[grid.fit] ** 2))
        samples = max(int(grid.fit.sum()), 1)
        amplitudes.append(2 * np.sqrt(power * level / samples))
    block = max(-(-orders.size // MOST_ORDERS), 1)
    usable = orders.size // block * block
    if usable == 0:
        return ORDER_SPECTRUM.empty_table()
    peaks = [values[:usable].reshape(-1, block).max(axis=1) for values in amplitudes]
    middle = orders[:usable].reshape(-1, block).mean(axis=1)
    return pa.table(
        [
            pa.array(np.full(middle.size, axis), pa.int16()),
            pa.array(middle),
            pa.array(peaks[0]),
            pa.array(peaks[1]),
        ],
        schema=ORDER_SPECTRUM,
    )
