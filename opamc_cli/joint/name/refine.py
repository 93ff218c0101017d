"""Move an effect's parameters from a guess to where it explains most; a fixed number of trials."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from opamc_cli.joint.effects.base import Parameters
from opamc_cli.joint.fit.model import Dataset, Term
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.name.candidates import Beside

TRIALS_OF_ONE = 7
TRIALS_OF_MORE = 30
"""Parabolas settle a step to a hundredth of it; so does a simplex."""
LOGARITHMIC = 5.0
"""Ratio of a parameter's limits from which on it is refined as a logarithm."""


def refined(dataset: Dataset, term: Term, beside: Beside) -> Term:
    """Refine the searched parameters of a candidate beside a chain."""
    track = dataset.grid_of(beside.fine).track
    limits = {k: v for k, v in term.effect.limits(track).items() if k in term.parameters}
    if not limits:
        return term
    steps = term.effect.first_steps(track, term.parameters)
    names = list(limits)
    logs = [low > 0 and high > LOGARITHMIC * low for low, high in limits.values()]

    def outwards(values: Floats) -> Parameters:
        moved = dict(term.parameters)
        for name, value, log in zip(names, values, logs, strict=True):
            low, high = limits[name]
            moved[name] = float(np.clip(np.exp(value) if log else value, low, high))
        return moved

    def lost(values: Floats) -> float:
        trial = Term(term.effect, outwards(np.atleast_1d(values)), term.keep)
        columns = dataset.computed(trial, beside.fine, beside.refined_rows)
        return -beside.fitted_drop(columns, whole=term.effect.whole)

    start = np.array(
        [
            np.log(max(term.parameters[n], limits[n][0])) if log else term.parameters[n]
            for n, log in zip(names, logs, strict=True)
        ]
    )
    step = np.array(
        [
            np.log1p(steps[n] / max(term.parameters[n], limits[n][0])) if log else steps[n]
            for n, log in zip(names, logs, strict=True)
        ]
    )
    found, least = (_one if len(names) == 1 else _several)(lost, start, step)
    best = found if least < lost(start) else start
    parameters = term.effect.settled(outwards(best), track)
    return Term(term.effect, parameters, term.keep)


def _one(lost: Callable[[Floats], float], start: Floats, step: Floats) -> tuple[Floats, float]:
    bounds = (float(start[0] - step[0]), float(start[0] + step[0]))
    found = minimize_scalar(
        lost, bounds=bounds, method="bounded", options={"maxiter": TRIALS_OF_ONE}
    )
    return np.atleast_1d(found.x), float(found.fun)


def _several(lost: Callable[[Floats], float], start: Floats, step: Floats) -> tuple[Floats, float]:
    simplex = np.vstack(
        [start, *(start + 0.5 * step[i] * np.eye(start.size)[i] for i in range(start.size))]
    )
    options = {"maxfev": TRIALS_OF_MORE, "initial_simplex": simplex}
    found = minimize(lost, start, method="Nelder-Mead", options=options)
    return found.x, float(found.fun)
