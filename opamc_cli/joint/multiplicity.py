"""How many independent guesses the guesses at an effect's parameters stand for.

A step that is tried at thirty times of a session, or a drag at a hundred places, fits noise better
than one that is tried once, but not as if the guesses were independent: neighbours nearly agree.
How often the best of them reaches what it does is drawn from white noise.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from opamc_cli.joint.effects.base import Parameters
from opamc_cli.joint.model import Session, Term
from opamc_cli.joint.search import Candidate
from opamc_cli.joint.span import orthonormal, orthonormal_beside
from opamc_cli.joint.view import View

DRAWS = 2000
TAIL = 0.01
"""Where the chance of the best guess is compared with that of one alone."""
SKETCHED = 1024
"""Samples that stand for all: inner products of columns are kept to 3 %."""


def independent_guesses(
    session: Session, view: View, candidate: Candidate, guesses: Sequence[Parameters], seed: int = 0
) -> float:
    """Count independent guesses.

    Parameters
    ----------
    session, view
        As for the search.
    candidate : Candidate
        Its best form, whose columns every guess has.
    guesses : sequence of dict
        What was tried.
    seed : int
        For the noise.

    Returns
    -------
    float
        1 to the number of guesses.
    """
    if len(guesses) < 2:
        return 1.0
    generator = np.random.default_rng(seed)
    size = view.rows.size
    order = generator.permutation(size)
    edges = np.unique(np.linspace(0, size, min(SKETCHED, size) + 1).astype(np.int64)[:-1])
    signs = generator.choice([-1.0, 1.0], size=size)[order][:, None]
    term = candidate.term
    bases = []
    for guess in guesses:
        columns = session.columns(Term(term.effect, guess, term.keep), view.fine)
        if np.all(np.isfinite(columns)):
            own = orthonormal_beside(view.whitened_rows(columns), view.span)
            bases.append(orthonormal(np.add.reduceat(own[order] * signs, edges, axis=0)))
    bases = [own for own in bases if own.shape[1]]
    if len(bases) < 2:
        return 1.0
    noise = generator.standard_normal((edges.size, DRAWS))
    products = np.concatenate(bases, axis=1).T @ noise
    largest = np.zeros(DRAWS)
    stop = 0
    for own in bases:
        start, stop = stop, stop + own.shape[1]
        fall = np.einsum("ij,ij->j", products[start:stop], products[start:stop])
        np.maximum(largest, fall, out=largest)
    freedom = max(own.shape[1] for own in bases)
    alone = float(chi2.sf(np.quantile(largest, 1 - TAIL), freedom))
    return float(np.clip(TAIL / max(alone, 1e-300), 1.0, len(bases)))


def drawn_p_value(session: Session, view: View, candidate: Candidate) -> float:
    """P-value of a candidate's likelihood, the choice among its effect's guesses counted.

    Parameters
    ----------
    session, view, candidate
        As from the search.

    Returns
    -------
    float
        Chi-square of the likelihood, less one for every parameter that was refined (what that
        gains on average), times the independent guesses and the forms that were tried.
    """
    effect, track = candidate.term.effect, view.grid.track
    guesses = effect.guesses(track, view.residual)
    refined = len(effect.limits(track)) if guesses else 0
    likelihood = max(candidate.likelihood - refined, 0.0)
    alone = float(chi2.sf(likelihood, candidate.coefficients.size))
    forms = 1 + len(effect.variants(candidate.term.parameters))
    return min(alone * forms * independent_guesses(session, view, candidate, guesses), 1.0)
