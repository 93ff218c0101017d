"""Trace a residual to its cause: every effect's best form, gated, and compared."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from opamc_cli.joint.coherence import disagreement
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.flux import objection_of_flux
from opamc_cli.joint.form import pressed_limit
from opamc_cli.joint.gate import Gate, Held, held_out, prepare_held, refusal, with_consistency
from opamc_cli.joint.model import Fit, Session
from opamc_cli.joint.multiplicity import drawn_p_value
from opamc_cli.joint.plain import Plain, plainer, score_plain
from opamc_cli.joint.search import Candidate, search
from opamc_cli.joint.view import View, prepare

TIE_LIKELIHOOD = 6.0
TIE_SHARE = 0.03
TIE_COLLINEARITY = 0.9
HOPELESS = -10.0
"""Score of a best guess below which no refinement has been seen to reach the gate; the largest
rise over 600 searches was from -8 to 9, and the gate begins near 10."""
REFUTED = ("the flux current", "leaves structure")
"""How the reasons begin for which an effect is no tie either."""
OUTSIDER = 0.2
"""Nor has one with a fifth of another effect's score been seen to overtake it."""


@dataclass(frozen=True)
class Untestable:
    """An effect that the recordings cannot show."""

    effect: str
    why: str


@dataclass(frozen=True)
class Traced:
    """What a residual may come from.

    Attributes
    ----------
    candidates : list of Candidate
        Best first, each with why it does not pass, if so; decoys are left to the loop.
    untestable : list of Untestable
        Effects that were not tried.
    views : dict of bool to View
        The residual on the coarse (False) and the fine (True) grid.
    """

    candidates: list[Candidate]
    untestable: list[Untestable]
    views: dict[bool, View]


def trace_residual(
    fitted: Fit,
    library: Library,
    gate: Gate | None = None,
) -> Traced:
    """Try every effect of a library on what a fit leaves.

    Parameters
    ----------
    fitted : Fit
        The model so far.
    library : Library
        Effects to try; those that the model holds are left out unless they may come twice.
    gate : Gate, optional
        What a candidate must show.

    Returns
    -------
    Traced
    """
    gate = gate or Gate()
    session = fitted.session
    present = {term.effect.name for term in fitted.terms}
    views = {False: prepare(fitted, fine=False)}
    views[True] = views[False] if session.coarse is session.fine else prepare(fitted, fine=True)
    found: list[Candidate] = []
    untestable: list[Untestable] = []
    trials = 0
    for name, effect in library.items():
        if name in present and not effect.several:
            continue
        why = effect.untestable(session.fine.track)
        if why is not None:
            untestable.append(Untestable(name, why))
            continue
        best = max((other.score for other in found), default=0.0)
        least = max(HOPELESS, OUTSIDER * best)
        candidate, _tried = search(session, views[effect.fast], effect, least=least)
        trials += 1
        if candidate is not None:
            found.append(candidate)
    found.sort(key=lambda candidate: -candidate.score)
    _simplest_first(found, library, session)
    held = {fine: prepare_held(fitted, fine) for fine in {each.fine for each in found}}
    checked: list[Candidate] = []
    plains: list[Plain] | None = None
    for candidate in found:
        view = views[candidate.fine]
        tested = _predicting_best(fitted, view, candidate, held[candidate.fine])
        tested = replace(tested, p_value=_p_value(session, view, tested, trials, gate))
        if tested.p_value <= gate.largest_p:
            tested = with_consistency(session, view, tested)
        why = refusal(tested, gate) or pressed_limit(session, view, tested)
        why = why or disagreement(view, tested.term)
        if why is None:
            slow = views[False]
            plains = score_plain(slow) if plains is None else plains
            plain = plainer(tested, plains, found, library, session, slow)
            if plain is not None:
                tested = replace(tested, imitates=plain.domain)
                why = (
                    f"{plain.what} does as well with no more parameters, and the library has no "
                    "effect of that form"
                )
        if why is None:
            term = tested.term
            why = objection_of_flux(session, term.effect, term.parameters, tested.coefficients)
        checked.append(replace(tested, why_not=why))
    return Traced(checked, untestable, views)


def _p_value(session: Session, view: View, candidate: Candidate, trials: int, gate: Gate) -> float:
    """P-value among all that was tried: every guess counts, or, if that decides, what it adds."""
    effect = candidate.term.effect
    trials = max(trials, 1)
    if effect.fast:
        return min(candidate.p_value * trials * effect.choices(view.grid.track), 1.0)
    p_value = min(candidate.p_value * trials, 1.0)
    alone = float(chi2.sf(candidate.likelihood, candidate.coefficients.size))
    if p_value > gate.largest_p and alone * trials <= gate.largest_p:
        return min(p_value, drawn_p_value(session, view, candidate) * trials)
    return p_value


def _predicting_best(fitted: Fit, view: View, candidate: Candidate, held: Held) -> Candidate:
    """Leave groups out of a candidate; if it does not predict them, of its simpler forms.

    The likelihood is of what was fitted, and whitened: it hardly sees slow regressors that are
    nearly the same, whose coefficients mean nothing elsewhere.
    """
    tested: Candidate | None = held_out(fitted, candidate, held)
    while tested is not None and tested.gain <= 0:
        effect = tested.term.effect.simpler(tested.term.parameters)
        if effect is None:
            break
        found, _tried = search(fitted.session, view, effect)
        tested = None if found is None else held_out(fitted, found, held)
    return tested or held_out(fitted, candidate, held)


def _simplest_first(found: list[Candidate], library: Library, session: Session) -> None:
    """Put the simplest of those that tie with the best in front; then the library's order."""
    if not found:
        return
    order = list(library)
    tied = {found[0].term.effect.name, *ties_of(found[0], found)}

    def rank(candidate: Candidate) -> tuple[int, int]:
        effect = candidate.term.effect
        free = candidate.coefficients.size + len(effect.limits(session.fine.track))
        return free, order.index(effect.name)

    members = [candidate for candidate in found if candidate.term.effect.name in tied]
    front = min(members, key=rank)
    found.remove(front)
    found.insert(0, front)


def ties_of(winner: Candidate, others: list[Candidate]) -> tuple[str, ...]:
    """Names whose likelihood and contribution cannot be told from the winner's."""
    names = []
    margin = max(TIE_LIKELIHOOD, TIE_SHARE * winner.likelihood)
    for other in others:
        if other.term.effect.name == winner.term.effect.name:
            continue
        if other.likelihood < winner.likelihood - margin:
            continue
        if other.why_not is not None and other.why_not.startswith(REFUTED):
            continue
        if other.contribution.size == winner.contribution.size:
            product = float(np.dot(other.contribution, winner.contribution))
            length = np.linalg.norm(other.contribution) * np.linalg.norm(winner.contribution)
            if product < TIE_COLLINEARITY * float(length):
                continue
        names.append(other.term.effect.name)
    return tuple(names)
