"""Close the loop: find what the model lacks, add it, and open the sealed data once."""

from dataclasses import dataclass, field, replace

import numpy as np

from opamc_cli.joint.domains import Ceiling, Structure, ceiling, structures
from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.experiments import separating_experiment
from opamc_cli.joint.flux import objection_of_flux
from opamc_cli.joint.form import imitations, is_smoothing, pressed_limit
from opamc_cli.joint.model import Fit, Session, Term, fit_terms
from opamc_cli.joint.plain import Plain, is_in_library, plain_terms, plainer
from opamc_cli.joint.spectra import highest_order, order_resolution
from opamc_cli.joint.trace import (
    Candidate,
    Gate,
    Held,
    View,
    consistency,
    decoy_likelihood,
    held_out,
    prepare,
    prepare_held,
    refusal,
    removal_gains,
    sealed_falls,
    search,
)

MOST_STEPS = 16
ATTEMPTS = 3
TIE_LIKELIHOOD = 6.0
TIE_SHARE = 0.03
TIE_COLLINEARITY = 0.9
STRUCTURE_GAIN = 0.02
STRUCTURE_P = 1e-3
"""Least gain and largest p of what counts as structure that is left."""
CLOSED_SHARE = 0.9
TRIFLE_SHARE = 0.4
PATCHWORK_KINDS = 3
PATCHWORK_SHARE = 0.6
PRUNE_GAIN = 0.003
HOPELESS = -10.0
"""Score of a best guess below which no refinement has been seen to reach the gate; the largest
rise over 600 searches was from -8 to 9, and the gate begins near 10."""
OUTSIDER = 0.2
"""Nor has one with a fifth of another effect's score been seen to overtake it."""


@dataclass(frozen=True)
class Step:
    """An effect that was added, with what spoke for it."""

    term: Term
    interpretation: str
    gain: float
    p_value: float
    decoy_gain: float
    t_value: float
    consistency: float
    ties: tuple[str, ...]
    experiment: str | None
    rmse_before_a: float
    rmse_after_a: float


@dataclass(frozen=True)
class Rejected:
    """The best form of an effect that was not added, and why."""

    effect: str
    domain: str
    parameters: Parameters
    gain: float
    p_value: float
    why: str


@dataclass(frozen=True)
class Untestable:
    """An effect that the recordings cannot show."""

    effect: str
    why: str


@dataclass(frozen=True)
class Loop:
    """What closing the loop found on one axis.

    Attributes
    ----------
    before, after : Fit
        The declared and the extended model, fitted to the open groups.
    steps : tuple of Step
        Effects added, in order.
    candidates : tuple of Candidate
        Every candidate of every round with its round, for the table.
    rejected, untestable : tuples
        What was not added, and what could not be tried.
    remains : tuple of Structure
        Domains in which the final residual is structured.
    ceiling_before, ceiling_after : Ceiling
        Reproducible share of the residual's mean square.
    verdict : str
        "nothing-missing", "closed", "partial" or "not-in-library".
    """

    before: Fit
    after: Fit
    steps: tuple[Step, ...]
    candidates: tuple[tuple[int, Candidate], ...]
    rejected: tuple[Rejected, ...]
    untestable: tuple[Untestable, ...]
    remains: tuple[Structure, ...]
    ceiling_before: Ceiling
    ceiling_after: Ceiling
    verdict: str
    rmse_before_a: float
    rmse_after_a: float
    r2_before: float
    r2_after: float
    floor_a: float
    explained_share: float
    remaining_domain: str | None
    orders_note: str


@dataclass
class _Progress:
    """What the rounds collect."""

    steps: list[Step] = field(default_factory=list)
    candidates: list[tuple[int, Candidate]] = field(default_factory=list)
    rejected: dict[str, Rejected] = field(default_factory=dict)
    untestable: dict[str, Untestable] = field(default_factory=dict)


