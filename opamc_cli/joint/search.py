"""Search the best form of an effect for a residual, over its non-linear parameters."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.stats import chi2

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.model import Session, Term
from opamc_cli.joint.normal import (
    solve,
)
from opamc_cli.joint.span import SPANNED
from opamc_cli.joint.track import Floats
from opamc_cli.joint.view import View, block_t_value

SCORE_PER_PARAMETER = 6.0
"""What a free parameter must earn in log-likelihood ratio (BIC of some 400 samples)."""
FINEST_STEP = 0.05
"""Share of a parameter's first step below which nobody needs to know it, if besides the likelihood
is the same."""
AS_WELL = 1.0
"""In likelihood units."""
BATCH_VALUES = 1_000_000
"""Values that are multiplied with the model's span at once: more would leave the cache."""


@dataclass(frozen=True)
class Candidate:
    """A term that might be added, and what speaks for it.

    Attributes
    ----------
    term : Term
        Effect, parameters, columns.
    likelihood : float
        Fall of the whitened sum of squares in units of the noise's variance.
    score : float
        Likelihood less six for every free parameter.
    p_value : float
        Chi-square of the likelihood, times the numbers of guesses and of effects tried.
    gain, t_value, consistency : float
        Held-out fall of the mean square (share), t over blocks, share of groups better.
    expected_consistency : float
        Share that an effect of its size has at least, but for one time in six.
    contribution : array of shape (n,)
        Whitened, projected contribution, for comparison with others.
    why_not : str or None
        Why it is not added.
    imitates : str or None
        Domain of the plain form without a name that does as well, if that is why.
    """

    term: Term
    likelihood: float
    score: float
    p_value: float
    coefficients: Floats
    contribution: Floats
    fine: bool
    gain: float = 0.0
    t_value: float = 0.0
    consistency: float = 0.0
    expected_consistency: float = 1.0
    decoy_gain: float = 0.0
    why_not: str | None = None
    imitates: str | None = None


@dataclass(frozen=True)
class Scored:
    """One form of an effect with given parameters, fitted to a view.

    Attributes
    ----------
    score : float
        Likelihood less what its parameters must earn; minus infinity where it is implausible.
    term : Term
        Effect, parameters, columns.
    coefficients : array
        One per column of the form.
    columns, inside : arrays of shape (m, k) and (s, k)
        Whitened columns of the full form, and their products with the model's span.
    new : list of int
        Columns of the form that the model does not span.
    solution : array of shape (len(new),)
        Their coefficients.
    """

    score: float
    term: Term
    coefficients: Floats
    columns: Floats
    inside: Floats
    new: list[int]
    solution: Floats

    def contribution(self, view: View) -> Floats:
        """Whitened contribution, without what the model's span could make of it."""
        solution = np.zeros(self.columns.shape[1])
        solution[self.new] = self.solution
        part: Floats = self.columns @ solution - view.span @ (self.inside @ solution)
        return part


@dataclass(frozen=True)
class Products:
    """Whitened regressors of one guess, and what scoring needs of them.

    Attributes
    ----------
    columns : array of shape (m, k)
        On the view's valid samples.
    inside : array of shape (s, k)
        Products with the model's span.
    whole, gram : arrays of shape (k,) and (k, k)
        Their sums of squares; their products without what the span explains.
    """

    columns: Floats
    inside: Floats
    whole: Floats
    gram: Floats


Shared = dict[frozenset[tuple[str, float]], Products]


