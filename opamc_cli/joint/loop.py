"""Close the loop: explain, name, and open the sealed data once."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.explain.declared import Ways
from opamc_cli.joint.explain.saturated import Ceiling, ceiling, saturations, unnamed_library
from opamc_cli.joint.fit.model import Fit, Term
from opamc_cli.joint.fit.parts import ROUNDING
from opamc_cli.joint.name.chain import (
    EXACT,
    HALF,
    PRICE,
    Chain,
    chain_of,
    extended,
    released,
    without,
)
from opamc_cli.joint.name.form import share_of_form
from opamc_cli.joint.name.search import LEAST_SHARE, Pool, Trial, Tried, beam, trials
from opamc_cli.joint.name.settle import Named, lowering, only_named, settled, worth_their_price
from opamc_cli.joint.name.significance import decoy_gain
from opamc_cli.signal.motion.smoothing import measurement_noise

RAISES = "the other effects, or functions without a name, explain as much without it"
TWICE = 2.0
"""The open samples' error: sealed ones of 34 joints had 0.7 to 1.7 times it, one changed 2.6."""


@dataclass(frozen=True)
class Step:
    """An effect that was added, with what spoke for it."""

    trial: Tried
    """Effect, parameters, and what they take off the error."""
    interpretation: str
    """What it means to a maintainer."""
    decoy_gain: float
    """What the same regressors take off a residual whose signs were drawn at random."""
    ties: tuple[str, ...]
    """Effects that explain the data as well."""
    fit_of_name: float
    """Share of its domain's curve that the named form holds."""
    rmse_before_a: float
    rmse_after_a: float
    """With `rmse_before_a`: error of the open data when the steps are added in order."""

    @property
    def term(self) -> Term:
        """Effect and parameters."""
        return self.trial.term

    @property
    def approximate(self) -> bool:
        """Whether the form holds less than nine tenths of the curve."""
        return self.fit_of_name < EXACT

    @property
    def named(self) -> bool:
        """Whether the step is an effect of the library."""
        return not self.term.effect.unnamed


@dataclass(frozen=True)
class Loop:
    """What closing the loop found on one axis."""

    before: Fit
    after: Fit
    """With `before`: the declared and the extended model, fitted to the open groups."""
    steps: tuple[Step, ...]
    """Effects added, largest first; functions without a name are among them."""
    tried: tuple[tuple[int, Tried], ...]
    """What was asked beside the final model, with the step in whose place it was tried."""
    rejected: tuple[Tried, ...]
    """The best form of each effect that was not added, and why."""
    untestable: dict[str, str]
    """Effects that the recordings cannot show, and why."""
    ceiling: Ceiling
    """What can be explained of the sealed data without a name."""
    predicts: bool
    """Whether the extended model holds on the sealed data as on the open ones."""
    verdict: str
    """"nothing-missing", "closed", "partial" or "not-in-library"."""
    rmse_before_a: float
    rmse_after_a: float
    r2_before: float
    r2_after: float
    """With `rmse_before_a`, `rmse_after_a`, `r2_before`: on the sealed data."""
    floor_a: float
    """Sealed error that the ceiling leaves."""
    noise_a: float
    """Standard deviation of what changes from sample to sample in the final residual."""
    explained_share: float
    """Share of the ceiling that named effects reach, 0 to 1."""
    remaining_domain: str | None
    """Where something without a name is left."""
    unconfirmed: tuple[str, ...]
    """Effects of the library, found in the open data, that do not hold on the sealed ones."""
    asked: tuple[Term, ...] = ()
    """Named effects before any was dropped for the error that it raised."""


TAKEN_UP = ("quadratic_friction", "asymmetric_friction")


def close_loop(
    before: Fit,
    library: Library,
    seed: int = 0,
    without_rules: Collection[str] = (),
    ways: Ways | None = None,
) -> Loop:
    """Find, name and add what the declared model, fitted to the open groups, lacks.

    The sealed ones are looked at once, at the end. Rules of docs/loop.md can be switched off. Where
    `ways` has a better motion beside what may lack, or beside what was found, that is closed.
    """
    told = ways.fit_anew(before) if ways is not None else None
    loop = _closed(told or before, library, seed, without_rules, before, ways)
    if told is not None and loop.rmse_after_a > loop.rmse_before_a:  # As all that does not hold.
        return _closed(before, library, seed, without_rules, before)
    # An open Stribeck curve may have taken up such friction, of which a function is left.
    left = [s for s in loop.steps if s.term.effect.unnamed and s.term.effect.domain == "velocity"]
    beside = loop.asked or tuple(Term(library[n], {}) for n in TAKEN_UP if left and n in library)
    again = ways.fit_anew(loop.before, beside) if ways is not None and beside else None
    if again is None:
        return loop
    other = _closed(again, library, seed, without_rules, before)
    better = other.after.rmse(sealed=False) < loop.after.rmse(sealed=False)
    holds = other.rmse_after_a <= loop.rmse_before_a and other.predicts >= loop.predicts
    return other if better and holds else loop


