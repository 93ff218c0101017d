"""How much of its domain's curve an effect's form holds, and the curve beside it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.fit.model import Fit, Term
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.name.chain import Chain
from opamc_cli.joint.name.search import Pool, trials
from opamc_cli.joint.name.significance import LEAST_T

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
    tried = trials(best, replace(unnamed, library=library, least_share=0.0))
    better = [one for one in tried if one.t_value > LEAST_T and one.chain.score < best.score]
    more = max([0.0, *(best.mean_square - one.chain.mean_square for one in better)])
    return max(drop, 0.0) / max(drop + more, 1e-300)


def curve_of(fit: Fit, place: int) -> Curve:
    """Draw an effect and the residual over the effect's covariate."""
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
    return Curve(
        name,
        unit,
        np.array([over[piece].mean() for piece in bins]),
        np.array([(side * both)[piece].mean() for piece in bins]),
        np.array([(side * named)[piece].mean() for piece in bins]),
    )
