"""A chain of effects: a fit with what it predicts of data that it was not fitted to."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from opamc_cli.joint.fit.model import MOST_ROUNDS, Fit, Term, fit_terms
from opamc_cli.joint.motion.track import Floats, Track
from opamc_cli.joint.name.significance import paired

Signature = frozenset[tuple[object, ...]]
PRICE = 0.02
"""Logarithm of the held-out mean square error per degree of freedom: 2 % of the error."""
MOST_CHARGED = 16
"""Coefficients of one effect that are charged: of a drive's answer in thirty, the held-out error
itself charges for those that are of no use."""

EXACT = 0.9
"""Share of its domain's curve, of the ceiling, or of what drift explains, that counts as all."""
HALF = 0.5
"""Share of its domain's curve from which a form has the name approximately; of what a line takes,
that lines beside it take where it is none; and of the error, beside functions without a name, that
must go for another window of the motion: with 0.6 they make up for a short window's noise."""


@dataclass(frozen=True)
class Chain:
    """A fitted model and its held-out error."""

    fit: Fit
    """All terms, the declared ones first."""
    added: int
    """Number of terms at the end that were not declared."""
    error: Floats
    """Sum of squares of each judged part, of the fit to all other units. Every moving sample is
    judged once: at the full rate where it is clear of corners of the motion, else on the coarse
    grid, where the current is as smooth as the motion; (p,)."""
    counts: Floats
    """Samples of each; (p,)."""

    @cached_property
    def deviation(self) -> Floats:
        """Root mean square of each judged part times its samples, in A; (p,)."""
        return deviation_of(self.error, self.counts)

    @property
    def terms(self) -> tuple[Term, ...]:
        """Terms that were not declared."""
        return self.fit.terms[len(self.fit.terms) - self.added :]

    @property
    def mean_square(self) -> float:
        """Square of the mean of the parts' root mean square errors, held out, in A^2.

        A part that is hard, or that noise or an unknown motion has hit, counts by its error and
        not by the error's square: which effects are there is seen in all parts.
        """
        return float(self.deviation.sum() / self.counts.sum()) ** 2

    @cached_property
    def price(self) -> float:
        """Logarithm of the mean square error by which the added terms have to pay."""
        added = self._valued[len(self.fit.terms) - self.added :]
        track = self.fit.dataset.fine.track
        return sum(price_of(term, values.size, track) for term, values in added)

    @property
    def score(self) -> float:
        """Logarithm of the held-out mean square error, and the price."""
        return float(np.log(max(self.mean_square, 1e-300))) + self.price

    @property
    def _valued(self) -> list[tuple[Term, Floats]]:
        return list(zip(self.fit.terms, self.fit.coefficients, strict=True))

    def plausible_beside(self, other: "Chain") -> bool:
        """Whether coefficients have the sign that physics gives them, or had another before.

        All of the added terms' have to. Declared dry friction may not be turned by friction that
        grows with the load: where that never passes zero, it does little else.
        """
        signs = self._signs
        first = len(signs) - self.added
        kept = zip(signs[:first], other._signs, self.fit.terms, strict=False)
        turned = any(b and not n and t.effect.name == "coulomb" for n, b, t in kept)
        return all(signs[first:]) and not (turned and self.terms[-1].effect.follows_load)

    def in_place(self) -> "Chain":
        """Put the last effect, if it has a name, in the place of what lost its sign by it."""
        *earlier, own = self._signs[len(self.fit.terms) - self.added :]
        chain, own = self, own and not self.terms[-1].effect.unnamed
        for place in reversed(np.flatnonzero(np.logical_not(earlier)).tolist() if own else []):
            chain = without(chain, place)
        return chain

    @cached_property
    def _signs(self) -> list[bool]:
        pairs, grid = self._valued, self.fit.dataset.fine
        way, speed = np.unique(grid.track.direction[grid.fit]), np.abs(grid.track.velocity)
        usual = float(np.median(speed[grid.fit])) if way.size else 0.0
        # At one speed dry and viscous friction are one, and of one way an offset is both; what has
        # built up over a way is dry friction.
        share = {"coulomb": 1.0, "viscous": usual, "offset": float(way.sum()) * (way.size == 1)}
        dry = sum(
            share.get(term.effect.name, float(term.effect.builds_up)) * float(values[0])
            for term, values in pairs
        )
        return [
            term.effect.plausible(values, term.parameters)
            or (term.effect.at_a_place and values[0] > -dry)
            or (term.effect.name == "coulomb" and dry > 0)
            for term, values in pairs
        ]

    @cached_property
    def signature(self) -> Signature:
        """What makes two chains the same."""
        return signature_of(self.terms, self.fit.dataset.fine.track)

    def gain_over(self, other: "Chain") -> tuple[float, float]:
        """Share of the other's held-out error that this chain takes away, and its t over parts."""
        _, t_value = _gain(other.deviation, self.deviation)
        return 1.0 - self.mean_square / max(other.mean_square, 1e-300), t_value

    def gain_beside_drift(self, other: "Chain") -> tuple[float, float]:
        """Likewise, where the current may drift: every part has an offset of its own."""
        return _gain(other.fit.drift_free_error, self.fit.drift_free_error)

    def no_more_than_drift(self, other: "Chain", least_share: float) -> bool:
        """Whether an offset for every half unit explains what this chain does and the other not.

        What still helps beside the offsets is more; so is what explains nine tenths of what all of
        them do, with fewer coefficients: they follow a slow noise better than any one step.
        """
        before, left = (float(one.fit.sums.held_out().sum()) for one in (other, self))
        as_drift = before - left < EXACT * (before - float(other.fit.drift_free_error.sum()))
        return self.gain_beside_drift(other)[0] < least_share and as_drift

    def gain_beside_smoothing(self, other: "Chain") -> float:
        """Share of the other's error, where both may make up for the smoothing of the motion."""
        return _gain(other.fit.unsmoothed_error, self.fit.unsmoothed_error)[0]