def close_loop(
    before: Fit,
    library: Library,
    seed: int = 0,
    gate: Gate | None = None,
    most_steps: int = MOST_STEPS,
) -> Loop:
    """Find, trace and add what the declared model lacks, until the gate stays shut.

    Parameters
    ----------
    before : Fit
        The declared model, fitted to the open groups; the sealed ones are looked at once, at the
        end.
    library : Library
        Effects that may be added.
    seed : int
        For the decoys.
    gate : Gate, optional
        What a candidate must show.
    most_steps : int
        Effects added at most.

    Returns
    -------
    Loop
    """
    gate = gate or Gate()
    generator = np.random.default_rng(seed)
    seen_before = structures(before)
    progress = _Progress()
    usable = dict(library)
    for _ in range(ATTEMPTS):
        progress.steps.clear()
        fitted = before
        while len(progress.steps) < most_steps:
            step_fit = _round(fitted, usable, gate, generator, progress)
            if step_fit is None:
                break
            fitted = step_fit
        fitted, steps = _pruned(fitted, before, progress)
        found = {step.term.effect.name for step in steps}
        remains = structures(fitted)
        fitted, steps, remains = _without_imitations(before, fitted, steps, remains, progress, seed)
        wrong = found - {step.term.effect.name for step in steps}
        if not wrong:
            break
        # What has the wrong form may have kept the right one out.
        usable = {name: effect for name, effect in usable.items() if name not in wrong}
    fitted, steps, remains = _without_trifles(before, fitted, steps, remains, progress)
    # Only now, and only once, are the sealed groups looked at.
    fitted, steps, remains = _confirmed(before, fitted, steps, remains, progress)
    return _summary(before, fitted, tuple(steps), progress, seen_before, remains)


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
        elif not effect.limits(session.coarse.track) and not effect.several:
            guesses = effect.guesses(session.coarse.track, np.zeros(session.coarse.track.size))
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


def find_candidates(
    fitted: Fit, library: Library, gate: Gate | None = None
) -> tuple[list[Candidate], list[Untestable]]:
    """Candidates for one residual, best first, each with why it does not pass, if so.

    Parameters
    ----------
    fitted : Fit
        The model so far.
    library : Library
        Effects to try; those that the model holds are left out unless they may come twice.
    gate : Gate, optional
        What a candidate must show; decoys are left to the loop.

    Returns
    -------
    candidates : list of Candidate
    untestable : list of Untestable
    """
    gate = gate or Gate()
    candidates, untestable, _views = _candidates(fitted, library, gate)
    return candidates, untestable


Views = dict[bool, View]


def _candidates(
    fitted: Fit, library: Library, gate: Gate
) -> tuple[list[Candidate], list[Untestable], Views]:
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
    checked: list[Candidate] = []
    held: dict[bool, Held] = {}
    unnamed: list[Plain] | None = None
    for candidate in found:
        if candidate.fine not in held:
            held[candidate.fine] = prepare_held(fitted, candidate.fine)
        tested = held_out(fitted, candidate, held[candidate.fine])
        view = views[candidate.fine]
        tested = replace(tested, p_value=min(tested.p_value * max(trials, 1), 1.0))
        if tested.p_value <= gate.largest_p:
            tested = replace(tested, consistency=consistency(session, view, candidate))
        why = refusal(tested, gate) or pressed_limit(session, view, tested)
        if why is None and is_smoothing(session, views[False], tested, tested.coefficients):
            why = "only the smoothing of the motion makes it: on the coarse grid it is not there"
        if why is None and not tested.fine:
            if unnamed is None:
                unnamed = [
                    plain
                    for plain in plain_terms(view)
                    if plain.score > tested.score
                    and not is_in_library(plain, library, session, view)
                ]
            plain = plainer(tested, unnamed, session, view)
            if plain is not None:
                why = (
                    f"{plain.what} does as well with fewer parameters, and the library has no "
                    "effect of that form"
                )
        if why is None:
            term = tested.term
            why = objection_of_flux(session, term.effect, term.parameters, tested.coefficients)
        checked.append(replace(tested, why_not=why))
    return checked, untestable, views


