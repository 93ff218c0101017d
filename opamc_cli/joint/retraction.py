"""Take back what was added: superfluous, of the wrong form, a trifle, or not borne out."""

from dataclasses import replace

import numpy as np

from opamc_cli.joint.coherence import disagreement
from opamc_cli.joint.domains import Structure, ceiling, structures
from opamc_cli.joint.form import imitations
from opamc_cli.joint.gate import Gate, removal_gains, sealed_fall
from opamc_cli.joint.model import Fit, fit_terms
from opamc_cli.joint.steps import Progress, Step
from opamc_cli.joint.view import prepare

TRIFLE_SHARE = 0.4
SINES_SHARE = 0.6
"""Right ones at 0.6 of the noise explained at least 0.91 of what repeats, imitations up to 0.54."""
TELLING_T = 2.0
PATCHWORK_KINDS = 3
PATCHWORK_SHARE = 0.6
PRUNE_GAIN = 0.003
MOST_UNLUCKY = 6.0
"""Rise of the sealed whitened error, in likelihood units. What a true effect that explains m there
makes fall is m, give or take twice its root: below -5.3 one time in a hundred, whatever m is."""


def pruned(fitted: Fit, before: Fit, progress: Progress) -> tuple[Fit, list[Step]]:
    """Remove, one after the other, added effects that later ones have made superfluous."""
    steps = list(progress.steps)
    while len(steps) > 1:
        first = len(before.terms)
        gains = removal_gains(fitted, range(first, first + len(steps) - 1))
        gain, index = min((gain, i) for i, gain in enumerate(gains))
        if gain >= PRUNE_GAIN:
            break
        gone = steps.pop(index)
        why = "superfluous once later effects were added"
        progress.take_back(replace(gone, gain=gain, p_value=1.0), why)
        fitted = fit_terms(fitted.session, (*before.terms, *(s.term for s in steps)))
    return fitted, steps


def without_disagreement(
    before: Fit, fitted: Fit, steps: list[Step], progress: Progress
) -> tuple[Fit, list[Step]]:
    """Take back a step on which the model, as it is with all later steps, does not agree."""
    for step in [step for step in steps if step.term.effect.same_for_all]:
        others = [other for other in steps if other is not step]
        smaller = fit_terms(fitted.session, (*before.terms, *(other.term for other in others)))
        why = disagreement(prepare(smaller, fine=step.term.effect.fast), step.term)
        if why is not None:
            progress.take_back(step, why)
            fitted, steps = smaller, others
    return fitted, steps


def without_imitations(
    before: Fit,
    fitted: Fit,
    steps: list[Step],
    remains: list[Structure],
    progress: Progress,
    seed: int,
) -> tuple[Fit, list[Step], list[Structure]]:
    """Take back effects whose form is wrong, as what they leave shows."""
    wrong = imitations(fitted, tuple(step.term for step in steps), seed)
    if not wrong:
        return fitted, steps, remains
    kept = [step for i, step in enumerate(steps) if i not in wrong]
    for i, domain in wrong.items():
        why = f"leaves structure in the {domain} domain: the form is another one"
        progress.take_back(steps[i], why)
    smaller = fit_terms(fitted.session, (*before.terms, *(step.term for step in kept)))
    return smaller, kept, structures(smaller)


def without_trifles(
    before: Fit,
    fitted: Fit,
    steps: list[Step],
    remains: list[Structure],
    progress: Progress,
) -> tuple[Fit, list[Step], list[Structure]]:
    """Take everything back where most of what repeats is still there.

    What the library lacks leaks into whatever resembles it a little; a small part explained
    beside a large part unexplained is no name. Sines leak into all that repeats: where there is
    nothing else, they have to explain more.
    """
    left = ceiling(fitted, remains)
    if _is_patchwork(steps):
        return (
            before,
            [],
            _given_up(before, steps, "is one of many that each explain a part", progress),
        )
    sines = bool(steps) and all(step.term.effect.fast for step in steps)
    if not steps or not (left.significant or (sines and left.t_value > TELLING_T)):
        return fitted, steps, remains
    first, last = before.rmse(sealed=False) ** 2, fitted.rmse(sealed=False) ** 2
    explained, unexplained = first - last, left.share * last
    if explained > (SINES_SHARE if sines else TRIFLE_SHARE) * (explained + unexplained):
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


def confirmed(
    before: Fit,
    fitted: Fit,
    steps: list[Step],
    remains: list[Structure],
    progress: Progress,
    gate: Gate,
) -> tuple[Fit, list[Step], list[Structure]]:
    """Take everything back where the sealed data do not bear it out.

    All steps stand or fall together: a choice among them would make the sealed data a part of
    the search. Slow noise can hide a true fall of the plain error. The whitened one of a true
    effect falls but for bad luck; it may rise by as much as the open data had beyond the gate.
    """
    if not steps:
        return fitted, steps, remains
    fall = sealed_fall(before, fitted)
    beyond = 2 * sum(np.log(gate.largest_p / max(step.p_value, 1e-300)) for step in steps)
    if fall.plain > 0 or fall.likelihood > -min(float(beyond), MOST_UNLUCKY):
        return fitted, steps, remains
    return before, [], _given_up(before, steps, "does not hold on the sealed data", progress)


def _given_up(before: Fit, steps: list[Step], why: str, progress: Progress) -> list[Structure]:
    """Note why steps were taken back; return the declared model's structures."""
    for step in steps:
        progress.take_back(step, why)
    return structures(before)
