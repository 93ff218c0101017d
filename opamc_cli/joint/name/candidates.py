"""Every effect on a coarse grid of its parameters, and what each would take off a chain's error."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

from opamc_cli.joint.fit.model import Dataset, Term
from opamc_cli.joint.fit.parts import Parts
from opamc_cli.joint.motion.track import Floats, Ints, Track
from opamc_cli.joint.name.chain import Chain, deviation_of, price_of
from opamc_cli.signal.transform.least_squares import SINGULAR_BELOW

Products = dict[Hashable, Floats]

LEAST_LEFT = 1e-6
"""Share of the error that is left at least: a coarse grid may promise more than there is."""


@dataclass(frozen=True)
class Candidate:
    """An effect with parameters, and the share of the held-out error that it would take away."""

    term: Term
    gain: float
    score: float
    of_error: float = 1.0
    """Share of the full rate's error that its grid holds: averaged, less is left, of which a guess
    takes several times the share."""

    @property
    def promise(self) -> float:
        """The score that this would be at the full rate, by which it comes before others."""
        left, all_left = (max(1 - of * self.gain, LEAST_LEFT) for of in (1.0, self.of_error))
        return self.score + float(np.log(all_left / left))


@dataclass(frozen=True)
class Batch:
    """Regressors of many guesses of equal width, on the parts' rows."""

    terms: Sequence[Term]
    """K guesses."""
    columns: Floats
    """Guess after guess; (m, K * w)."""
    own: Floats
    """Products of each guess with itself; (p, K, w, w)."""
    moment: Floats
    """Products with the current; (p, K, w)."""
    beside: Products = field(default_factory=dict, repr=False, compare=False)
    """Products with other terms, of those that were asked for."""


def batches_of(dataset: Dataset, terms: Sequence[Term], fine: bool) -> list[Batch]:
    """Compute the regressors of guesses and their products, by width."""
    parts, track = dataset.parts[0 if fine else 1], dataset.grid_of(fine).track
    current = track.current_a[parts.rows][:, None]
    alike: dict[tuple[int, bool], list[tuple[Term, Floats]]] = {}
    for term in terms:
        shared = term.effect.from_terms  # Many chains have the same static terms.
        block = dataset.columns(term, fine) if shared else term.columns(track, parts.rows)
        alike.setdefault((block.shape[1], term.effect.whole), []).append((term, parts.taken(block)))
    batches = []
    for (width, _), members in alike.items():
        count = len(members)
        blocks = [block for _, block in members]
        columns = blocks[0] if count == 1 else np.concatenate(blocks, axis=1)
        own = np.stack([parts.products(block, block) for block in blocks], axis=1)
        moment = parts.products(columns, current)[:, :, 0].reshape(-1, count, width)
        batches.append(Batch([term for term, _ in members], columns, own, moment))
    return batches


def judged(term: Term, gain: float, width: int, track: Track, of_error: float = 1.0) -> Candidate:
    """Turn a share of the held-out mean square error into a candidate's score."""
    left = max(1.0 - gain, LEAST_LEFT)
    return Candidate(term, gain, float(np.log(left)) + price_of(term, width, track), of_error)


def best_forms(dataset: Dataset, beside: "Beside", full: Term) -> list[Candidate]:
    """Choose the form that is worth its price; if it follows the model, one that does not, too."""
    effect = full.effect
    (batch,) = batches_of(dataset, [full], fine=True)
    forms = [(full, tuple(range(batch.own.shape[-1])))]
    for form, keep in effect.variants(full.parameters):
        forms.append((Term(effect, form, None if effect.flags_choose_columns else keep), keep))
    gains = beside.gains_of_forms(batch, [(term, np.asarray(keep)) for term, keep in forms])
    pairs = zip(forms, gains, strict=True)
    found = [judged(term, gain, len(keep), dataset.fine.track) for (term, keep), gain in pairs]
    steady = [one for one in found if one.term.is_constant]
    best = [min(some, key=lambda one: one.score) for some in (found, steady) if some]
    return best[: 1 + (best[0] is not best[-1])]


