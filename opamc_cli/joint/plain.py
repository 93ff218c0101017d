"""Plain forms: a named mechanism must do better than the simplest functions of each covariate.

A decaying warm-up over a temperature that rises steadily, a Stribeck curve of great width over a
square of the speed, a drag at some place over a parabola of the angle: over a limited range the
special form imitates the plain one. Where a plain form does as well with no more parameters, and
no effect of the library has that form, the honest answer is that the library lacks it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.model import Session, Term
from opamc_cli.joint.normal import solve
from opamc_cli.joint.search import SCORE_PER_PARAMETER, Candidate
from opamc_cli.joint.span import SPANNED, orthonormal, orthonormal_beside
from opamc_cli.joint.track import Floats, Track
from opamc_cli.joint.view import View

SAME_FORM = 0.999
"""Share of a plain term's whitened energy that an effect of the same form explains."""
OWN_FORM = 0.99
"""Likewise, of a form in the effect's own covariate: no more than another way to write it."""
INDIFFERENCE = 6.0
"""In likelihood units: less does not tell two forms apart."""
NAMED = (0.95, 0.9)
"""Collinearity with a plain form, and share of its likelihood, from which an effect has it."""
NEARLY_NAMED = (0.8, 0.6)
"""Likewise, where the plain form explains no more than the candidate."""
TIED = 0.9
"""Collinearity with the candidate, from which an effect that explains as much ties with it."""
IMITATED = 0.3
FEW_GUESSES = 20
SLOW = 0.5
"""Share of a fast candidate's likelihood that it has on the coarse grid too, if it is slow."""
LEAST_TEMPERATURE_RANGE_C = 0.5
CARRIERS = ("a constant", "the direction", "the velocity")


@dataclass(frozen=True)
class Plain:
    """A form with one coefficient per column, and no name.

    Attributes
    ----------
    what, domain : str
        For people, and the covariate's domain.
    score, likelihood : float
        As a candidate's.
    columns : array of shape (m, k)
        Whitened, without what the model explains, on the view's valid samples.
    fitted : array of shape (m,)
        What they explain.
    freedom : int
        Columns; two of a single one that changes with a covariate, which is a choice too.
    """

    what: str
    domain: str
    score: float
    likelihood: float
    columns: Floats
    fitted: Floats
    freedom: int

    @cached_property
    def span(self) -> Floats:
        """Orthonormal columns."""
        return orthonormal(self.columns.copy())


@dataclass(frozen=True)
class PlainForm:
    """The columns of a plain form, before anything is fitted."""

    what: str
    domain: str
    columns: Floats


def plain_forms(track: Track) -> list[PlainForm]:
    """Lowest powers of every covariate, alone and as changes of offset and friction.

    Parameters
    ----------
    track : Track
        With fitted load.

    Returns
    -------
    list of PlainForm
        A constant, dry and lubricant friction; each of them times the first, or the first two,
        powers of a covariate; both frictions times the same.
    """
    moving = track.moving
    sign, velocity = track.direction, track.velocity / track.speed_scale
    carriers = (np.ones(track.size), sign, velocity)
    covariates = {
        "velocity": ("the speed", np.abs(velocity)),
        "joint-angle": ("the angle", track.position_rad),
        "load": ("the load's magnitude", np.abs(track.load_a)),
        "time": ("the time", track.time_s),
    }
    degrees = track.temperature_c
    if degrees is not None and np.ptp(degrees[moving]) >= LEAST_TEMPERATURE_RANGE_C:
        covariates["temperature"] = ("the temperature", degrees)
    forms = [
        PlainForm(what, domain, carrier[:, None])
        for what, domain, carrier in zip(
            CARRIERS, ("load", "velocity", "velocity"), carriers, strict=True
        )
    ]
    forms += [
        PlainForm("the angle", "joint-angle", track.position_rad[:, None]),
        PlainForm("the speed without its direction", "velocity", np.abs(velocity)[:, None]),
        PlainForm("the load against the motion", "load", (sign * np.abs(track.load_a))[:, None]),
    ]
    for domain, (covariate, values) in covariates.items():
        low, high = np.quantile(values[moving], [0.002, 0.998])
        power = (values - (low + high) / 2) / max(float(high - low) / 2, 1e-300)
        powers = np.stack([power, power**2], axis=1)
        one, dry, wet = (carrier[:, None] for carrier in carriers)
        for count, of in ((1, covariate), (2, f"{covariate} and its square")):
            some = powers[:, :count]
            forms += [
                PlainForm(f"the velocity times {of}", domain, wet * some),
                PlainForm(
                    f"both frictions times {of}",
                    domain,
                    np.concatenate([dry * some, wet * some], axis=1),
                ),
            ]
            # A current that drifts by itself is what slow noise looks like.
            if domain not in ("time", "temperature"):
                beside = np.concatenate([one, some], axis=1)
                forms.append(PlainForm(f"{of} beside a constant", domain, beside))
            # Temperature acts on the lubricant. Dry friction that alone follows it, and that no
            # library names, would be a twin of every warm-up of dry friction.
            if domain != "temperature":
                forms.append(PlainForm(f"the direction times {of}", domain, dry * some))
    return forms