def _closed(
    before: Fit,
    library: Library,
    seed: int,
    without_rules: Collection[str],
    best_before: Fit,
    ways: Ways | None = None,
) -> Loop:
    start = chain_of(before, 0)
    unnamed = Pool.of(before.dataset, unnamed_library(), without=without_rules)
    saturated = saturations(start, unnamed)
    pool = Pool.of(before.dataset, library, without=without_rules)
    # An arm's own dynamics are there; beside them nothing else has to hold what they ask.
    arm = replace(pool, library={n: e for n, e in library.items() if "others" in e.needs})
    linked = beam(start, arm)
    chains = [beam(one, pool) for one in ((start,) if linked is start else (start, linked))]
    best = min(chains, key=lambda one: one.score)
    if ways is not None and (turned := ways.turned(best.fit)) is not None:
        return _closed(turned, library, seed, without_rules, turned)
    best, named = settled(best, pool, unnamed)
    best, named, shares = _with_true_names(best, named, pool, unnamed)
    final = worth_their_price(beam(best, unnamed, width=1))
    if "unnamed" not in without_rules:  # Or beside the functions that explain most.
        beside = worth_their_price(extended(saturated[0], *(one.term for one in named)))
        if beside.score < final.score - LEAST_SHARE:
            final = extended(start, *sorted(beside.terms, key=lambda term: term.effect.unnamed))
    # All functions do as well as smooth ones, and have been searched.
    able = named and saturated[0].score < final.score - LEAST_SHARE
    if able and "unnamed" not in without_rules and "alone" not in without_rules:
        alone = _without_names(start, named, unnamed)
        single = min((extended(start, one.term) for one in named), key=lambda one: one.score)
        held, explained = (start.mean_square - one.mean_square for one in (single, alone))
        if alone.score < final.score - LEAST_SHARE:
            # One name that holds what they do, but for what nobody cares about, is the thing.
            holds = held >= (1 - LEAST_SHARE) * explained
            final = worth_their_price(beam(single, unnamed, width=1)) if holds else alone
    final = lowering(final)
    final, names = released(final), released(only_named(final))
    steps = _steps(start, final, named, shares, seed)
    kept = {id(term) for term in final.terms}
    told = [one.trial.told for one in named]
    told = [t if id(t.term) in kept else replace(t, why_not=RAISES) for t in told]
    tried = [(i, t) for i, one in enumerate(named) for t in (told[i], *one.others)]
    tried += [(len(named), trial.told) for trial in trials(best, pool)]
    loop = _opened((before, names.fit, final.fit, best_before), saturated, steps, tried, library)
    return replace(loop, asked=tuple(one.term for one in named))


def _without_names(start: Chain, named: list[Named], unnamed: Pool) -> Chain:
    """Explain by smooth functions alone what several names may hold that are all none.

    By no lines, of which any motion that repeats is a sum, and by no shift or response in the place
    of an effect that is one: it would be the same without its name.
    """
    measuring = any(one.term.effect.as_smoothing for one in named)
    library = {
        name: one
        for name, one in unnamed.library.items()
        if not (one.fast or (one.as_smoothing and measuring))
    }
    return worth_their_price(beam(start, replace(unnamed, library=library), width=1))


def _with_true_names(
    best: Chain, named: list[Named], pool: Pool, unnamed: Pool
) -> tuple[Chain, list[Named], dict[int, float]]:
    """Take the name off effects whose form holds less than half of their domain's curve."""
    shares: dict[int, float] = {}
    for one in named:
        drop = one.trial.parent.mean_square - one.trial.chain.mean_square
        share = share_of_form(best, drop, one.term, unnamed)
        if share >= HALF or "unnamed" in pool.without:
            shares[id(one.term)] = share
            continue
        place = [term is one.term for term in best.terms].index(True)
        best, named = settled(without(best, place), replace(pool, library={}), unnamed)
        return best, named, {id(other.term): 1.0 for other in named}
    return best, named, shares


def _steps(
    start: Chain, final: Chain, named: list[Named], shares: dict[int, float], seed: int
) -> list[Step]:
    by_term = {id(one.term): one for one in named}
    steps: list[Step] = []
    chain, track = start, final.fit.dataset.fine.track
    for term in final.terms:
        following = extended(chain, term)
        known = by_term.get(id(term))
        trial = Trial.of(chain, following) if known is None else known.trial
        steps.append(
            Step(
                trial=trial.told,
                interpretation=term.effect.interpretation(term.parameters, track),
                decoy_gain=decoy_gain(trial.parent.fit, term, seed),
                ties=() if known is None else known.ties,
                fit_of_name=shares.get(id(term), 1.0) if known is not None else 0.0,
                rmse_before_a=chain.fit.rmse(sealed=False),
                rmse_after_a=following.fit.rmse(sealed=False),
            )
        )
        chain = following
    return steps


