"""Trace a residual to its cause: candidates refitted with the model, gated, and compared."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import chi2

from opamc_cli.joint.effects.base import Effect, Parameters
from opamc_cli.joint.model import Fit, Grid, Session, Term
from opamc_cli.joint.normal import (
    Normal,
    appended,
    eigenvectors,
    held_out_error,
    normal_equations,
    solve,
)
from opamc_cli.joint.track import Bools, Floats
from opamc_cli.joint.whitening import autoregression, settled, whitened

SCORE_PER_PARAMETER = 6.0
"""What a free parameter must earn in log-likelihood ratio (BIC of some 400 samples)."""

BATCH_VALUES = 1_000_000
"""Values that are multiplied with the model's span at once: more would leave the cache."""

ROWS_AT_A_TIME = 16_384

LEAST_DRIFT = 0.3

SPANNED = 1e-6
"""A column of which a span leaves less than this share of the energy is rounding."""
BLOCKS_PER_GROUP = 8
DECOY_BLOCKS_PER_GROUP = 2


@dataclass(frozen=True)
class Gate:
    """What a candidate must show before it is added."""

    smallest_gain: float = 0.01
    smallest_t: float = 2.0
    smallest_consistency: float = 0.7
    decoy_ratio: float = 2.0
    largest_p: float = 5e-3
    decoys: int = 5


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
    contribution : array of shape (n,)
        Whitened, projected contribution, for comparison with others.
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
    decoy_gain: float = 0.0
    why_not: str | None = None


@dataclass(frozen=True)
class View:
    """One grid prepared for a search: whitened residual and the model's whitened span."""

    grid: Grid
    fine: bool
    taps: Floats
    valid: Bools
    span: Floats
    residual: Floats
    variance: float

    @cached_property
    def rows(self) -> NDArray[np.int64]:
        """Places of the valid samples on the grid."""
        return np.flatnonzero(self.valid)

    @cached_property
    def values(self) -> Floats:
        """Residual on the valid samples; the model's span explains nothing of it."""
        values: Floats = self.residual[self.rows]
        return values

    @cached_property
    def power(self) -> float:
        """Sum of squares of the residual."""
        return float(np.dot(self.values, self.values))

    def whitened_rows(self, columns: Floats) -> Floats:
        """Regressors of the whole grid as they are on the valid samples, whitened."""
        return whitened(columns, self.taps)[self.rows]


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


def noise_of(fit: Fit, fine: bool, residual: Floats) -> tuple[Floats, Bools]:
    """Estimate what does not repeat in a residual, with the samples where that is known.

    Parameters
    ----------
    fit : Fit
        The model so far.
    fine : bool
        Which grid.
    residual : array of shape (n,)
        Residual on that grid.

    Returns
    -------
    noise, valid : arrays of shape (n,)
        Half the difference of successive cycles (scaled to the noise's own variance) where the
        motion repeats; else the residual itself.
    """
    grid = fit.session.grid(fine)
    period = grid.track.period_samples
    if period is None:
        return residual, grid.fit
    noise = np.zeros_like(residual)
    valid = np.zeros_like(grid.fit)
    for start, stop in grid.track.bounds:
        if stop - start <= period:
            continue
        noise[start : stop - period] = (
            residual[start : stop - period] - residual[start + period : stop]
        ) / np.sqrt(2)
        valid[start : stop - period] = (
            grid.fit[start : stop - period] & grid.fit[start + period : stop]
        )
    if valid.sum() < 0.2 * grid.fit.sum():
        return residual, grid.fit
    if not fine:
        _remove_drift(fit, noise, valid)
    return noise, valid


def _remove_drift(fit: Fit, noise: Floats, valid: Bools) -> None:
    """Take out of the noise, in place, the model's own regressors times a parabola of time.

    Friction or load that drifts from cycle to cycle is what a slow effect looks like; counted as
    the noise's colour it would hide itself. A drift below three tenths of the noise stays: slow
    noise makes as much.
    """
    track = fit.session.coarse.track
    columns = [fit.session.columns(term, fine=False)[valid] for term in fit.terms]
    if not columns:
        return
    model = np.concatenate(columns, axis=1)
    time = track.time_s[valid]
    time = (time - time.mean()) / max(float(np.ptp(time)), 1e-9)
    drift = np.concatenate([model * (time**power)[:, None] for power in range(3)], axis=1)
    drifted = drift @ solve(drift.T @ drift, drift.T @ noise[valid])
    if drifted @ drifted > LEAST_DRIFT * (noise[valid] @ noise[valid]):
        noise[valid] -= drifted


