"""Plain terms: a named mechanism must do better than the simplest function of its covariate.

A decaying warm-up over a temperature that rises steadily, a Stribeck curve of great width over a
square of the speed: over a limited range the special form imitates the plain one. Where the plain
term does as well with fewer parameters, and no effect of the library has just that form, the
honest answer is that the library lacks it.
"""

from dataclasses import dataclass

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.model import Session, Term
from opamc_cli.joint.search import SCORE_PER_PARAMETER, Candidate
from opamc_cli.joint.span import SPANNED, orthonormal_beside
from opamc_cli.joint.track import Floats, Track
from opamc_cli.joint.view import View

SAME_FORM = 0.999
"""Share of a plain term's whitened energy that an effect of the same form explains."""
IMITATED = 0.3
LEAST_TEMPERATURE_RANGE_C = 0.5


@dataclass(frozen=True)
class Plain:
    """A term with one coefficient and no name.

    Attributes
    ----------
    what, domain : str
        For people, and the covariate's domain.
    score : float
        As a candidate's.
    column : array of shape (m,)
        Whitened, without what the model explains, on the view's valid samples; unit length.
    """

    what: str
    domain: str
    score: float
    column: Floats


def plain_columns(track: Track) -> dict[tuple[str, str], Floats]:
    """Lowest powers of every covariate.

    Parameters
    ----------
    track : Track
        With fitted load.

    Returns
    -------
    dict of (what, domain) to array of shape (n,)
    """
    sign, velocity = track.direction, track.velocity
    speed = np.abs(velocity)
    columns = {
        ("a constant", "load"): np.ones(track.size),
        ("the direction", "velocity"): sign,
        ("the velocity", "velocity"): velocity,
        ("the speed without its direction", "velocity"): speed,
        ("the square of the speed", "velocity"): velocity * speed,
        ("the angle", "joint-angle"): track.position_rad,
        ("the load's magnitude against the motion", "load"): sign * np.abs(track.load_a),
    }
    degrees = track.temperature_c
    if degrees is not None and np.ptp(degrees[track.moving]) >= LEAST_TEMPERATURE_RANGE_C:
        middle = float(np.mean(degrees[track.moving]))
        columns["the velocity times the temperature", "temperature"] = velocity * (degrees - middle)
    return columns


def plain_terms(view: View) -> list[Plain]:
    """Score every plain term that the model does not hold, best first.

    Parameters
    ----------
    view : View
        Coarse grid.
    """
    found = []
    for (what, domain), column in plain_columns(view.grid.track).items():
        white = view.whitened_rows(column)
        own = white - view.span @ (view.span.T @ white)
        length = float(np.linalg.norm(own))
        if length**2 <= SPANNED * float(white @ white):
            continue
        own = own / length
        fall = float(own @ view.values) ** 2
        left = max(view.power - fall, 1e-12 * view.power)
        score = view.freedom(1) * float(np.log(view.power / left)) - SCORE_PER_PARAMETER
        found.append(Plain(what, domain, score, own))
    return sorted(found, key=lambda plain: -plain.score)


def is_in_library(plain: Plain, library: Library, session: Session, view: View) -> bool:
    """Tell whether an effect of the library has exactly the form of a plain term.

    Parameters
    ----------
    plain : Plain
        From `plain_terms`.
    library : Library
        Effects that may be added.
    session, view
        As for the search.
    """
    for effect in library.values():
        if effect.fast or effect.untestable(session.fine.track) is not None:
            continue
        for guess in effect.guesses(view.grid.track, view.residual):
            for column in _single_columns(effect, guess, session, view):
                own = column - view.span @ (view.span.T @ column)
                energy = float(own @ own)
                if energy <= SPANNED * float(column @ column):
                    continue
                if float(own @ plain.column) ** 2 > SAME_FORM * energy:
                    return True
    return False


def _single_columns(
    effect: Effect, guess: dict[str, float], session: Session, view: View
) -> list[Floats]:
    """Columns that an effect can have on its own."""
    lone = [keep[0] for _, keep in effect.variants(guess) if len(keep) == 1]
    white = view.whitened_rows(session.columns(Term(effect, guess), view.fine))
    if white.shape[1] == 1:
        lone = [0]
    return [white[:, k] for k in lone]


def plainer(
    candidate: Candidate, unnamed: list[Plain], session: Session, view: View
) -> Plain | None:
    """Find the plain term that a candidate only imitates, or None.

    Parameters
    ----------
    candidate : Candidate
        From `search`, on the view's grid.
    unnamed : list of Plain
        Plain terms that no effect of the library has.
    session, view
        As for the search.
    """
    columns = view.whitened_rows(session.columns(candidate.term, candidate.fine))
    for plain in unnamed:
        if plain.score < candidate.score:
            continue
        span = np.concatenate([view.span, plain.column[:, None]], axis=1)
        own = orthonormal_beside(columns, span)
        fall = float(np.sum((own.T @ view.values) ** 2)) / view.variance
        if fall < IMITATED * candidate.likelihood:
            return plain
    return None