def _round(
    fitted: Fit,
    library: Library,
    gate: Gate,
    generator: np.random.Generator,
    progress: _Progress,
) -> Fit | None:
    session = fitted.session
    checked, untestable, views = _candidates(fitted, library, gate)
    progress.untestable |= {entry.effect: entry for entry in untestable}
    number = len(progress.steps)
    for i in _by_merit(checked):
        candidate = checked[i]
        view = views[candidate.term.effect.fast]
        decoy = decoy_likelihood(fitted, view, candidate, generator, gate.decoys)
        share = decoy / max(candidate.likelihood, 1e-300)
        candidate = replace(candidate, decoy_gain=candidate.gain * share)
        if candidate.likelihood < gate.decoy_ratio * decoy:
            checked[i] = replace(candidate, why_not="a decoy of the same form does half as well")
            continue
        extended = fit_terms(session, (*fitted.terms, candidate.term))
        effect = candidate.term.effect
        if not effect.plausible(extended.coefficients[-1], candidate.term.parameters):
            checked[i] = replace(candidate, why_not="fitted jointly, its sign is not physical")
            continue
        ties = _ties(candidate, checked)
        progress.steps.append(
            Step(
                term=candidate.term,
                interpretation=effect.interpretation(candidate.term.parameters, session.fine.track),
                gain=candidate.gain,
                p_value=candidate.p_value,
                decoy_gain=candidate.decoy_gain,
                t_value=candidate.t_value,
                consistency=candidate.consistency,
                ties=ties,
                experiment=separating_experiment(effect.name, ties),
                rmse_before_a=fitted.rmse(sealed=False),
                rmse_after_a=extended.rmse(sealed=False),
            )
        )
        checked[i] = candidate
        _collect(progress, number, checked, candidate)
        return extended
    _collect(progress, number, checked, None)
    return None


def _by_merit(checked: list[Candidate]) -> list[int]:
    """Places of the candidates that pass, best first.

    The likelihood leads; but a candidate that explains twice as much of what was held out, at no
    less than half the likelihood, comes before: the whitened fit alone may hang on a detail.
    """
    places = [i for i, candidate in enumerate(checked) if candidate.why_not is None]
    for k in range(1, len(places)):
        first, other = checked[places[0]], checked[places[k]]
        if other.gain > 2 * first.gain and other.likelihood > 0.5 * first.likelihood:
            places.insert(0, places.pop(k))
    return places


def _simplest_first(found: list[Candidate], library: Library, session: Session) -> None:
    """Put the simplest of those that tie with the best in front; then the library's order."""
    if not found:
        return
    order = list(library)
    tied = {found[0].term.effect.name, *_ties(found[0], found)}

    def rank(candidate: Candidate) -> tuple[int, int]:
        effect = candidate.term.effect
        free = candidate.coefficients.size + len(effect.limits(session.fine.track))
        return free, order.index(effect.name)

    members = [candidate for candidate in found if candidate.term.effect.name in tied]
    front = min(members, key=rank)
    found.remove(front)
    found.insert(0, front)


def _collect(
    progress: _Progress, number: int, checked: list[Candidate], added: Candidate | None
) -> None:
    for candidate in checked:
        effect = candidate.term.effect
        # A contribution is as long as the grid; what is compared with others has been.
        slim = replace(candidate, contribution=np.zeros(0))
        progress.candidates.append((number, slim))
        if candidate is added:
            progress.rejected.pop(effect.name, None)
            continue
        why = candidate.why_not or "another effect explains the residual better"
        progress.rejected[effect.name] = Rejected(
            effect.name,
            effect.domain,
            candidate.term.parameters,
            candidate.gain,
            candidate.p_value,
            why,
        )


