"""Fit a declared model, parameters that are not given included."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.effects.hysteresis import AnyHysteresis, Hysteresis
from opamc_cli.joint.effects.time_delay import TimeDelay
from opamc_cli.joint.explain.saturated import saturated, unnamed_library, with_links
from opamc_cli.joint.explain.sides import turned_by
from opamc_cli.joint.fit.model import Dataset, Fit, Term, dataset_of, fit_terms
from opamc_cli.joint.fit.thinning import MOST_SAMPLES
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.kinematics import Recording, Smoothing, build_track, smoothings
from opamc_cli.joint.motion.recordings import excerpts, grouped_track, is_moving
from opamc_cli.joint.motion.track import Joint, Track
from opamc_cli.joint.name.chain import HALF, chain_of
from opamc_cli.joint.name.search import Pool, candidates, trials

BETTER = 0.97
"""Of the mean square error: another window than the noise asks for must be worth it."""
ENOUGH = 12_500
"""Moving samples for that: a quarter of what the loop takes of a long recording."""
FUNCTIONS = 4
"""Without a name, beside a model that may lack something: 16 leave the least with the same way."""
OTHERS = 2
"""Ways beside the first in which they are searched, those in which what it found leaves least: by
one more a payload of 15 times the noise would be missed (0.08 of what the first way leaves)."""
JUDGED = ("moving", "clear", "channels", "period_s")
"""What tells which samples count: by its own, none near a reversal, a long window is the best."""
Way = Smoothing | None
Laid = tuple[list[Recording], Joint, dict[str, Any], Grouping]
"""Recordings, and which of their samples count, as a first track and its groups tell."""
Declared = tuple[tuple[Effect, Term | None], ...]
"""Effects, with their terms where parameters are given."""


class Ways:
    """A declared model on recordings in time order, at one rate, and ways to differentiate these.

    A way of None is what the noise of each path asks for.
    """

    def __init__(
        self, recordings: list[Recording], joint: Joint, declared: Callable[[Dataset], Declared]
    ) -> None:
        self._laid = recordings, joint
        self._declared = declared
        self._short: dict[Way, Dataset] = {}
        self.strokes_turned = 0
        """Of phases alone, by `turned`."""

    def best_fit(self, without_rules: Collection[str] = ()) -> Fit | None:
        """Fit the model to what is differentiated in the way that predicts best.

        The rule "windows" may be switched off. None where too little moves to seal anything off.
        """
        track, grouping = grouped_track(*self._laid)
        if grouping is None or not is_moving(track):
            return None
        self._whole = *self._laid, judged_of(track), grouping
        dataset = dataset_of(track, grouping)
        model = self._declared(dataset)
        self._short = {}
        if "windows" not in without_rules and smoothings(self._laid[0]):
            part = excerpts(self._laid[0], track), self._laid[1]
            track, grouping = grouped_track(*part)
            if grouping is not None:
                laid, ways = (*part, judged_of(track), grouping), (None, *smoothings(part[0]))
                self._short = {way: _differentiated(laid, way, short=True) for way in ways}
        best = self._best_of(None, model)
        return declared_fit(dataset if best is None else _differentiated(self._whole, best), model)

    def fit_anew(self, before: Fit, found: Sequence[Term] = ()) -> Fit | None:
        """Fit the model anew, to the motion that predicts best beside terms that were found.

        Before any is, beside functions: what fits best as declared may have smoothed away what is
        missing. Open parameters are searched beside the terms. None where neither is any better.
        """
        present, model = before.dataset.smoothing, self._declared(before.dataset)
        beside = (*model, *((term.effect, term) for term in found))
        # Next to rest a long window rounds off more than a delay takes away: a wind-up fits that.
        first = present if found else self._best_of(present, model, late=True)
        best = self._best_of(first, beside, 0 if found else FUNCTIONS)
        if best == present and not (found and any(term.parameters for term in before.terms)):
            return None
        dataset = before.dataset if best == present else _differentiated(self._whole, best)
        searched = declared_fit(dataset, beside)
        kept = (*before.terms, *found)
        if best == present and _left(searched) >= BETTER * _left(fit_terms(dataset, kept)):
            return None
        return fit_terms(dataset, tuple(term for term in searched.terms if term not in found))

    def turned(self, named: Fit) -> Fit | None:
        """Fit the declared model to phases alone of which a model with names turns strokes.

        None where it turns none, or a motion is logged.
        """
        if "logged" in named.dataset.fine.track.channels:
            return None
        track = grouped_track(*self._laid)[0]
        signs = turned_by(named, track)
        if signs is None:
            return None
        recordings, joint = self._laid
        own = (signs[start:stop] for start, stop in track.bounds)
        self._laid = [replace(r, turned=one) for r, one in zip(recordings, own, strict=True)], joint
        self.strokes_turned = int(np.count_nonzero(np.diff(signs, prepend=1.0) < 0))
        return self.best_fit()

    def _best_of(self, first: Way, model: Declared, functions: int = 0, late: bool = False) -> Way:
        """Return the way that leaves least beside functions, or a delay (`late`), or the first."""
        fits = {way: declared_fit(dataset, model) for way, dataset in self._short.items()}
        fits = {way: _or_late(fit) if late else fit for way, fit in fits.items()}
        left = {first: np.inf} | {way: _left(fit) for way, fit in fits.items()}
        if functions and first in fits:
            found = _with_functions(fits.pop(first), functions)
            left[first] = min(left[first], _left(found))
            same = {way: _left(fit_terms(one.dataset, found.terms)) for way, one in fits.items()}
            for way in sorted(same, key=lambda way: same[way])[:OTHERS]:
                left[way] = min(left[way], _left(_with_functions(fits[way], functions)))
        for dataset in self._short.values():
            dataset.cache.clear()  # 100 MB of two minutes; the declared terms are soon laid again
        best = min(left, key=lambda way: left[way])
        if functions or late or not fits:
            return best if left[best] < (HALF if functions else BETTER) * left[first] else first
        # Of those that leave as little clear of corners, the one that leaves least at them.
        near = {way: fit for way, fit in fits.items() if BETTER * left[way] < left[best]}
        at = {way: np.mean(fit.residual_a[fit.dataset.fine.fit] ** 2) for way, fit in near.items()}
        best = min(at, key=lambda way: at[way])
        return best if at[best] < BETTER * at.get(first, np.inf) else first


def _differentiated(laid: Laid, way: Way, short: bool = False) -> Dataset:
    """Differentiate recordings in one way; by ENOUGH of their samples if `short`."""
    recordings, joint, judged, grouping = laid
    track = replace(build_track(recordings, joint, way), **judged)
    most = ENOUGH if short else MOST_SAMPLES
    return replace(dataset_of(track, grouping, most, ends=not short), smoothing=way)


def _or_late(fit: Fit) -> Fit:
    pool = Pool.of(fit.dataset, {TimeDelay.name: TimeDelay()})
    late = [trial.chain.fit for trial in trials(chain_of(fit, 0), pool) if trial.why_not is None]
    return late[0] if late else fit


def _with_functions(fit: Fit, functions: int) -> Fit:
    pool = with_links(Pool.of(fit.dataset, unnamed_library()))
    return saturated(chain_of(fit, 0), pool, functions).fit


def _left(fit: Fit) -> float:
    return fit.rmse(sealed=False) ** 2


def judged_of(track: Track) -> dict[str, Any]:
    """Which samples count: where a track's smoothing takes nothing from the acceleration."""
    return {name: getattr(track, name) for name in JUDGED}