class Beside:
    """A chain's own regressors on one grid, made ready to have candidates put beside them."""

    def __init__(self, chain: Chain, fine: bool) -> None:
        self.dataset = dataset = chain.fit.dataset
        self.fine = fine or dataset.coarse is dataset.fine
        self.parts: Parts = dataset.parts[0 if self.fine else 1]
        self.counted = self.parts.judged if self.fine else np.ones_like(self.parts.judged)
        self.fast_part: Floats | None = None
        if self.fine:
            self.terms = chain.fit.terms
            blocks = [dataset.columns(term, True) for term in self.terms]
            self.sums = dataset.sums(self.terms, True, blocks=blocks)
        else:
            self.terms = tuple(term for term in chain.fit.terms if not term.effect.fast)
            self.sums, blocks, fast = chain.fit.coarse_sums
            self.fast_part = fast[self.parts.rows]
        self.blocks = [dataset.cache.rows(block, self.parts, self.fine) for block in blocks]
        self.before, self.inverses = self.sums.held_out(), self.sums.inverses
        self.counts = self.parts.counts[self.counted]
        self.left = float(deviation_of(self.before[self.counted], self.counts).sum())
        share = (self.left / self.counts.sum()) ** 2 / max(chain.mean_square, 1e-300)
        self.of_error = 1.0 if self.fine else min(share, 1.0)

    def products(self, columns: Floats, kept: Products | None = None) -> Floats:
        """Products of the chain's regressors with others over each part, shape (p, b, k).

        Those with terms that stay the same are `kept` from one chain to the next.
        """
        kept = {} if kept is None else kept
        asked = [
            pair for pair in zip(self.terms, self.blocks, strict=True) if pair[0].key not in kept
        ]
        found = self.parts.products_of([block for _, block in asked], columns)
        known = kept | {term.key: one for (term, _), one in zip(asked, found, strict=True)}
        kept |= {term.key: known[term.key] for term, _ in asked if term.is_constant}
        none = np.zeros((len(self.parts.slices), 0, columns.shape[1]))
        return np.concatenate([none, *(known[term.key] for term in self.terms)], axis=1)

    def candidate(self, term: Term) -> Candidate:
        """Judge one guess."""
        return self.candidates(batches_of(self.dataset, [term], self.fine))[0]

    def candidates(self, batches: Sequence[Batch]) -> list[Candidate]:
        """Judge guesses, many at once: the chain's own regressors are read once for all."""
        track = self.dataset.fine.track
        return [
            judged(term, float(gain), batch.own.shape[-1], track, self.of_error)
            for batch in batches
            for term, gain in zip(batch.terms, self.gains(batch), strict=True)
        ]

    def gains(self, batch: Batch) -> Floats:
        """Share of the held-out mean square that each guess takes beside the chain; shape (K,)."""
        count, width = batch.own.shape[1:3]
        cross = self.products(batch.columns, batch.beside)
        cross = cross.reshape(*cross.shape[:2], count, width).transpose(0, 2, 1, 3)
        moment = batch.moment
        if self.fast_part is not None:
            fast = self.parts.products(batch.columns, self.fast_part[:, None])[:, :, 0]
            moment = moment - fast.reshape(moment.shape)
        rest = self._elsewhere(cross, batch.own, moment)
        gamma, projected = self._asked_for(batch.terms[0], *rest), rest[1]
        found = self._taken(gamma, projected, cross, batch.own, moment)
        # Of the wrong sign a form is none: it would stand in the way of its effect's others.
        pairs = zip(batch.terms, gamma.mean(axis=0), strict=True)
        wrong = [t.form and not t.effect.plausible(own, t.parameters) for t, own in pairs]
        return np.where(np.array(wrong, dtype=bool), 0.0, found)

    def gains_of_forms(self, batch: Batch, forms: Sequence[tuple[Term, Ints]]) -> list[float]:
        """Likewise of forms of a batch's one guess: what one leaves out has no coefficient."""
        cross, own, moment = self.products(batch.columns)[:, None], batch.own, batch.moment
        rest_cross, projected, rest_own, asked = self._elsewhere(cross, own, moment)
        gamma = np.zeros((self.parts.units, len(forms), own.shape[-1]))
        for number, (term, kept) in enumerate(forms):
            some = rest_cross[..., kept], projected[..., kept], rest_own[:, :, kept[:, None], kept]
            gamma[:, number, kept] = self._asked_for(term, *some, asked[..., kept])[:, 0]
        return [float(gain) for gain in self._taken(gamma, projected, cross, own, moment)]

    def _elsewhere(self, cross: Floats, own: Floats, moment: Floats) -> tuple[Floats, ...]:
        """Products outside of each unit, with what the chain's own fit leaves to ask for."""
        rest = self.parts.elsewhere(cross)
        alone = np.einsum("ukij,ui->ukj", rest, self.sums.coefficients)
        asked = self.parts.elsewhere(moment) - alone
        return rest, self.inverses[:, None] @ rest, self.parts.elsewhere(own), asked

    def _asked_for(
        self, term: Term, rest_cross: Floats, projected: Floats, rest_own: Floats, asked: Floats
    ) -> Floats:
        """Coefficients of terms like this one beside the chain, fitted to all units but each."""
        left = rest_own - np.swapaxes(rest_cross, -1, -2) @ projected
        energy = np.einsum("ukii->uki", rest_own)
        width = rest_own.shape[-1]
        # What nothing outside a unit excites has no coefficient there, nor what the model leaves
        # next to nothing of.
        floor = (
            max(term.effect.ridge(term.parameters), SINGULAR_BELOW)
            * (energy + 1e-3 * energy.max(axis=0, keepdims=True))
            + 1e-200
        )
        left = left + floor[..., None] * np.eye(width)
        if term.effect.whole:
            return np.ones_like(asked)
        return np.asarray(np.linalg.solve(left, asked[..., None])[..., 0])

    def _taken(
        self, gamma: Floats, projected: Floats, cross: Floats, own: Floats, moment: Floats
    ) -> Floats:
        """Share of the held-out mean square that coefficients, (u, K, w), take; (K,).

        Products are cross (p, K, b, w), own (p, K, w, w), moment (p, K, w), or of one for all.
        """
        unit, sums = self.parts.unit, self.sums
        beta = (sums.coefficients[:, None] - (projected @ gamma[..., None])[..., 0])[unit]
        gamma = gamma[unit]
        error = (
            sums.power[:, None]
            + np.sum(beta * (beta @ sums.gram - 2 * sums.moment[:, None]), axis=-1)
            + np.sum(gamma * ((own @ gamma[..., None])[..., 0] - 2 * moment), axis=-1)
            + 2 * np.sum(gamma * (beta[:, :, None] @ cross)[:, :, 0], axis=-1)
        )
        after = deviation_of(error[self.counted], self.counts[:, None]).sum(axis=0)
        return np.asarray(1.0 - (after / max(self.left, 1e-300)) ** 2)
