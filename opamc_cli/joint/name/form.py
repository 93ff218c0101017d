"""How much of its domain's curve an effect's form holds, and the curve beside it."""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.fit.model import Fit, Term
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Pool, trials
from opamc_cli.joint.name.significance import LEAST_T

APPROXIMATE = 0.5
"""Share of its domain's curve that a form holds, from which on it has the name approximately (from
`EXACT` on without that word); below, the curve has none."""
POINTS = 40
"""Of a curve: what a plot of some hundred pixels shows."""

COVARIATES = {
    "velocity": ("speed", "rad/s"),
    "acceleration": ("acceleration", "rad/s²"),
    "joint-angle": ("joint angle", "rad"),
    "load": ("load", "A"),
    "temperature": ("temperature", "°C"),
    "time": ("time", "s"),
    "motor-angle": ("angle within the period", "turns"),
    "electrical": ("electrical angle", "turns"),
    "frequency": ("time within the period", "periods"),
}


@dataclass(frozen=True)
class Curve:
    """A partial residual over its own covariate."""

    covariate: str
    unit: str
    """With `covariate`: what it is drawn over."""
    x: Floats
    residual_a: Floats
    named_a: Floats
    """With `x`, `residual_a`: bins of equally many samples: the covariate's mean, the mean of what
    the effect and the final residual hold together, and of what the effect holds. Where friction
    resists, both are taken times the direction; s of shape (k,)."""


def share_of_form(best: Chain, drop: float, term: Term, unnamed: Pool) -> float:
    """Share of its domain's curve that the form of an effect of the best chain holds.

    It takes `drop` off the held-out mean square error, in A^2; 1 where no function of the domain
    explains more beside it.
    """
    if term.effect.fast:
        # A line's forms are all that a line can have.
        return 1.0
    library = {
        name: effect
        for name, effect in unnamed.library.items()
        if effect.domain == term.effect.domain and not effect.fast
    }
    more = 0.0
    for trial in trials(best, replace(unnamed, library=library, least_share=0.0)):
        gained = best.mean_square - trial.chain.mean_square
        if trial.t_value > LEAST_T and trial.chain.score < best.score:
            more = max(more, gained)
    return max(drop, 0.0) / max(drop + more, 1e-300)


def curve_of(fit: Fit, place: int) -> Curve:
    """Draw an effect and the residual over the effect's covariate."""
    dataset = fit.dataset
    grid = dataset.sharp
    term, values = fit.terms[place], fit.coefficients[place]
    rows = np.flatnonzero(grid.fit)
    named = (dataset.columns(term, fine=True) @ values)[rows]
    both = named + fit.residual_a[rows]
    over, side = _covariate(grid.track, term)
    over, side = over[rows], side[rows]
    order = np.argsort(over, kind="stable")
    bins = [piece for piece in np.array_split(order, POINTS) if piece.size]
    name, unit = COVARIATES[term.effect.domain]
    return Curve(
        name,
        unit,
        np.array([over[piece].mean() for piece in bins]),
        np.array([(side * both)[piece].mean() for piece in bins]),
        np.array([(side * named)[piece].mean() for piece in bins]),
    )


def _covariate(track: Track, term: Term) -> tuple[Floats, Floats]:
    one = np.ones(track.size)
    turn = 2 * np.pi
    domain = term.effect.domain
    if domain == "velocity":
        return np.abs(track.velocity), track.direction
    if domain == "acceleration":
        return track.acceleration, one
    if domain == "load":
        return np.abs(track.load_a), track.direction
    if domain == "temperature" and track.temperature_c is not None:
        return track.temperature_c, track.direction
    if domain == "time":
        return track.time_s, track.direction
    if domain == "motor-angle":
        return (next(iter(term.parameters.values())) * track.machine_angle_rad / turn) % 1.0, one
    if domain == "electrical" and track.electrical_rad is not None:
        return (track.electrical_rad / turn) % 1.0, one
    if domain == "frequency":
        return (next(iter(term.parameters.values())) * track.time_s) % 1.0, one
    return track.position_rad, track.direction