def prepare(fit: Fit, fine: bool, residual: Floats | None = None) -> View:
    """Whiten a fit's residual and regressors on one grid.

    Parameters
    ----------
    fit : Fit
        The model so far.
    fine : bool
        Which grid.
    residual : array of shape (n,), optional
        Another residual on that grid, for decoys.
    """
    session = fit.session
    grid = session.grid(fine)
    own = residual_on(fit, fine)
    noise, known = noise_of(fit, fine, own)
    taps = autoregression(noise, known)
    valid = grid.fit & settled(
        grid.track.moving & (grid.track.group >= 0), grid.track.bounds, taps.size - 1
    )
    blocks = [session.columns(term, fine) for term in fit.terms]
    blur = grid.track.blur
    if fine and blur is not None:
        # What smoothing took from the acceleration is no effect.
        blocks.append(blur)
    rows = np.flatnonzero(valid)
    base = np.empty((rows.size, sum(block.shape[1] for block in blocks)), order="F")
    place = 0
    for block in blocks:
        for column in block.T:
            np.take(whitened(column, taps), rows, out=base[:, place])
            place += 1
    span = orthonormal(base)
    signal = whitened(own if residual is None else residual, taps)
    values = signal[valid]
    values = values - span @ (span.T @ values)
    full = np.zeros(grid.track.size)
    full[valid] = values
    variance = float(values @ values) / max(values.size - span.shape[1], 1)
    return View(grid, fine, taps, valid, span, full, max(variance, 1e-300))


def sealed_falls(before: Fit, after: Fit) -> tuple[float, float]:
    """Fall of the sealed mean square error from one fit to another, plain and whitened.

    Parameters
    ----------
    before, after : Fit
        Of the same recordings.

    Returns
    -------
    plain, whitened : float
        Shares of the error before; the noise's colour is the open groups' under `before`.
    """
    session = before.opened.session
    grid = session.fine
    noise, known = noise_of(before, True, before.residual_a)
    taps = autoregression(noise, known)
    track = grid.track
    clean = grid.sealed & settled(track.moving & (track.group >= 0), track.bounds, taps.size - 1)
    falls = []
    for rows, filters in ((grid.sealed, np.ones(1)), (clean, taps)):
        first, last = (
            float(np.sum(whitened(fit.opened.residual_a, filters)[rows] ** 2))
            for fit in (before, after)
        )
        falls.append(1.0 - last / first if first > 0 else 0.0)
    return falls[0], falls[1]


def residual_on(fit: Fit, fine: bool) -> Floats:
    """Residual of a fit on one of the session's grids.

    On the coarse grid it is the averaged current less the coarse regressors: the average of the
    fine residual would have gone through the motion's smoothing twice.
    """
    session = fit.session
    if fine or session.coarse is session.fine:
        return fit.residual_a
    residual = session.coarse.track.current_a.copy()
    for term, values in zip(fit.terms, fit.coefficients, strict=True):
        residual -= session.columns(term, fine=False) @ values
    return residual


def orthonormal(columns: Floats) -> Floats:
    """Orthonormal columns of the same span, in the place of the given ones.

    Directions below 1e-9 of the largest are left out.
    """
    if columns.shape[1] == 0:
        return columns
    gram = columns.T @ columns
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    values, vectors = eigenvectors(gram / np.outer(scale, scale))
    good = values > 1e-9 * values[-1]
    turn = vectors[:, good] / np.sqrt(values[good]) / scale[:, None]
    # In place, some rows at a time: on the fine grid a second array is a hundred megabytes.
    for start in range(0, columns.shape[0], ROWS_AT_A_TIME):
        rows = slice(start, start + ROWS_AT_A_TIME)
        columns[rows, : turn.shape[1]] = columns[rows] @ turn
    return columns[:, : turn.shape[1]]


def orthonormal_beside(columns: Floats, span: Floats) -> Floats:
    """Orthonormal basis of what an orthonormal span leaves of columns.

    A column of which less than a millionth of the energy is left is rounding, and left out.
    """
    left = columns - span @ (span.T @ columns)
    energy = np.einsum("ij,ij->j", columns, columns)
    return orthonormal(left[:, np.einsum("ij,ij->j", left, left) > SPANNED * energy])


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
        likelihood = view.values.size * np.log(view.power / left)
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
        t_value=block_t_value(view, contribution),
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

    def cost(values: Floats) -> float:
        nonlocal champion
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

    simplex = np.tile(start, (len(names) + 1, 1))
    for i, name in enumerate(names):
        step = 0.15 * abs(start[i]) if name.endswith(("_speed", "_s", "_rad", "damping")) else 0.0
        if name == "frequency_hz":
            length = float(np.ptp(view.grid.track.time_s)) + 1e-9
            step = 0.2 / length
        elif name in ("place_rad",):
            step = 0.3 * best.term.parameters.get("width_rad", high[i] - low[i])
        elif name == "resonance_hz":
            step = 0.06 * start[i]
        step = step or 0.05 * (high[i] - low[i])
        simplex[i + 1, i] += step if start[i] + step < high[i] else -step
    minimize(
        cost,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": 14 + 12 * len(names), "fatol": 0.3},
    )
    return champion