def declared_fit(dataset: Dataset, declared: Declared) -> Fit:
    """Fit a model, terms in its order; parameters that are not given are searched first."""
    terms: dict[int, Term] = {}
    track = dataset.coarse.track
    for place, (effect, term) in enumerate(declared):
        fixed = not effect.limits(track) and not effect.several
        guesses = effect.guesses(track, np.zeros(track.size)) if fixed else []
        if term is not None or len(guesses) == 1:
            terms[place] = term or Term(effect, guesses[0])
    searched = sorted(set(range(len(declared))) - set(terms))
    fitted = fit_terms(dataset, tuple(terms[place] for place in sorted(terms)))
    # Of several each once more: the first was searched beside none of the others.
    for place in searched * min(len(searched), 2):
        effect, dataset = declared[place][0], fitted.dataset
        effect = AnyHysteresis() if type(effect) is Hysteresis else effect
        beside = tuple(terms[key] for key in sorted(terms) if key != place)
        chain = chain_of(fit_terms(dataset, beside) if place in terms else fitted, 0)
        if found := candidates(chain, Pool.of(dataset, {effect.name: effect}), every=True):
            kept = terms | {place: found[0].term}
            other = fit_terms(dataset, tuple(kept[key] for key in sorted(kept)))
            if place not in terms or _left(other) < _left(fitted):
                terms, fitted = kept, other
    return fitted