def _ties(winner: Candidate, others: list[Candidate]) -> tuple[str, ...]:
    """Names whose likelihood and contribution cannot be told from the winner's."""
    names = []
    margin = max(TIE_LIKELIHOOD, TIE_SHARE * winner.likelihood)
    for other in others:
        if other.term.effect.name == winner.term.effect.name:
            continue
        if other.likelihood < winner.likelihood - margin:
            continue
        if other.why_not is not None and other.why_not.startswith("the flux current"):
            continue
        if other.contribution.size == winner.contribution.size:
            product = float(np.dot(other.contribution, winner.contribution))
            length = np.linalg.norm(other.contribution) * np.linalg.norm(winner.contribution)
            if product < TIE_COLLINEARITY * float(length):
                continue
        names.append(other.term.effect.name)
    return tuple(names)


def _pruned(fitted: Fit, before: Fit, progress: _Progress) -> tuple[Fit, list[Step]]:
    """Remove, one after the other, added effects that later ones have made superfluous."""
    steps = list(progress.steps)
    while len(steps) > 1:
        first = len(before.terms)
        gains = removal_gains(fitted, range(first, first + len(steps) - 1))
        gain, index = min((gain, i) for i, gain in enumerate(gains))
        if gain >= PRUNE_GAIN:
            break
        gone = steps.pop(index)
        effect = gone.term.effect
        progress.rejected[effect.name] = Rejected(
            effect.name,
            effect.domain,
            gone.term.parameters,
            gain,
            1.0,
            "superfluous once later effects were added",
        )
        fitted = fit_terms(fitted.session, (*before.terms, *(s.term for s in steps)))
    return fitted, steps


def _without_imitations(
    before: Fit,
    fitted: Fit,
    steps: list[Step],
    remains: list[Structure],
    progress: _Progress,
    seed: int,
) -> tuple[Fit, list[Step], list[Structure]]:
    """Take back effects whose form is wrong, as what they leave shows."""
    wrong = imitations(fitted, tuple(step.term for step in steps), seed)
    if not wrong:
        return fitted, steps, remains
    kept = [step for i, step in enumerate(steps) if i not in wrong]
    for i, domain in wrong.items():
        step = steps[i]
        effect = step.term.effect
        progress.rejected[effect.name] = Rejected(
            effect.name,
            effect.domain,
            step.term.parameters,
            step.gain,
            step.p_value,
            f"leaves structure in the {domain} domain: the form is another one",
        )
    smaller = fit_terms(fitted.session, (*before.terms, *(step.term for step in kept)))
    return smaller, kept, structures(smaller)


def _without_trifles(
    before: Fit,
    fitted: Fit,
    steps: list[Step],
    remains: list[Structure],
    progress: _Progress,
) -> tuple[Fit, list[Step], list[Structure]]:
    """Take everything back where most of what repeats is still there.

    What the library lacks leaks into whatever resembles it a little; a small part explained
    beside a large part unexplained is no name.
    """
    left = ceiling(fitted, remains)
    if _is_patchwork(steps):
        return (
            before,
            [],
            _given_up(before, steps, "is one of many that each explain a part", progress),
        )
    if not steps or left.p_value >= STRUCTURE_P or left.share < STRUCTURE_GAIN:
        return fitted, steps, remains
    first, last = before.rmse(sealed=False) ** 2, fitted.rmse(sealed=False) ** 2
    explained, unexplained = first - last, left.share * last
    if explained > TRIFLE_SHARE * (explained + unexplained):
        return fitted, steps, remains
    domain = remains[0].domain if remains else "unknown"
    why = f"explains little of what repeats; most is in the {domain} domain"
    return before, [], _given_up(before, steps, why, progress)


def _is_patchwork(steps: list[Step]) -> bool:
    """Tell three or more kinds of effects, none of which explains most: no name at all."""
    falls: dict[str, float] = {}
    for step in steps:
        name = step.term.effect.name
        fall = step.rmse_before_a**2 - step.rmse_after_a**2
        falls[name] = falls.get(name, 0.0) + max(fall, 0.0)
    most = max(falls.values(), default=0.0)
    return len(falls) >= PATCHWORK_KINDS and most < PATCHWORK_SHARE * sum(falls.values())