@dataclass(frozen=True)
class Held:
    """What leaving groups out needs of the model itself, once per round.

    Attributes
    ----------
    base : array of shape (n, k)
        The model's regressors on the open samples of one grid.
    residual : array of shape (n,)
        Likewise.
    normal : Normal
        Their sums per group.
    """

    base: Floats
    residual: Floats
    normal: Normal


def prepare_held(fit: Fit, fine: bool) -> Held:
    """Collect the model's regressors and residual on the open samples of one grid."""
    grid = fit.session.grid(fine)
    base = _model_rows(fit, fine)
    residual = residual_on(fit, fine)[grid.fit]
    return Held(base, residual, normal_equations(base, residual, grid.slices))


def _model_rows(fit: Fit, fine: bool) -> Floats:
    session = fit.session
    rows = session.grid(fine).fit
    blocks = [session.columns(term, fine) for term in fit.terms]
    blur = session.grid(fine).track.blur
    if fine and blur is not None:
        blocks.append(blur)
    # Filled block by block: to put copies side by side would take twice the memory.
    base = np.empty((int(np.count_nonzero(rows)), sum(block.shape[1] for block in blocks)))
    stop = 0
    for block in blocks:
        start, stop = stop, stop + block.shape[1]
        base[:, start:stop] = block[rows]
    return base


def removal_gains(fit: Fit, places: Sequence[int]) -> list[float]:
    """Held-out share of the mean square that each of some terms of a fit takes off.

    Parameters
    ----------
    fit : Fit
        The model.
    places : sequence of int
        Which of its terms.

    Returns
    -------
    list of float
        As `held_out` finds for the term where all others are fitted; fast terms on the fine
        grid, others on the coarse one.
    """
    session = fit.session
    normals: dict[bool, Normal] = {}
    owner = np.repeat(np.arange(len(fit.terms)), [values.size for values in fit.coefficients])
    gains = []
    for place in places:
        fine = fit.terms[place].effect.fast
        if fine not in normals:
            grid = session.grid(fine)
            signal = grid.track.current_a[grid.fit]
            normals[fine] = normal_equations(_model_rows(fit, fine), signal, grid.slices)
        normal = normals[fine]
        others = [k for k in range(normal.moment.shape[1]) if k >= owner.size or owner[k] != place]
        before = held_out_error(normal.taken(others)).sum()
        after = held_out_error(normal).sum()
        gains.append(float((before - after) / max(before, 1e-300)))
    return gains


def held_out(fit: Fit, candidate: Candidate, held: Held | None = None) -> Candidate:
    """Refit a candidate jointly with the model, each group left out in turn.

    Parameters
    ----------
    fit : Fit
        The model so far.
    candidate : Candidate
        Found by `search`.
    held : Held, optional
        From `prepare_held`, on the candidate's grid.

    Returns
    -------
    Candidate
        With its gain.
    """
    session = fit.session
    grid = session.grid(candidate.fine)
    held = held or prepare_held(fit, candidate.fine)
    own = session.columns(candidate.term, candidate.fine)[grid.fit]
    normal = appended(held.normal, held.base, own, held.residual, grid.slices)
    before = held_out_error(held.normal)
    falls = before - held_out_error(normal)
    return replace(candidate, gain=float(falls.sum() / max(before.sum(), 1e-300)))


def consistency(session: Session, view: View, candidate: Candidate) -> float:
    """Share of groups that a candidate explains better when it is fitted to the others.

    Parameters
    ----------
    session : Session
        Recordings.
    view : View
        Whitened residual: a slow drift inside a group would drown what the candidate explains.
    candidate : Candidate
        From `search`.

    Returns
    -------
    float
        Every group counted with the energy of what the candidate adds there, 0 to 1.
    """
    base = view.span.shape[1]
    own = view.whitened_rows(session.columns(candidate.term, candidate.fine))
    edges = np.flatnonzero(np.diff(view.grid.track.group[view.rows])) + 1
    slices = tuple(pairwise([0, *edges.tolist(), view.rows.size]))
    model = normal_equations(view.span, view.values, slices)
    normal = appended(model, view.span, own, view.values, slices)
    falls = held_out_error(model) - held_out_error(normal)
    energy = _excitation(normal, base)
    return float(np.sum(energy * (falls > 0)) / max(energy.sum(), 1e-300))


