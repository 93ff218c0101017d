"""Move an effect's parameters from a guess to where it explains most; a fixed number of trials."""

from collections.abc import Callable

import numpy as np

from opamc_cli.joint.effects.base import Parameters
from opamc_cli.joint.fit.model import SETTLED, Term
from opamc_cli.joint.motion.track import Floats
from opamc_cli.joint.name.candidates import Beside

ROUNDS = 4
"""Of three trials of each parameter, a quarter as far apart every time: the last step is a
hundredth of the first one. None after one that takes next to nothing off."""
LOGARITHMIC = 5.0
"""Ratio of a parameter's limits from which on it is refined as a logarithm."""


def refined(term: Term, beside: Beside) -> Term:
    """Refine the searched parameters of a candidate beside a chain."""
    track, given = beside.dataset.grid_of(beside.fine).track, term.parameters.keys()
    limits = {k: v for k, v in term.effect.limits(track).items() if k in term.parameters}
    if not limits:
        return term
    steps = term.effect.first_steps(track, term.parameters)
    names = list(limits)
    # Where a line is shows as well with the fewest filters of a drive's answer.
    alike = (form for form, _ in term.effect.variants(term.parameters) if form.keys() == given)
    sketch = next(alike, term.parameters) if term.effect.fast else term.parameters
    logs = [low > 0 and high > LOGARITHMIC * low for low, high in limits.values()]

    def outwards(values: Floats) -> Parameters:
        moved = dict(term.parameters)
        for name, value, log in zip(names, values, logs, strict=True):
            low, high = limits[name]
            moved[name] = float(np.clip(np.exp(value) if log else value, low, high))
        return moved

    def lost(values: Floats) -> float:
        tried = sketch | {k: value for k, value in outwards(values).items() if k in limits}
        return -beside.candidate(Term(term.effect, tried, term.keep)).gain

    start, step = np.empty((2, len(names)))
    for i, (name, log) in enumerate(zip(names, logs, strict=True)):
        value, first = term.parameters[name], steps[name]
        value = max(value, limits[name][0]) if log else value
        start[i], step[i] = (np.log(value), np.log1p(first / value)) if log else (value, first)
    parameters = term.effect.settled(outwards(_lowest(lost, start, step)), track)
    return Term(term.effect, parameters, term.keep)


def _lowest(lost: Callable[[Floats], float], start: Floats, step: Floats) -> Floats:
    """Go to the vertex of the parabola through a parameter's neighbours, one after the other."""
    best, least = start, lost(start)
    for number in range(ROUNDS):
        before = least
        for side in np.diag(step) / 4**number:
            below, above = lost(best - side), lost(best + side)
            bend = below - 2 * least + above
            shift = 0.5 * (below - above) / bend if bend > 0 else np.sign(below - above)
            vertex = best + np.clip(shift, -1.0, 1.0) * side
            trials = [(below, best - side), (above, best + side), (lost(vertex), vertex)]
            found, place = min(trials, key=lambda trial: trial[0])
            if found < least:
                best, least = place, found
        if 0 < before - least <= SETTLED * abs(least):
            break
    return best