def score_plain(view: View) -> list[Plain]:
    """Score every plain form that the model does not hold, best first.

    Parameters
    ----------
    view : View
        Coarse grid.
    """
    forms = plain_forms(view.grid.track)
    white = view.whitened_rows(np.concatenate([form.columns for form in forms], axis=1))
    left = white - view.span @ (view.span.T @ white)
    whole = np.einsum("ij,ij->j", white, white)
    gram, moment = left.T @ left, left.T @ view.values
    found = []
    start = 0
    for form in forms:
        stop = start + form.columns.shape[1]
        new = [k for k in range(start, stop) if gram[k, k] > SPANNED * whole[k]]
        start = stop
        if not new:
            continue
        rank = _rank(gram[np.ix_(new, new)])
        solution = solve(gram[np.ix_(new, new)], moment[new])
        fall = float(solution @ moment[new])
        rest = max(view.power - fall, 1e-12 * view.power)
        likelihood = view.freedom(rank) * float(np.log(view.power / rest))
        score = likelihood - SCORE_PER_PARAMETER * rank
        columns = left[:, new]
        freedom = rank if form.what in CARRIERS else max(rank, 2)
        fitted = columns @ solution
        found.append(Plain(form.what, form.domain, score, likelihood, columns, fitted, freedom))
    return sorted(found, key=lambda plain: -plain.score)


def _rank(gram: Floats) -> int:
    """Count independent columns; some differ by what the model holds only."""
    scale = np.sqrt(np.diagonal(gram))
    values = np.linalg.eigvalsh(gram / np.outer(scale, scale))
    return int(np.count_nonzero(values > SPANNED * values[-1]))


def is_in_library(plain: Plain, library: Library, session: Session, view: View) -> bool:
    """Tell whether an effect of the library has exactly the form of a plain column.

    Parameters
    ----------
    plain : Plain
        From `score_plain`.
    library : Library
        Effects that may be added.
    session, view
        As for the search.
    """
    if plain.span.shape[1] > 1:
        return False
    for effect in library.values():
        # Of effects whose parameters are searched, the best form is among the candidates.
        if effect.fast or effect.limits(view.grid.track):
            continue
        if effect.untestable(session.fine.track) is not None:
            continue
        for guess in effect.guesses(view.grid.track, view.residual):
            for columns in _whitened_forms(effect, guess, session, view):
                if columns.shape[1] == 1 and _share(plain.fitted, columns, view) > SAME_FORM:
                    return True
    return False


def _whitened_forms(
    effect: Effect, guess: dict[str, float], session: Session, view: View
) -> list[Floats]:
    """Columns of an effect's full form and of its smaller ones."""
    white = view.whitened_rows(session.columns(Term(effect, guess), view.fine))
    return [white, *(white[:, keep] for _, keep in effect.variants(guess))]


def _share(fitted: Floats, columns: Floats, view: View) -> float:
    """Share of a plain form's energy that columns explain beside the model."""
    own = orthonormal_beside(columns, view.span)
    return float(np.sum((own.T @ fitted) ** 2)) / max(float(np.dot(fitted, fitted)), 1e-300)