def _confirmed(
    before: Fit,
    fitted: Fit,
    steps: list[Step],
    remains: list[Structure],
    progress: _Progress,
) -> tuple[Fit, list[Step], list[Structure]]:
    """Take everything back where the sealed data do not bear it out.

    All steps stand or fall together: a choice among them would make the sealed data a part of
    the search. Slow noise can hide a true fall of the plain error, and whitening an effect that
    is slow itself, so that one of the two has to fall.
    """
    if not steps or any(error > 0 for error in sealed_falls(before, fitted)):
        return fitted, steps, remains
    return before, [], _given_up(before, steps, "does not hold on the sealed data", progress)


def _given_up(before: Fit, steps: list[Step], why: str, progress: _Progress) -> list[Structure]:
    """Note why steps were taken back; return the declared model's structures."""
    for step in steps:
        effect = step.term.effect
        progress.rejected[effect.name] = Rejected(
            effect.name, effect.domain, step.term.parameters, step.gain, step.p_value, why
        )
    return structures(before)


def _r2(fitted: Fit) -> float:
    opened = fitted.opened
    grid = opened.session.fine
    current = grid.track.current_a[grid.sealed]
    power = float(np.sum((current - current.mean()) ** 2))
    rest = float(np.sum(opened.residual_a[grid.sealed] ** 2))
    return 1.0 - rest / power if power > 0 else 0.0


def _summary(
    before: Fit,
    after: Fit,
    steps: tuple[Step, ...],
    progress: _Progress,
    seen_before: list[Structure],
    remains: list[Structure],
) -> Loop:
    first, last = ceiling(before, seen_before), ceiling(after, remains)
    structured = [
        structure
        for structure in remains
        if structure.gain > STRUCTURE_GAIN and structure.p_value < STRUCTURE_P
    ]
    rest = last.share > STRUCTURE_GAIN and last.p_value < STRUCTURE_P
    rmse_before, rmse_after = before.rmse(sealed=True), after.rmse(sealed=True)
    floor = rmse_after * float(np.sqrt(max(1.0 - (last.share if rest else 0.0), 0.0)))
    reach = rmse_before**2 - floor**2
    explained = (rmse_before**2 - rmse_after**2) / reach if reach > 1e-3 * rmse_before**2 else 1.0
    explained = float(np.clip(explained, 0.0, 1.0))
    if not steps:
        verdict = "not-in-library" if rest or structured else "nothing-missing"
        # Something is there, and none of it is explained, even where its share is too small to say.
        explained = 0.0 if rest or structured else 1.0
    elif (rest or structured) and explained < CLOSED_SHARE:
        verdict = "partial"
    else:
        verdict = "closed"
    domain = None
    if verdict in ("partial", "not-in-library") and remains:
        domain = remains[0].domain
    return Loop(
        before=before,
        after=after,
        steps=steps,
        candidates=tuple(progress.candidates),
        rejected=tuple(progress.rejected.values()),
        untestable=tuple(progress.untestable.values()),
        remains=tuple(structured),
        ceiling_before=first,
        ceiling_after=last,
        verdict=verdict,
        rmse_before_a=rmse_before,
        rmse_after_a=rmse_after,
        r2_before=_r2(before),
        r2_after=_r2(after),
        floor_a=floor,
        explained_share=explained,
        remaining_domain=domain,
        orders_note=_orders_note(after.session),
    )


def _orders_note(session: Session) -> str:
    track = session.fine.track
    if "position" not in track.channels:
        return "no angle, so no orders"
    return (
        f"orders count per {track.angle_kind} revolution; orders closer than "
        f"{order_resolution(track):.3g} cannot be told apart, and above "
        f"{highest_order(track):.4g} they fold at the median speed"
    )