def _excitation(normal: Normal, base: int) -> Floats:
    """Energy per group of the candidate's contribution that the model cannot make."""
    gram = normal.gram.sum(axis=0)
    whole = solve(gram, normal.moment.sum(axis=0))[base:]
    inside = solve(
        np.broadcast_to(gram[:base, :base], (1, base, base)),
        (gram[:base, base:] @ whole)[None, :],
    )[0]
    direction = np.concatenate([-inside, whole])
    energy: Floats = np.einsum("i,gij,j->g", direction, normal.gram, direction)
    return energy


def block_t_value(view: View, contribution: Floats) -> float:
    """Compute the t value of a contribution's agreement with the residual over blocks of time.

    Parameters
    ----------
    view : View
        Whitened residual.
    contribution : array of shape (m,)
        Whitened contribution on the view's valid samples.

    Returns
    -------
    float
        Sum over blocks of the products, over the root of their sum of squares: one lucky block
        gives 1, n equal ones the root of n. Eight blocks per group, so that effects that fade
        or step, and live in few groups, can show themselves too.
    """
    products = contribution * view.values
    sums = np.array([products[block].sum() for block in blocks_of(view, BLOCKS_PER_GROUP)])
    length = float(np.linalg.norm(sums))
    return float(sums.sum() / length) if length > 0 else 0.0


def blocks_of(view: View, per_group: int) -> list[NDArray[np.int64]]:
    """Positions among the valid samples, in blocks of each group."""
    groups = view.grid.track.group[view.valid]
    edges = np.flatnonzero(np.diff(groups) != 0) + 1
    blocks: list[NDArray[np.int64]] = []
    for members in np.split(np.arange(groups.size), edges):
        blocks += [block for block in np.array_split(members, per_group) if block.size]
    return blocks


def decoy_likelihood(
    fit: Fit, view: View, candidate: Candidate, generator: np.random.Generator, count: int
) -> float:
    """Best likelihood that the same search finds where the candidate's effect is not.

    The candidate's contribution is taken out of the residual, every group is cut into two
    blocks (eight for fast effects, since other lines of a spectrum would survive in long ones),
    and their signs are drawn at random: what is left has the noise's size and colour,
    slow drifts included, but follows no covariate. A chance candidate takes out little, so its
    decoys do as well as it did.

    Parameters
    ----------
    fit : Fit
        The model so far.
    view : View
        Whitened residual.
    candidate : Candidate
        Whose form is searched again.
    generator : numpy Generator
        For the signs.
    count : int
        Decoys.

    Returns
    -------
    float
        Largest likelihood.
    """
    worst = 0.0
    rest = view.values - candidate.contribution
    fast = candidate.term.effect.fast
    blocks = blocks_of(view, BLOCKS_PER_GROUP if fast else DECOY_BLOCKS_PER_GROUP)
    # Fast effects guess from the residual, all others the same every time.
    shared: Shared | None = None if fast else {}
    for _ in range(count):
        values = rest.copy()
        for block in blocks:
            values[block] *= generator.choice([-1.0, 1.0])
        values -= view.span @ (view.span.T @ values)
        shuffled = np.zeros_like(view.residual)
        shuffled[view.valid] = values
        decoy = replace(view, residual=shuffled)
        found, _tried = search(fit.session, decoy, candidate.term.effect, shared=shared)
        if found is not None:
            worst = max(worst, found.likelihood)
    return worst


def refusal(candidate: Candidate, gate: Gate) -> str | None:
    """Say why a candidate does not pass the gate, or None where it passes."""
    if candidate.p_value > gate.largest_p:
        return f"p = {candidate.p_value:.2g}, above {gate.largest_p:g}"
    if candidate.gain < gate.smallest_gain:
        return f"held-out gain {candidate.gain:.2%}, below {gate.smallest_gain:.0%}"
    if candidate.t_value < gate.smallest_t:
        return f"t = {candidate.t_value:.1f} over blocks, below {gate.smallest_t:g}"
    if candidate.consistency < gate.smallest_consistency:
        return (
            f"better in {candidate.consistency:.0%} of the groups, below "
            f"{gate.smallest_consistency:.0%}"
        )
    return None
