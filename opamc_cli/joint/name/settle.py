"""What a chain keeps when each effect is asked again beside the others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from opamc_cli.joint.fit.model import Term, fit_terms
from opamc_cli.joint.name.chain import EXACT, HALF, PRICE, Chain, chain_of, extended, without
from opamc_cli.joint.name.search import LEAST_SHARE, Pool, Trial, Tried, objection, trials
from opamc_cli.joint.name.significance import LEAST_T, paired

MOST_ROUNDS = 4


@dataclass(frozen=True)
class Named:
    """An added effect, beside all the others."""

    trial: Trial
    """What it takes off the error that all the others leave."""
    others: tuple[Tried, ...]
    """What else was tried in its place."""
    ties: tuple[str, ...]
    """Effects that explain the data as well."""

    @property
    def term(self) -> Term:
        """The effect."""
        return self.trial.term


def settled(best: Chain, pool: Pool, unnamed: Pool) -> tuple[Chain, list[Named]]:
    """Drop what is not worth its price, take the name off what a function without one does better.

    The chain is changed a few times at most; its named effects come with their ties.
    """
    for _ in range(MOST_ROUNDS):
        changes = (_asked_again(best, place, pool, unnamed) for place in range(best.added))
        changed = next((chain for chain in changes if chain is not None), None)
        if changed is None:
            break
        best = changed
    named = []
    for place, term in enumerate(best.terms):
        if not term.effect.unnamed:
            parent = without(best, place)
            # What an effect ties with is of interest once nothing changes any more.
            others = trials(parent, pool, {best.signature}) if changed is None else []
            alike = term.effect.ties(term.parameters, best.fit.dataset.fine.track)
            ties = tuple(dict.fromkeys((*ties_of(best, term.effect.name, others), *alike)))
            told = tuple(one.told for one in others)
            named.append(Named(_trial(parent, term, pool), told, ties))
    return best, named


def ties_of(best: Chain, name: str, others: Sequence[Trial]) -> tuple[str, ...]:
    """Return the effects that in the place of one leave no surely, or no much, larger error."""
    found = []
    for other in others:
        difference, error = paired(best.deviation, other.chain.deviation)
        near = difference <= LEAST_T * error or other.chain.score < best.score + LEAST_SHARE
        if other.why_not is None and near:
            found.append(other.term.effect.name)
    return tuple(other for other in dict.fromkeys(found) if other != name)


def worth_their_price(chain: Chain) -> Chain:
    """Drop functions and lines that are not worth their price, at the load of the whole chain."""
    kept, place = chain, 0
    while place < kept.added:
        parent = without(kept, place, rounds=1)
        effect = kept.terms[place].effect
        drop = (effect.unnamed or effect.fast) and parent.score <= kept.score
        kept, place = (parent, 0) if drop else (kept, place + 1)
    return chain if kept is chain else extended(kept)


def lowering(chain: Chain) -> Chain:
    """Drop what takes less than PRICE off the mean square error of all open samples, least first.

    Beside corners it may rise, and a part that alone tells of a term is extrapolated if left out.
    A name goes if it takes no more beside the other names alone: functions hold most of them.
    """
    while chain.added:
        fewer = [without(chain, place) for place in range(chain.added)]
        rises = [_rise(*both, chain) for both in zip(fewer, chain.terms, strict=True)]
        if min(rises) >= 0:
            break
        chain = fewer[rises.index(min(rises))]
    return chain


def _rise(fewer: Chain, term: Term | None, chain: Chain) -> float:
    rise = fewer.fit.rmse(sealed=False) - (1 + PRICE / 2) * chain.fit.rmse(sealed=False)
    if rise >= 0 or term is None or term.effect.unnamed:
        return rise
    return max(rise, _rise(only_named(fewer), None, only_named(chain)))


def only_named(chain: Chain) -> Chain:
    """Leave the functions without a name out of a chain."""
    terms = tuple(term for term in chain.fit.terms if not term.effect.unnamed)
    added = chain.added - (len(chain.fit.terms) - len(terms))
    return chain if added == chain.added else chain_of(fit_terms(chain.fit.dataset, terms), added)


def _asked_again(best: Chain, place: int, pool: Pool, unnamed: Pool) -> Chain | None:
    """Return a better chain without one effect, or with another in its place; None if none is."""
    term = best.terms[place]
    parent = without(best, place)
    if parent.score <= best.score:
        return parent
    if term.effect.unnamed:
        return None
    if _trial(parent, term, pool).why_not is not None:
        passing = [other.chain for other in trials(parent, pool) if other.why_not is None]
        return min(passing, key=lambda chain: chain.score, default=parent)
    if "unnamed" not in pool.without:
        for rival in trials(parent, _rivals_of(term, unnamed)):
            if rival.why_not is None and _takes_the_name(rival.chain, best, parent, term):
                return rival.chain
    return None


def _rivals_of(term: Term, unnamed: Pool) -> Pool:
    """Return the functions without a name that may stand in the place of an effect.

    A line that shakes the joint is in the measured acceleration, too: what looks at that, or
    filters it, is no rival.
    """
    library = {
        name: one
        for name, one in unnamed.library.items()
        if not one.fast
        and not (term.effect.fast and (one.domain == "acceleration" or one.as_smoothing))
    }
    return replace(unnamed, library=library)


def _takes_the_name(rival: Chain, best: Chain, parent: Chain, term: Term) -> bool:
    """Whether a smooth function without a name stands in the place of an effect.

    Where a smooth function does as well as a line (another joint's motion is none), it is no line,
    but for one that still takes half of it beside the function: that explains something else. A
    name that holds nine tenths of what it explains stays: the rest is asked for beside it.
    """
    if term.effect.fast and term.effect.domain != "acceleration":
        difference, error = paired(rival.deviation, best.deviation)
        alike = rival.score < best.score + LEAST_SHARE and difference > -LEAST_T * error
        kept = HALF * (parent.score - best.score)
        return alike and rival.score - extended(rival, term).score < kept
    if rival.score >= best.score - LEAST_SHARE:
        return False
    named, explained = (parent.mean_square - one.mean_square for one in (best, rival))
    if named >= EXACT * explained:
        return False
    # What follows slow noise is no better form of an effect.
    share, t_value = rival.gain_beside_drift(best)
    return share > LEAST_SHARE and t_value > LEAST_T


def _trial(parent: Chain, term: Term, pool: Pool) -> Trial:
    """Judge an effect as if it were added last: the same chain in another order."""
    chain = extended(parent, term)
    return Trial.of(parent, chain, objection(chain, parent, pool))