def search(
    session: Session,
    view: View,
    effect: Effect,
    *,
    least: float = -np.inf,
    shared: Shared | None = None,
) -> tuple[Candidate | None, int]:
    """Best form of an effect on a view, over its non-linear parameters.

    Parameters
    ----------
    session : Session
        Recordings with the fitted model currents.
    view : View
        Whitened residual.
    effect : Effect
        What to try.
    least : float
        A best guess that scores less is not refined, where no effect hides between its guesses.
    shared : dict, optional
        Takes the guesses' regressors, and gives them to the next search of the same effect on
        the same samples.

    Returns
    -------
    candidate : Candidate or None
        None where no form adds anything plausible.
    tried : int
        Number of guesses.
    """
    guesses = effect.guesses(view.grid.track, view.residual)
    best: Scored | None = None
    if shared is None:
        found = _products(session, view, effect, guesses)
    else:
        new = [guess for guess in guesses if frozenset(guess.items()) not in shared]
        for guess, products in _products(session, view, effect, new):
            shared[frozenset(guess.items())] = products
        keys = [(guess, frozenset(guess.items())) for guess in guesses]
        found = ((guess, shared[key]) for guess, key in keys if key in shared)
    for guess, products in found:
        for result in _scored(view, effect, guess, products):
            if best is None or result.score > best.score:
                best = result
    if best is None or not np.isfinite(best.score):
        return None, len(guesses)
    limits = effect.limits(view.grid.track)
    hopeless = effect.dense_guesses and best.score < least
    if limits and not effect.flags_choose_columns and not hopeless:
        best = _refined(session, view, effect, best, limits, len(guesses))
    settled_parameters = effect.settled(best.term.parameters, view.grid.track)
    if settled_parameters != best.term.parameters:
        for result in _evaluate(session, view, effect, settled_parameters):
            same_form = result.term.keep == best.term.keep
            if same_form and result.term.parameters == settled_parameters:
                best = result
    best = _rescaled(session, view, effect, best)
    likelihood = best.score + SCORE_PER_PARAMETER * (best.coefficients.size + len(limits))
    tried = max(len(guesses), 1)
    # Guesses that lie close together pay for the choice by their number; others do not.
    free = best.coefficients.size + (0 if effect.free_refinement else len(limits))
    log_p = float(chi2.logsf(max(likelihood, 0.0), free)) + np.log(tried)
    p_value = float(np.exp(np.clip(log_p, -700.0, 0.0)))
    contribution = best.contribution(view)
    candidate = Candidate(
        term=best.term,
        likelihood=likelihood,
        score=best.score,
        p_value=p_value,
        coefficients=best.coefficients,
        contribution=contribution,
        fine=view.fine,
        t_value=block_t_value(
            view, contribution, effect.in_one_group(view.grid.track, best.term.parameters)
        ),
    )
    return candidate, tried


def _refined(
    session: Session,
    view: View,
    effect: Effect,
    best: Scored,
    limits: dict[str, tuple[float, float]],
    guesses: int,
) -> Scored:
    names = [name for name in limits if name in best.term.parameters]
    start = np.array([best.term.parameters[name] for name in names])
    low = np.array([limits[name][0] for name in names])
    high = np.array([limits[name][1] for name in names])
    champion = best
    keep = best.term.keep

    def cost(steps: Floats) -> float:
        nonlocal champion
        values = start + steps * scale
        inside = np.clip(values, low, high)
        parameters = best.term.parameters | dict(zip(names, inside.tolist(), strict=True))
        top = -np.inf
        for result in _evaluate(session, view, effect, parameters):
            if result.term.keep != keep:
                continue
            top = max(top, result.score)
            if result.score > champion.score:
                champion = result
        penalty = float(np.sum(np.abs(values - inside) / (high - low)))
        return -top + 1e3 * penalty if np.isfinite(top) else 1e12

    scale = np.array([_first_step(session, best, name, limits[name]) for name in names])
    scale[start + scale >= high] *= -1
    minimize(
        cost,
        np.zeros(len(names)),
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([np.zeros(len(names)), np.eye(len(names))]),
            "maxfev": 14 + 12 * len(names),
            "fatol": 0.3,
            "xatol": FINEST_STEP,
        },
    )
    return champion


