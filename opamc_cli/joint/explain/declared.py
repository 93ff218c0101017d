"""Fit a declared model, parameters that are not given included."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.explain.saturated import saturated, unnamed_library, with_links
from opamc_cli.joint.fit.model import Dataset, Fit, Term, dataset_of, fit_terms
from opamc_cli.joint.fit.thinning import MOST_SAMPLES
from opamc_cli.joint.motion.groups import Grouping
from opamc_cli.joint.motion.kinematics import Recording, Smoothing, build_track, smoothings
from opamc_cli.joint.motion.recordings import excerpts, grouped_track, is_moving
from opamc_cli.joint.motion.track import Joint, Track
from opamc_cli.joint.name.chain import EXACT, chain_of
from opamc_cli.joint.name.search import Pool, candidates
from opamc_cli.signal.motion.smoothing import measurement_noise

BETTER = 0.97
"""Of the mean square error: another window than the noise asks for must be worth it."""
HALF = 0.5
"""Likewise beside functions without a name: with 0.6 they make up for a short window's noise."""
ENOUGH = 12_500
"""Moving samples for that: a quarter of what the loop takes of a long recording."""
FUNCTIONS = 4
"""Without a name, beside a model that may lack something: 16 leave the least with the same way."""
JUDGED = ("moving", "clear", "channels", "period_s")
"""What tells which samples count: by its own, none near a reversal, a long window is the best."""
Way = Smoothing | None
Declared = tuple[tuple[Effect, Term | None], ...]
"""Effects, with their terms where parameters are given."""


def best_fit(
    recordings: list[Recording],
    joint: Joint,
    declared: Callable[[Dataset], Declared],
    without_rules: Collection[str] = (),
) -> Fit | None:
    """Fit a declared model to recordings, differentiated in the way that predicts best.

    The recordings are in time order, all at one rate; the rule "windows" may be switched off. None
    where too little moves to seal anything off.
    """
    track, grouping = grouped_track(recordings, joint)
    if grouping is None or not is_moving(track):
        return None
    dataset = dataset_of(track, grouping)
    model = declared(dataset)
    if "windows" in without_rules or not smoothings(recordings):
        return declared_fit(dataset, model)
    best = _Ways(excerpts(recordings, track), joint).best_of(None, model)
    if best is None:
        return declared_fit(dataset, model)
    return declared_fit(_differentiated(recordings, joint, track, grouping, best), model)


def fit_anew(
    recordings: list[Recording],
    joint: Joint,
    declared: Callable[[Dataset], Declared],
    before: Fit,
    found: Sequence[Term] = (),
) -> Fit | None:
    """Fit a declared model anew, to the motion that predicts best beside terms that were found.

    Before any is, beside functions without a name: what fits best as declared may have smoothed
    away what something missing answers to. None if it is the motion of the fit `before`.
    """
    if not smoothings(recordings):
        return None
    present, model = before.dataset.smoothing, declared(before.dataset)
    track, grouping = grouped_track(recordings, joint)
    beside = (*model, *((term.effect, term) for term in found))
    ways = _Ways(excerpts(recordings, track), joint)
    best = ways.best_of(present, beside, 0 if found else FUNCTIONS)
    if best == present or grouping is None:
        return None
    return declared_fit(_differentiated(recordings, joint, track, grouping, best), model)


def _differentiated(
    recordings: list[Recording],
    joint: Joint,
    track: Track,
    grouping: Grouping,
    smoothing: Way,
    most: int = MOST_SAMPLES,
    ends: bool = True,
) -> Dataset:
    """Differentiate recordings, judged by a first track's samples."""
    if smoothing is not None:
        track = judged_alike(build_track(recordings, joint, smoothing), track)
    return replace(dataset_of(track, grouping, most, ends), smoothing=smoothing)


class _Ways:
    """Ways to differentiate recordings; None is what the noise of each path asks for."""

    def __init__(self, recordings: list[Recording], joint: Joint) -> None:
        track, grouping = grouped_track(recordings, joint)
        self._ways: list[Way] = []
        if grouping is not None:
            self._ways = [None, *smoothings(recordings)]
            laid = recordings, joint, track, grouping
            self._dataset = partial(_differentiated, *laid, ends=False)

    def best_of(self, first: Way, model: Declared, functions: int = 0) -> Way:
        """Return the way that leaves least beside so many functions, or the first: see HALF."""
        left: dict[Way, float] = {first: np.inf}
        for way in sorted(self._ways, key=lambda way: way != first):
            fits = [declared_fit(self._dataset(way, ENOUGH), model)]
            if functions:
                pool = with_links(Pool.of(fits[0].dataset, unnamed_library()))
                fits.append(saturated(chain_of(fits[0], 0), pool, functions).fit)
            left[way] = min(fit.rmse(sealed=False) for fit in fits) ** 2
            rest = fits[-1].residual_a[fits[-1].dataset.sharp.fit]
            if functions and EXACT * left[way] <= measurement_noise(rest) ** 2:
                break  # Noise is all that is left.
        least = min(left, key=lambda way: left[way])
        return least if left[least] < (HALF if functions else BETTER) * left[first] else first


def judged_alike(other: Track, track: Track) -> Track:
    """Judge both by the same samples: where the first takes nothing from the acceleration."""
    return replace(other, **{name: getattr(track, name) for name in JUDGED})


def declared_fit(dataset: Dataset, declared: Declared) -> Fit:
    """Fit a model, terms in its order; parameters that are not given are searched first."""
    terms: dict[int, Term] = {}
    track = dataset.coarse.track
    for place, (effect, term) in enumerate(declared):
        fixed = not effect.limits(track) and not effect.several
        guesses = effect.guesses(track, np.zeros(track.size)) if fixed else []
        if term is not None or len(guesses) == 1:
            terms[place] = term or Term(effect, guesses[0])
    fitted = fit_terms(dataset, tuple(terms[place] for place in sorted(terms)))
    for place in sorted(set(range(len(declared))) - set(terms)):
        effect = declared[place][0]
        chain = chain_of(fitted, 0)
        found = candidates(chain, Pool.of(dataset, {effect.name: effect}), every=True)
        if not found:
            continue
        terms[place] = found[0].term
        fitted = fit_terms(fitted.dataset, tuple(terms[key] for key in sorted(terms)))
    return fitted
