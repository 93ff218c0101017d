"""Whether a periodic effect is as large everywhere as its form says.

A joint that rings after every jerk, or friction that builds up after every reversal, repeats with
the motion, and so has lines in the order spectrum; sines of the angle imitate it, several of
unrelated orders best. They betray themselves in time: what they stand for comes in bursts. Where a
sine of its own in every short block explains much more than the one that was added, whose size may
follow speed, direction and load, that one is no periodic effect.
"""

import numpy as np

from opamc_cli.joint.model import Fit, Term
from opamc_cli.joint.span import orthonormal, orthonormal_beside
from opamc_cli.joint.track import Floats, Track
from opamc_cli.joint.view import View, blocks_of

BLOCKS_PER_GROUP = 16
FEWEST_SAMPLES = 4
"""Per column in a block."""
LEAST_DEVIATIONS = 3.5
"""Of right forms in 30 simulated joints none reached 2."""
LEAST_SHARE = 0.4
"""Of the effect's own likelihood, that the blocks' sines must explain beside it."""
MOST = 0.5
"""Where effects of one name are unsteady that make this share of its likelihood, all go."""


def unsteady(fit: Fit, view: View, added: tuple[Term, ...]) -> list[int]:
    """Tell the added periodic effects that come in bursts.

    Parameters
    ----------
    fit : Fit
        Declared and added effects.
    view : View
        From `prepare`, on the fine grid.
    added : tuple of Term
        The latter.

    Returns
    -------
    list of int
        Places in `added`.
    """
    periodic = [place for place, term in enumerate(added) if term.effect.fast]
    if not periodic:
        return []
    raw = [fit.session.columns(term, True) for term in fit.terms]
    model = [view.whitened_rows(columns) for columns in raw]
    alone: dict[int, float] = {}
    bursting = []
    for place in periodic:
        own = fit.terms.index(added[place])
        others = [columns for i, columns in enumerate(model) if i != own]
        base = orthonormal(np.concatenate([*others, np.zeros((view.rows.size, 0))], axis=1))
        signal = view.values + model[own] @ fit.coefficients[own]
        beside = orthonormal_beside(model[own], base)
        alone[place] = float(np.sum((beside.T @ signal) ** 2)) / view.variance
        simplest = _simplest(added[place]) or list(range(raw[own].shape[1]))
        rest = view.values
        if added[place].effect.domain != "frequency":
            # What comes from the mains knows nothing of the motion; all else may follow it.
            varied = view.whitened_rows(_following_motion(raw[own][:, simplest], view.grid.track))
            following = orthonormal_beside(varied, view.span)
            rest = rest - following @ (following.T @ rest)
        excess, deviation = burst(view, model[own][:, simplest], rest)
        bursts = excess / max(deviation, 1e-300) > LEAST_DEVIATIONS
        if bursts and excess > LEAST_SHARE * alone[place]:
            bursting.append(place)
    gone = set(bursting)
    for name in {added[place].effect.name for place in bursting}:
        same = [place for place in periodic if added[place].effect.name == name]
        bad = sum(alone[place] for place in same if place in gone)
        if bad > MOST * sum(alone[place] for place in same):
            gone |= set(same)
    return sorted(gone)


def _simplest(term: Term) -> list[int]:
    """Columns of the effect's smallest form: a sine of constant size."""
    forms = [keep for _, keep in term.effect.variants(term.parameters)]
    return list(sorted(forms, key=len)[0]) if forms else []


def _following_motion(columns: Floats, track: Track) -> Floats:
    """Sines whose size follows speed or load more closely than the form lets them: no bursts."""
    speed = np.abs(track.velocity) / track.speed_scale
    load = track.load_a / max(float(np.std(track.load_a[track.moving])), 1e-300)
    sizes = (speed, speed**2, track.direction, load, np.abs(load))
    varied: Floats = np.concatenate([columns * size[:, None] for size in sizes], axis=1)
    return varied


def burst(view: View, columns: Floats, rest: Floats) -> tuple[float, float]:
    """Compute what columns explain of a residual if every block has coefficients of its own.

    Parameters
    ----------
    view : View
        Whitened residual.
    columns : array of shape (m, k)
        Whitened, on the view's valid samples.
    rest : array of shape (m,)
        Residual there.

    Returns
    -------
    excess, deviation : float
        Likelihood above what chance gives, and chance's standard deviation.
    """
    likelihood, free = 0.0, 0
    for block in blocks_of(view, BLOCKS_PER_GROUP):
        own = _filled(columns[block])
        if not own.shape[1] or block.size < FEWEST_SAMPLES * own.shape[1]:
            continue
        likelihood += float(np.sum((own.T @ rest[block]) ** 2)) / view.variance
        free += own.shape[1]
    return likelihood - free, float(np.sqrt(2 * max(free, 1)))


def _filled(columns: Floats) -> Floats:
    """Orthonormal columns; those that are zero (another recording's) are left out."""
    energy = np.einsum("ij,ij->j", columns, columns)
    return orthonormal(columns[:, energy > 0].copy())