def _first_step(session: Session, best: Scored, name: str, limits: tuple[float, float]) -> float:
    """How far from the best guess a parameter is varied first."""
    low, high = limits
    parameters = best.term.parameters
    if name == "frequency_hz":
        return 0.2 / (float(np.ptp(session.fine.track.time_s)) + 1e-9)
    if name == "place_rad":
        return 0.3 * parameters.get("width_rad", high - low)
    if name == "since_s":
        return (high - low) / 64
    if name == "resonance_hz":
        return 0.06 * parameters[name]
    if name.endswith(("_speed", "_s", "_rad", "damping")) and parameters[name]:
        return 0.15 * abs(parameters[name])
    return 0.05 * (high - low)


def _rescaled(session: Session, view: View, effect: Effect, best: Scored) -> Scored:
    """Move into the parameters what they can take of the coefficients, if that fits as well."""
    parameters = effect.rescaled(best.term.parameters, best.coefficients)
    if parameters != best.term.parameters:
        for result in _evaluate(session, view, effect, parameters):
            if result.term.keep == best.term.keep and result.score > best.score - AS_WELL:
                return result
    return best


def _products(
    session: Session, view: View, effect: Effect, guesses: Sequence[Parameters]
) -> Iterator[tuple[Parameters, Products]]:
    """Regressors of guesses; those that are not finite are left out.

    Many guesses are multiplied with the span at once: it is read from memory once for all.
    """
    batch: list[tuple[Parameters, Floats]] = []
    width = 0
    for guess in guesses:
        raw = session.columns(Term(effect, guess), view.fine)
        if np.all(np.isfinite(raw)):
            batch.append((guess, view.whitened_rows(raw)))
            width += raw.shape[1]
        if width * view.rows.size > BATCH_VALUES:
            yield from _multiplied(view, batch)
            batch, width = [], 0
    if batch:
        yield from _multiplied(view, batch)


def _multiplied(
    view: View, batch: list[tuple[Parameters, Floats]]
) -> Iterator[tuple[Parameters, Products]]:
    # What the span explains is taken out of the products: the columns themselves stay as they are.
    shadow = view.span.T @ np.concatenate([columns for _, columns in batch], axis=1)
    start = 0
    for guess, columns in batch:
        inside = shadow[:, start : start + columns.shape[1]]
        start += columns.shape[1]
        whole = columns.T @ columns
        yield guess, Products(columns, inside, np.diagonal(whole), whole - inside.T @ inside)


def _scored(
    view: View, effect: Effect, parameters: Parameters, known: Products
) -> Iterator[Scored]:
    """Score an effect's full form and its smaller forms, with given parameters."""
    width = known.columns.shape[1]
    moment = known.columns.T @ view.values
    forms: list[tuple[Parameters, tuple[int, ...]]] = [
        (parameters, tuple(range(width))),
        *effect.variants(parameters),
    ]
    limits = len(effect.limits(view.grid.track))
    for form, keep in forms:
        # A column that the model already spans leaves only rounding.
        new = [k for k in keep if known.gram[k, k] > SPANNED * known.whole[k]]
        if not new:
            continue
        solution = solve(known.gram[np.ix_(new, new)], moment[new])
        fall = float(solution @ moment[new])
        left = max(view.power - fall, 1e-12 * view.power)
        likelihood = view.freedom(len(new)) * np.log(view.power / left)
        coefficients = np.zeros(len(keep))
        coefficients[[keep.index(k) for k in new]] = solution
        plausible = effect.plausible(coefficients, form)
        full = len(keep) == width
        term = Term(effect, form, None if full or effect.flags_choose_columns else keep)
        score = likelihood - SCORE_PER_PARAMETER * (len(new) + limits) if plausible else -np.inf
        yield Scored(float(score), term, coefficients, known.columns, known.inside, new, solution)


def _evaluate(
    session: Session, view: View, effect: Effect, parameters: Parameters
) -> Iterator[Scored]:
    """Score an effect with given parameters."""
    for _, known in _products(session, view, effect, [parameters]):
        yield from _scored(view, effect, parameters, known)