def _is_own_form(plain: Plain, candidate: Candidate, session: Session, view: View) -> bool:
    """Tell whether a plain form is the candidate's own, in the covariate that it names."""
    effect = candidate.term.effect
    if effect.domain != plain.domain:
        return False
    guesses = effect.guesses(view.grid.track, view.residual)
    # Of many guesses, at places or in time, none has the form of a power.
    guesses = [candidate.term.parameters, *(guesses if len(guesses) <= FEW_GUESSES else [])]
    return any(
        _share(plain.fitted, columns, view) > OWN_FORM
        for guess in guesses
        for columns in _whitened_forms(effect, guess, session, view)
        if columns.shape[1] <= plain.span.shape[1]
    )


def _is_named(plain: Plain, candidate: Candidate, others: Sequence[Candidate]) -> bool:
    """Tell whether another effect, of the plain form's covariate, stands for that form.

    It does if it explains nearly the same, or if it ties with the candidate: then the covariate
    is among those that are named anyway.
    """
    explains_more = plain.likelihood > candidate.likelihood + INDIFFERENCE
    collinearity, share = NAMED if explains_more else NEARLY_NAMED
    for other in others:
        effect = other.term.effect
        if effect.name == candidate.term.effect.name or effect.domain != plain.domain:
            continue
        if other.contribution.size != plain.fitted.size:
            continue
        least = share * plain.likelihood - INDIFFERENCE
        if other.likelihood > least and _cosine(other, plain.fitted) > collinearity:
            return True
        if candidate.contribution.size != plain.fitted.size:
            continue
        least = candidate.likelihood - INDIFFERENCE
        if other.likelihood > least and _cosine(other, candidate.contribution) > TIED:
            return True
    return False


def _cosine(candidate: Candidate, other: Floats) -> float:
    """Collinearity of a candidate's contribution with another one."""
    own = candidate.contribution
    length = float(np.linalg.norm(own) * np.linalg.norm(other))
    return float(own @ other) / max(length, 1e-300)


def _fall(columns: Floats, span: Floats, view: View) -> float:
    """Fall of the sum of squares by columns beside an orthonormal span."""
    own = orthonormal_beside(columns, span)
    return float(np.sum((own.T @ view.values) ** 2))


def plainer(
    candidate: Candidate,
    plains: Sequence[Plain],
    others: Sequence[Candidate],
    library: Library,
    session: Session,
    view: View,
) -> Plain | None:
    """Find the plain form that a candidate only imitates, or None.

    Parameters
    ----------
    candidate : Candidate
        From `search`, on either grid.
    plains : sequence of Plain
        From `score_plain`.
    others : sequence of Candidate
        The best form of every effect of the library.
    library : Library
        Effects that may be added.
    session : Session
        Recordings.
    view : View
        Coarse grid.
    """
    columns = view.whitened_rows(session.columns(candidate.term, fine=False))
    free = round((candidate.likelihood - candidate.score) / SCORE_PER_PARAMETER)
    if candidate.fine:
        # Sines of a long wave imitate slow effects; those of a short one average out.
        slow = _fall(columns, view.span, view) / view.variance
        if slow < SLOW * candidate.likelihood:
            return None
        score = slow - SCORE_PER_PARAMETER * free
        candidate = replace(candidate, likelihood=slow, score=score, fine=False)
    for plain in plains:
        gap = candidate.score - plain.score
        plainest = plain.span.shape[1] == 1 and gap < 0
        if plain.domain == candidate.term.effect.domain:
            # In its own covariate an effect is not one of two forms that cannot be told apart.
            better, close = gap < -INDIFFERENCE, False
        else:
            better = gap < -INDIFFERENCE / 2
            charged = plain.likelihood - SCORE_PER_PARAMETER * plain.freedom
            close = plain.freedom <= free and candidate.score - charged < INDIFFERENCE
        if not (better or plainest or close):
            continue
        beside = np.concatenate([view.span, plain.span], axis=1)
        if _fall(columns, beside, view) / view.variance > IMITATED * candidate.likelihood:
            continue
        if _is_own_form(plain, candidate, session, view):
            continue
        if _is_named(plain, candidate, others):
            continue
        if not is_in_library(plain, library, session, view):
            return plain
    return None
