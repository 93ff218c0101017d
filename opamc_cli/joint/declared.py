"""Fit a declared model, parameters that are not given included."""

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.model import Fit, Session, Term, fit_terms
from opamc_cli.joint.search import search
from opamc_cli.joint.view import prepare


def declared_fit(session: Session, declared: tuple[tuple[Effect, Term | None], ...]) -> Fit:
    """Fit a declared model; non-linear parameters that are not given are searched first.

    Parameters
    ----------
    session : Session
        Recordings.
    declared : tuple of (Effect, Term or None)
        Effects with their terms where parameters are given.

    Returns
    -------
    Fit
        Terms in the declared order.
    """
    terms: dict[int, Term] = {}
    open_places = []
    for place, (effect, term) in enumerate(declared):
        if term is not None:
            terms[place] = term
            continue
        track = session.coarse.track
        fixed = not effect.limits(track) and not effect.several
        guesses = effect.guesses(track, np.zeros(track.size)) if fixed else []
        if len(guesses) == 1:
            terms[place] = Term(effect, guesses[0])
        else:
            open_places.append(place)
    fitted = fit_terms(session, tuple(terms[place] for place in sorted(terms)))
    for place in open_places:
        effect = declared[place][0]
        view = prepare(fitted, fine=effect.fast)
        found, _tried = search(fitted.session, view, effect)
        if found is None:
            guesses = effect.guesses(view.grid.track, view.residual)
            if not guesses:
                continue
            terms[place] = Term(effect, guesses[0])
        else:
            terms[place] = found.term
        fitted = fit_terms(fitted.session, tuple(terms[key] for key in sorted(terms)))
    return fitted