def chain_of(fit: Fit, added: int) -> Chain:
    """Judge a fit by its held-out errors."""
    dataset = fit.dataset
    fine, coarse = dataset.parts
    error = fit.sums.held_out()[fine.judged]
    counts = fine.counts[fine.judged]
    if not fine.judged.all() and not coarse.judged.all() and dataset.coarse is not dataset.fine:
        sums = fit.coarse_sums[0]
        unclear = ~coarse.judged
        error = np.concatenate([error, dataset.factor * sums.held_out()[unclear]])
        counts = np.concatenate([counts, dataset.factor * sums.parts.counts[unclear]])
    fit.forget()
    return Chain(fit, added, error, counts)


def deviation_of(error: Floats, counts: Floats) -> Floats:
    """Root mean squares times samples, from sums of squares over the first axis' parts."""
    return np.asarray(np.sqrt(np.maximum(error, 0.0) * counts))


def extended(chain: Chain, *terms: Term) -> Chain:
    """Add terms to a chain and fit all of it anew."""
    fit = fit_terms(chain.fit.dataset, (*chain.fit.terms, *terms))
    return chain_of(fit, chain.added + len(terms))


def without(chain: Chain, place: int, rounds: int = MOST_ROUNDS) -> Chain:
    """Take one of the added terms out, and fit the rest anew, in so many rounds at most."""
    place += len(chain.fit.terms) - chain.added
    terms = chain.fit.terms[:place] + chain.fit.terms[place + 1 :]
    return chain_of(fit_terms(chain.fit.dataset, terms, rounds), chain.added - 1)


def released(chain: Chain) -> Chain:
    """Fit a chain without ridges, where it predicts held-out data better so."""
    if not any(term.effect.ridge(term.parameters) for term in chain.terms):
        return chain
    free = fit_terms(replace(chain.fit.dataset, held=False), chain.fit.terms)
    return min(chain, chain_of(free, chain.added), key=lambda one: one.score)


def signature_of(terms: tuple[Term, ...], track: Track) -> Signature:
    """Effects, with the lines that they are and their other parameters to two digits."""

    def told(term: Term) -> tuple[object, ...]:
        line = next(iter(term.parameters), None) if term.effect.several else None
        rest = sorted((k, f"{v:.2g}") for k, v in term.parameters.items() if k != line)
        return term.effect.name, line_of(term, track), term.keep, *rest

    return frozenset(map(told, terms))


def line_of(term: Term, track: Track) -> float:
    """Which of several lines a term is, by its first parameter; 0 of an effect that comes once.

    In units of what two have to differ by: a track of many turns tells orders of 320 and 322 apart.
    To three digits where a user's effect has no first step.
    """
    if not term.effect.several or not term.parameters:
        return 0.0
    name, value = next(iter(term.parameters.items()))
    half = term.effect.first_steps(track, term.parameters).get(name, 0.0)
    return float(round(value / (2 * half)) if half > 0 else f"{value:.3g}")


def _gain(before: Floats, after: Floats) -> tuple[float, float]:
    drop, error = paired(after, before)
    return drop / max(float(before.sum()), 1e-300), drop / max(error, 1e-300)


def price_of(term: Term, width: int, track: Track) -> float:
    """Price of a term: the effect, its `width` coefficients and its searched parameters, alike."""
    # Of a line a cosine and its sine are one: a size, at whatever phase. No line is what turns so
    # seldom on the way that a smooth function holds it for no more than the most that is charged,
    # nor another joint.
    lines = term.effect.fast and term.effect.domain != "acceleration"
    if lines and not (term.effect.several and 2 * line_of(term, track) <= MOST_CHARGED):
        width = (width + 1) // 2
    charged = width if term.effect.unnamed else min(width, MOST_CHARGED)
    return PRICE * (1 + charged + term.effect.searched(term.parameters))
