"""Close the loop: find what the model lacks, add it, and open the sealed data once."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.domains import Ceiling, Structure, ceiling, structures
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.experiments import separating_experiment
from opamc_cli.joint.form import slow_misfit
from opamc_cli.joint.gate import Gate, sealed_fall
from opamc_cli.joint.model import Fit, Session, fit_terms
from opamc_cli.joint.retraction import (
    confirmed,
    pruned,
    without_disagreement,
    without_imitations,
    without_trifles,
)
from opamc_cli.joint.rounds import Round, Rules
from opamc_cli.joint.search import Candidate
from opamc_cli.joint.spectra import highest_order, order_resolution
from opamc_cli.joint.steps import Progress, Rejected, Step
from opamc_cli.joint.trace import Untestable, ties_of

MOST_STEPS = 16
ATTEMPTS = 3
CLOSED_SHARE = 0.9
SEALED_EXCESS = 4.0
"""Times the open mean square error that the sealed one may be, and still nothing be missing."""


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
    seen_before = structures(before)
    progress = Progress()
    imitations: dict[str, str] = {}
    first = Round(before, Rules(library, gate, np.random.default_rng(seed)))
    for _ in range(ATTEMPTS):
        progress.steps.clear()
        progress.nameless = None
        last: Round = first
        while len(progress.steps) < most_steps:
            following = _taken(last, imitations, progress)
            if following is None:
                break
            last = following
        fitted = last.fitted
        fitted, steps = pruned(fitted, before, progress)
        found = {step.term.effect.name for step in steps}
        fitted, steps = without_disagreement(before, fitted, steps, progress)
        remains = structures(fitted)
        fitted, steps, remains = without_imitations(before, fitted, steps, remains, progress, seed)
        wrong = found - {step.term.effect.name for step in steps}
        if not wrong:
            break
        # What has the wrong form may have kept the right one out.
        imitations |= {name: progress.rejected[name].why for name in wrong}
    fitted, steps, remains = without_trifles(before, fitted, steps, remains, progress)
    # Only now, and only once, are the sealed groups looked at.
    fitted, steps, remains = confirmed(before, fitted, steps, remains, progress, gate)
    return _summary(before, fitted, tuple(steps), progress, seen_before, remains, seed)


def _taken(current: Round, imitations: Mapping[str, str], progress: Progress) -> Round | None:
    """Add the best candidate that passes the gate; return the round that follows, if any does."""
    traced = current.traced(imitations)
    checked, fitted = traced.candidates, current.fitted
    progress.untestable |= {entry.effect: entry for entry in traced.untestable}
    number = len(progress.steps)
    try:
        for i in _by_merit(checked, current):
            candidate = current.beside_decoys(checked[i])
            if candidate.why_not is not None:
                checked[i] = candidate
                continue
            following = current.following(candidate)
            extended = following.fitted
            effect = candidate.term.effect
            if not effect.plausible(extended.coefficients[-1], candidate.term.parameters):
                checked[i] = replace(candidate, why_not="fitted jointly, its sign is not physical")
                continue
            ties = ties_of(candidate, checked)
            track = fitted.session.fine.track
            progress.steps.append(
                Step(
                    term=candidate.term,
                    interpretation=effect.interpretation(candidate.term.parameters, track),
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
            return following
        for candidate in checked:
            if candidate.imitates is not None:
                tested = replace(candidate, why_not=None)
                if current.beside_decoys(tested).why_not is None:
                    progress.nameless = candidate
                break
        _collect(progress, number, checked, None)
        return None
    finally:
        current.rest()


def _by_merit(checked: list[Candidate], current: Round) -> list[int]:
    """Places of the candidates that pass, best first.

    The likelihood leads; but a candidate that explains twice as much of what was held out, at no
    less than half the likelihood, comes before: the whitened fit alone may hang on a detail. A
    fast and a slow candidate are compared where the fast one was searched.
    """
    places = [i for i, candidate in enumerate(checked) if candidate.why_not is None]
    for k in range(1, len(places)):
        first, other = checked[places[0]], checked[places[k]]
        least, likelihood = 0.5 * first.likelihood, other.likelihood
        if first.fine and not other.fine:
            likelihood = current.likelihood_among_fast(other)
            if likelihood > first.likelihood:
                least = 0.0
        better = other.gain > 2 * first.gain or (least == 0.0 and other.gain > first.gain)
        if better and likelihood > least:
            places.insert(0, places.pop(k))
    return places


def _collect(
    progress: Progress, number: int, checked: list[Candidate], added: Candidate | None
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


def _confirmed_nameless(before: Fit, progress: Progress) -> str | None:
    """Domain of something without a name, if the sealed data bear out that it is there."""
    candidate = progress.nameless
    if candidate is None:
        return None
    imitation = fit_terms(before.session, (*before.terms, candidate.term))
    fall = sealed_fall(before, imitation)
    return candidate.imitates if fall.plain > 0 or fall.likelihood > 0 else None


def _r2(fitted: Fit) -> float:
    opened = fitted.opened
    grid = opened.session.sharp
    current = grid.track.current_a[grid.sealed]
    power = float(np.sum((current - current.mean()) ** 2))
    rest = float(np.sum(opened.residual_a[grid.sealed] ** 2))
    return 1.0 - rest / power if power > 0 else 0.0


def _summary(
    before: Fit,
    after: Fit,
    steps: tuple[Step, ...],
    progress: Progress,
    seen_before: list[Structure],
    remains: list[Structure],
    seed: int,
) -> Loop:
    first, last = ceiling(before, seen_before), ceiling(after, remains)
    structured = [structure for structure in remains if structure.significant]
    rest = last.significant
    nameless = None if steps else _confirmed_nameless(before, progress)
    if not steps and not structured and not rest and nameless is None:
        slow = slow_misfit(after, seed)
        if slow is not None:
            share = slow.excess / slow.basis.shape[0]
            remains = [Structure(slow.domain, share, float(np.sqrt(slow.excess)), slow.p_value)]
            structured = remains
    rmse_before, rmse_after = before.rmse(sealed=True), after.rmse(sealed=True)
    excess = rmse_after**2 / max(after.rmse(sealed=False) ** 2, 1e-300)
    if not structured and not rest and excess > SEALED_EXCESS:
        # What began after the open groups is nothing that they could show.
        remains = [Structure("time", 1.0 - 1.0 / excess, float(np.sqrt(excess)), 0.0)]
        structured = remains
    floor = rmse_after * float(np.sqrt(max(1.0 - (last.share if rest else 0.0), 0.0)))
    reach = rmse_before**2 - floor**2
    explained = (rmse_before**2 - rmse_after**2) / reach if reach > 1e-3 * rmse_before**2 else 1.0
    explained = float(np.clip(explained, 0.0, 1.0))
    if not steps:
        lacking = rest or bool(structured) or nameless is not None
        verdict = "not-in-library" if lacking else "nothing-missing"
        # Something is there, and none of it is explained, even where its share is too small to say.
        explained = 0.0 if lacking else 1.0
    elif (rest or structured) and explained < CLOSED_SHARE:
        verdict = "partial"
    else:
        verdict = "closed"
    domain = None
    if verdict in ("partial", "not-in-library"):
        domain = remains[0].domain if remains and (structured or nameless is None) else nameless
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