def _opened(
    fits: tuple[Fit, Fit, Fit, Fit],
    saturated: Sequence[Chain],
    steps: list[Step],
    tried: list[tuple[int, Tried]],
    library: Library,
) -> Loop:
    before, named, after, best_before = fits
    # What either explains can be explained.
    ceilings = [(ceiling(before, chain.fit), chain) for chain in saturated]
    found, explained = max(ceilings, key=lambda pair: pair[0].share)
    rmse_named, rmse_after = named.rmse(sealed=True), after.rmse(sealed=True)
    # The declared model is not to look worse than where it was fitted best.
    least = min(before, best_before, key=lambda fit: fit.rmse(sealed=True))
    rmse_before = least.rmse(sealed=True)
    scale = (before.rmse(sealed=True) / max(rmse_before, 1e-300)) ** 2
    found = Ceiling(max(1.0 - scale * (1.0 - found.share), 0.0), scale * found.standard_error)
    refused: list[Tried] = []
    if steps and rmse_after**2 > (1.0 - PRICE) * rmse_before**2:
        # Functions without a name first, then all: steps are never chosen among by the sealed data.
        hold = rmse_named**2 <= (1.0 - PRICE) * rmse_before**2
        why = "does not hold on the sealed data"
        refused = [replace(one.trial, why_not=why) for one in steps if not (one.named and hold)]
        steps = [one for one in steps if one.named and hold]
        after, rmse_named = (named, rmse_named) if hold else (before, rmse_before)
        rmse_after = rmse_named
    unconfirmed = tuple(t.term.effect.name for t in refused if not t.term.effect.unnamed)
    added = {one.term.effect.name for one in [step.trial for step in steps] + refused}
    # What is above the noise may all be there to explain, where functions tell nothing for certain.
    final = after.residual_a[after.dataset.sharp.fit]
    # A line near half the rate is none: in every second sample it hardly changes.
    halves = max(measurement_noise(final[start::2]) for start in (0, 1))
    noise_a = min(measurement_noise(final), halves)
    reach = found.share * rmse_before**2 if found.certain else rmse_before**2 - noise_a**2
    at_noise = noise_a**2 >= EXACT * rmse_named**2
    reached = 1.0 if at_noise or reach <= 0 else (rmse_before**2 - rmse_named**2) / reach
    # What predicts no better than the mean, or far worse than it fits, lacks something for certain.
    r2_after = after.sealed_r2
    predicts = r2_after > 0 and rmse_after <= TWICE * after.rmse(sealed=False)
    predicts |= r2_after > 1 - ROUNDING
    # Where a form holds a part of its curve, or a function stands beside the names, more lacks.
    # But for what any lag between the channels makes of the model, and any bearing of reversals.
    effects = [one.term.effect for one in steps]
    parts = [not (e.unnamed and (e.from_terms or e.builds_up)) for e in effects]
    of_parts = [one for one, part in zip(steps, parts, strict=True) if part]
    whole = not any(one.approximate for one in of_parts)
    if any(step.named for step in steps):
        verdict = "closed" if reached >= EXACT and predicts and whole else "partial"
    else:
        unknown = found.certain or bool(steps) or not predicts
        unknown |= not at_noise and bool(unconfirmed)
        verdict = "not-in-library" if unknown else "nothing-missing"
        reached = 0.0 if verdict == "not-in-library" else 1.0
    domain = None
    if verdict in ("partial", "not-in-library"):
        left = [s for s in steps if not s.named] or [s for s in steps if s.approximate]
        unexplained = [term.effect.domain for term in explained.terms if term.effect.unnamed]
        domain = left[0].term.effect.domain if left else next(iter(unexplained), None)
    return Loop(
        before=before,
        after=after,
        steps=tuple(steps),
        tried=tuple(tried),
        rejected=(*refused, *_rejected(tried, added)),
        untestable=untestable(before, library),
        ceiling=found,
        predicts=predicts,
        verdict=verdict,
        rmse_before_a=rmse_before,
        rmse_after_a=rmse_after,
        r2_before=least.sealed_r2,
        r2_after=r2_after,
        floor_a=min(rmse_before * float(np.sqrt(max(1.0 - found.share, 0.0))), rmse_after),
        noise_a=noise_a,
        explained_share=float(np.clip(reached, 0.0, 1.0)),
        remaining_domain=domain,
        unconfirmed=unconfirmed,
    )


def _rejected(tried: list[tuple[int, Tried]], added: set[str]) -> list[Tried]:
    rest = sorted((t for _, t in tried if t.term.effect.name not in added), key=lambda t: t.gain)
    best = {trial.term.effect.name: trial for trial in rest}
    better = "another effect explains the residual better"
    found = [replace(trial, why_not=trial.why_not or better) for trial in best.values()]
    return sorted(found, key=lambda one: -one.gain)


def untestable(before: Fit, library: Library) -> dict[str, str]:
    """Say of the effects that the recordings cannot show why."""
    reasons = {n: effect.untestable(before.dataset.fine.track) for n, effect in library.items()}
    return {name: why for name, why in reasons.items() if why is not None}
