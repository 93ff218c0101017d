"""Follow several chains of effects side by side, and keep the one that is worth its price."""

import math
from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.library import Library
from opamc_cli.joint.fit.model import Dataset, Term
from opamc_cli.joint.name.candidates import (
    LEAST_LEFT,
    Batch,
    Beside,
    Candidate,
    batches_of,
    best_forms,
)
from opamc_cli.joint.name.chain import (
    HALF,
    PRICE,
    Chain,
    Signature,
    extended,
    line_of,
    signature_of,
)
from opamc_cli.joint.name.refine import refined
from opamc_cli.joint.name.significance import LEAST_T, p_value

CHAINS = 2
"""Followed side by side: a bump that imitates a spring shows itself only beside the spring. Four
find no more than two."""
LEAST_SHARE = 0.05
"""Of the held-out mean square error: what a user would care about. Where an effect stands against a
function without a name, scores that differ by less do not differ."""
MOST_STEPS = 16
"""Effects added at most; a measured joint has six lines."""
COARSE = 3
"""Forms of a load's friction beside each guess; nearer shares are for one that is found."""
TRIED = 4
"""Candidates of a chain that are refined, and fitted jointly: the work of a round is bounded."""


@dataclass(frozen=True)
class Pool:
    """What may be added, with the regressors that do not follow the model computed once."""

    slow: list[Batch]
    """Guesses of effects that do not follow the model, on the coarse grid."""
    library: Library
    """Everything that may be added."""
    least_share: float = LEAST_SHARE
    """Of the held-out error, that an effect has to take away."""
    without: Collection[str] = field(default=())
    """Rules that are switched off."""
    asked: dict[Hashable, list[Candidate]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    """What `candidates` found beside which terms: chains are met again."""

    @classmethod
    def of(cls, dataset: Dataset, library: Library, without: Collection[str] = ()) -> "Pool":
        """Lay every effect's grid of parameters on a dataset's coarse grid."""
        track = dataset.coarse.track
        terms = [
            term
            for effect in library.values()
            if not effect.fast and effect.from_motion and not effect.untestable(track)
            for term in guessed(effect, dataset)
        ]
        share = 0.0 if "share" in without else LEAST_SHARE
        return cls(batches_of(dataset, terms, fine=False), library, share, without)


@dataclass(frozen=True)
class Tried:
    """What a trial said of an effect."""

    term: Term
    """The effect."""
    score: float
    """Of the chain with it less that of the chain without."""
    gain: float
    t_value: float
    p_value: float
    """With `gain`, `t_value`: share of the held-out error of all the others that it takes away,
    over its standard error over parts of the data, and the probability of such a ratio by
    chance."""
    why_not: str | None
    """None where the effect may be added."""


@dataclass(frozen=True)
class Trial(Tried):
    """A trial with its fits, which nobody needs in the end."""

    parent: Chain
    chain: Chain
    """With `parent`: without and with the effect."""

    @classmethod
    def of(cls, parent: Chain, chain: Chain, why_not: str | None = None) -> "Trial":
        """Hold a chain against the one without its last effect."""
        gain, t_value = chain.gain_over(parent)
        chance = p_value(t_value, chain.error.size)
        score = chain.score - parent.score
        return cls(chain.fit.terms[-1], score, gain, t_value, chance, why_not, parent, chain)

    @property
    def told(self) -> Tried:
        """What is told of it in the end."""
        return Tried(**{one.name: getattr(self, one.name) for one in fields(Tried)})


def guessed(effect: Effect, dataset: Dataset) -> list[Term]:
    """Every guess of a slow effect, and the smaller forms of each."""
    track = dataset.coarse.track
    terms = [Term(effect, parameters) for parameters in effect.guesses(track, np.zeros(track.size))]
    most = COARSE if effect.follows_load else None
    return [form for term in terms for form in (term, *_variants(term)[:most])]


def _variants(term: Term) -> list[Term]:
    """Smaller forms of an effect."""
    forms = term.effect.variants(term.parameters)
    return [Term(term.effect, parameters, keep) for parameters, keep in forms]


def candidates(chain: Chain, pool: Pool, every: bool = False) -> list[Candidate]:
    """Best guess of every effect beside a chain, refined, best first; hopeless ones if `every`."""
    asked = frozenset(term.key for term in chain.fit.terms), every
    if asked in pool.asked:
        return pool.asked[asked]
    dataset = chain.fit.dataset
    present = {term.effect.name for term in chain.fit.terms if not term.effect.several}
    slow = Beside(chain, fine=False)
    free = [effect for effect in pool.library.values() if effect.name not in present]
    following = [
        term
        for effect in free
        if not effect.fast
        and not effect.from_motion
        and not effect.untestable(dataset.coarse.track)
        for term in guessed(effect, dataset)
    ]
    guesses = slow.candidates((*pool.slow, *batches_of(dataset, following, fine=False)))
    found = [one for one in guesses if one.term.effect in free]
    among_fast = any(term.effect.fast for term in chain.fit.terms)
    fast = Beside(chain, fine=True) if among_fast or any(one.fast for one in free) else slow
    if among_fast:
        # What a drive makes of a ripple takes up friction, too: beside it as it was fitted without
        # a slow effect, that may show as little, or best in a form that it has not.
        forms = _best_of_each(found, lambda term: (term.effect.name, term.keep))
        again = [candidate.term for candidate in forms]
        found += fast.candidates(batches_of(dataset, again, fine=True))
    residual = np.where(dataset.sharp.fit, chain.fit.residual_a, 0.0)
    for effect in free:
        if effect.fast and not effect.untestable(dataset.fine.track):
            for parameters in effect.guesses(dataset.fine.track, residual):
                found += best_forms(dataset, fast, Term(effect, parameters))
    # Two lines of one kind are two candidates; so is a line that follows the model without it.
    track = dataset.fine.track
    best = _best_of_each(found, lambda t: (t.effect.name, t.form, line_of(t, track), t.is_constant))
    best.sort(key=lambda one: one.promise)
    least = np.inf if every else 0.0
    better = []
    for candidate in [one for one in best if one.score < least][:TRIED]:
        beside = fast if candidate.term.effect.fast else slow
        trial = beside.candidate(refined(candidate.term, beside))
        if among_fast and beside is slow:
            trial = max(trial, fast.candidate(trial.term), key=lambda one: one.gain)
        # A parameter that was moved to a value with a meaning may cost a trifle.
        better.append(trial if trial.gain > (1 - PRICE) * candidate.gain else candidate)
    chain.fit.forget()
    pool.asked[asked] = sorted(better, key=lambda candidate: candidate.score)
    return pool.asked[asked]


def _best_of_each(found: list[Candidate], kind: Callable[[Term], Hashable]) -> list[Candidate]:
    """Return the best candidate of each kind, best first."""
    best: dict[Hashable, Candidate] = {}
    for candidate in sorted(found, key=lambda one: one.score):
        best.setdefault(kind(candidate.term), candidate)
    return list(best.values())


def trials(chain: Chain, pool: Pool, known: set[Signature] | None = None) -> list[Trial]:
    """Fit a chain's most promising candidates, and say of each whether it may be added.

    Chains that are `known` are not tried again; new ones are added.
    """
    tried = set() if known is None else known
    ordered = [[one.term] for one in candidates(chain, pool) if not one.term.effect.follows_load]
    found = []
    for forms in (*ordered, *_by_load(chain, pool)):
        track = chain.fit.dataset.fine.track
        signatures = {chain.signature | signature_of((term,), track) for term in forms}
        if not signatures.isdisjoint(tried):
            continue
        tried |= signatures
        child = _best_with(chain, forms)
        if forms[0].effect.follows_load:
            worth = child.gain_over(chain)[0] >= pool.least_share
            for some in (slice(COARSE), slice(COARSE, None)) if worth else (slice(1),):
                following = _variants(child.terms[-1])[some]
                while (new := _best_with(chain, following, child)) is not child:
                    child, following = new, _variants(new.terms[-1])[some]
        child = child.in_place()
        found.append(Trial.of(chain, child, objection(child, chain, pool)))
    return found


def _best_with(chain: Chain, forms: Sequence[Term], *others: Chain) -> Chain:
    """Extend a chain by each of some forms, and choose among these chains and some others."""
    children = (*others, *(extended(chain, term) for term in forms))
    return min(children, key=lambda one: (not one.plausible_beside(chain), one.score))


def _by_load(chain: Chain, pool: Pool) -> list[list[Term]]:
    """Guesses of each effect that follows the load and moves its zero: all are fitted."""
    dataset = chain.fit.dataset
    present = {term.effect.name for term in chain.fit.terms}
    track = dataset.coarse.track
    return [
        [Term(effect, parameters) for parameters in effect.guesses(track, np.zeros(track.size))]
        for effect in pool.library.values()
        if effect.follows_load and effect.name not in present and not effect.untestable(track)
    ]


def objection(child: Chain, parent: Chain, pool: Pool) -> str | None:
    """Say why the last effect of a chain is not worth adding, or None where it is."""
    share, t_value = child.gain_over(parent)
    effect, form = child.terms[-1].effect, child.terms[-1].form
    error = 0.0 if effect.unnamed else abs(share) / max(abs(t_value), 1.0)
    # What one effect leaves, beside a motion that the same phases tell, is no other one.
    followed = "logged" not in child.fit.dataset.fine.track.channels
    beside = followed and any(not term.effect.unnamed for term in parent.terms)
    if share - (LEAST_T if beside else 1.0) * error < (least := pool.least_share):
        some = f"{share:.1%} ± {error:.1%}" if share > 0 else "nothing"
        return f"takes {some} off the error; {least:.0%} is asked beyond that"
    if "sign" not in pool.without and not child.plausible_beside(parent):
        return "its sign, or its size, is not physical"
    if "decoys" not in pool.without and not _is_known(child.terms[-1], parent):
        return "lines beside it explain as much: it is none"
    drifts = effect.changes_in_time and "drift" not in pool.without
    if drifts and child.no_more_than_drift(parent, pool.least_share):
        return "slow noise explains it as well: within parts of the data nothing speaks for it"
    smooths = effect.as_smoothing and not form and "smoothing" not in pool.without
    if smooths and child.gain_beside_smoothing(parent) < pool.least_share:
        return "what the smoothing takes from the measured motion explains it as well"
    return None


def _is_known(line: Term, parent: Chain) -> bool:
    """Whether lines that are surely other ones take less than half of it, as a logarithm."""
    others = line.effect.decoys(line.parameters, parent.fit.dataset.fine.track)
    if not others:
        return True
    beside = Beside(parent, fine=True)
    alike = [replace(line, parameters=one) for one in (line.parameters, *others)]
    own, *rest = (-math.log(max(1 - beside.candidate(one).gain, LEAST_LEFT)) for one in alike)
    parent.fit.forget()
    return sum(rest) < HALF * own * len(rest)


def beam(start: Chain, pool: Pool, width: int = CHAINS, steps: int = MOST_STEPS) -> Chain:
    """Follow `width` chains side by side as far as the score falls, `steps` at most."""
    chains = [start]
    best, width = start, 1 if "beam" in pool.without else width
    known: set[Signature] = set()
    for _ in range(steps):
        tried = [trial for chain in chains for trial in trials(chain, pool, known)]
        following = [trial.chain for trial in tried if trial.why_not is None]
        # One of each kind: two lines, or two places, are one idea.
        kinds: dict[tuple[str, ...], Chain] = {}
        for chain in sorted(following, key=lambda chain: chain.score):
            kinds.setdefault(tuple(sorted(term.effect.name for term in chain.terms)), chain)
        chains = list(kinds.values())[:width]
        if not chains or chains[0].score >= best.score:
            break
        best = chains[0]
    return best
