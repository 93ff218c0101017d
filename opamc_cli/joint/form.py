"""Whether an added effect has the right form: smooth tests of what it leaves.

An effect that is not in the library is often well imitated by one that is. An imitation betrays
itself in what it leaves: a smooth function of some covariate. Every covariate's cosines, smoothest
first, are added until they explain no more, as in a data-driven smooth test (Ledwina, Journal of
the American Statistical Association 89, 1994); random signs of blocks say what chance would give.
"""

from dataclasses import dataclass, replace

import numpy as np

from opamc_cli.joint.model import Fit, Session, Term
from opamc_cli.joint.search import Candidate
from opamc_cli.joint.span import orthonormal, orthonormal_beside
from opamc_cli.joint.steadiness import unsteady
from opamc_cli.joint.track import Bools, Floats, Track
from opamc_cli.joint.view import View, blocks_of, prepare

BLOCKS_PER_GROUP = 4
SIGNS = 999
COST = 2.0
"""What another cosine must earn, as in Akaike's criterion."""
LEAST_EXCESS = 12.0
"""In likelihood units. Right forms left up to 9 in 40 simulated joints, imitations 14 to 2000."""
LEAST_SHARE = 0.05
"""Of the effect's own likelihood: in clean recordings the motion's own smoothing leaves as much."""
LARGEST_P = 0.005
SUBSUMED = 0.3
"""An effect is an imitation if the cosines leave it less than this share of its likelihood."""
TELLING_EXCESS = 60.0
"""In likelihood units, for structure where nothing was added. Of 100 simulated joints with nothing
missing none left more than 50; slow effects taken out of the library at 0.6 of the noise 60 to
320."""
SLOW_DOMAINS = ("time", "temperature")
CLOCK_WAVES = 5
PRESSING = 2.5
"""Standard deviations with which a parameter may press against its limit."""
NEAR = 0.02
"""Share of its range within which a parameter is at its limit."""


@dataclass(frozen=True)
class Misfit:
    """What the cosines of one covariate explain of what a model leaves.

    Attributes
    ----------
    domain : str
        Of the covariate.
    excess : float
        Likelihood of the best number of cosines less their cost.
    p_value : float
        Share of random signs with as large an excess.
    basis : array of shape (m, k)
        Whitened cosines on the view's valid samples.
    """

    domain: str
    excess: float
    p_value: float
    basis: Floats


def cosines(values: Floats, count: int) -> Floats:
    """Cosines over a covariate, each half a wave more than the one before.

    Parameters
    ----------
    values : array of shape (n,)
        Covariate.
    count : int
        Half waves of the last cosine.

    Returns
    -------
    array of shape (count + 1, n)
        The first is constant. The phase is the mean of the value's share of the range and of its
        rank, so that neither sparse nor crowded values lack resolution.
    """
    low, high = np.quantile(values, [0.002, 0.998])
    share = np.clip((values - low) / max(float(high - low), 1e-300), 0.0, 1.0)
    rank = np.empty(values.size)
    rank[np.argsort(values, kind="stable")] = (np.arange(values.size) + 0.5) / values.size
    waves: Floats = np.cos(np.pi * np.arange(count + 1)[:, None] * 0.5 * (share + rank))
    return waves


def smooth_bases(track: Track, rows: Bools) -> dict[str, Floats]:
    """Smooth functions of each covariate, smoothest first.

    Parameters
    ----------
    track : Track
        With fitted load.
    rows : bool array of shape (n,)
        Samples over whose values the cosines spread; zero elsewhere.

    Returns
    -------
    dict of str to array of shape (n, k)
    """

    def over(values: Floats, count: int) -> Floats:
        spread = np.zeros((count + 1, track.size))
        spread[:, rows] = cosines(values[rows], count)
        return spread

    sign = track.direction
    velocity = track.velocity / track.speed_scale
    speed = over(np.abs(velocity), 8)
    place = over(track.position_rad, 16)
    change = over(track.acceleration, 6)
    clock = over(track.time_s, CLOCK_WAVES)
    load = track.load_a
    changing = (velocity, sign, load) if np.std(load[rows]) > 0 else (velocity, sign)
    columns: dict[str, list[Floats]] = {
        "velocity": [part for wave in speed for part in (wave, sign * wave)],
        "joint-angle": [part for wave in place for part in (wave, sign * wave)],
        "acceleration": list(change[1:]),
        "time": [
            clock[0],
            *(p for wave in clock[1:] for p in (*(wave * part for part in changing), wave)),
        ],
    }
    if np.std(np.abs(load[rows])) > 0:
        waves = over(np.abs(load), 6)[1:]
        columns["load"] = [part for wave in waves for part in (sign * wave, wave)]
    temperature = track.temperature_c
    if temperature is not None and np.ptp(temperature[rows]) > 0.3:
        waves = over(temperature, 4)[1:]
        columns["temperature"] = [part for wave in waves for part in (wave * velocity, wave * sign)]
    return {domain: np.stack(parts, axis=1) for domain, parts in columns.items()}


def misfits(fit: Fit, view: View, added: tuple[Term, ...], seed: int) -> list[Misfit]:
    """Compute what smooth functions of each covariate explain of what a fit leaves.

    Parameters
    ----------
    fit : Fit
        Declared and added effects.
    view : View
        From `prepare`, on the coarse grid.
    added : tuple of Term
        Those whose non-linear parameters might bend: what bending could explain is no misfit.
    seed : int
        For the signs.

    Returns
    -------
    list of Misfit
        Largest excess first.
    """
    bends = [
        bend
        for term, values in zip(fit.terms, fit.coefficients, strict=True)
        if term in added and not term.effect.fast
        for bend in _bends(fit.session, term, values)
    ]
    span = view.span
    if bends:
        beside = orthonormal_beside(view.whitened_rows(np.stack(bends, axis=1)), span)
        span = np.concatenate([span, beside], axis=1)
    rest = view.values - span @ (span.T @ view.values)
    rest = rest / np.sqrt(np.sum(rest**2) / max(rest.size - span.shape[1], 1))
    blocks = blocks_of(view, BLOCKS_PER_GROUP)
    label = np.zeros(rest.size, dtype=np.int64)
    for number, block in enumerate(blocks):
        label[block] = number
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(SIGNS, len(blocks)))
    found = []
    for domain, columns in smooth_bases(view.grid.track, view.valid).items():
        basis = view.whitened_rows(columns)
        waves = _in_turn(basis, span)
        if not waves.shape[1]:
            continue
        products = np.zeros((len(blocks), waves.shape[1]))
        np.add.at(products, label, waves * rest[:, None])
        excess = float(_best_excess(products.sum(axis=0)))
        by_chance = _best_excess(signs @ products)
        p_value = (1 + int(np.count_nonzero(by_chance >= excess))) / (SIGNS + 1)
        found.append(Misfit(domain, excess, p_value, basis))
    return sorted(found, key=lambda misfit: -misfit.excess)


def slow_misfit(fit: Fit, seed: int) -> Misfit | None:
    """Find friction or load that changes with time or temperature far more than chance would show.

    What changes from cycle to cycle does not repeat, and a cycle that is left out is not predicted
    by the others: neither the ceiling nor the held-out bases see it. A drift of the current alone,
    whatever the joint does, is what slow noise looks like, and does not count.

    Parameters
    ----------
    fit : Fit
        The model.
    seed : int
        For the signs.

    Returns
    -------
    Misfit or None
    """
    view = prepare(fit, fine=False)
    if not view.rows.size:
        return None
    track = view.grid.track
    drift = np.zeros((track.size, CLOCK_WAVES))
    drift[view.valid] = cosines(track.time_s[view.valid], CLOCK_WAVES)[1:].T
    beside = orthonormal_beside(view.whitened_rows(drift), view.span)
    steady = replace(view, span=np.concatenate([view.span, beside], axis=1))
    for misfit in misfits(fit, steady, (), seed):
        if misfit.domain in SLOW_DOMAINS:
            telling = misfit.excess >= TELLING_EXCESS and misfit.p_value <= LARGEST_P
            return misfit if telling else None
    return None


def _best_excess(scores: Floats) -> Floats:
    """Largest sum of the first squares, each less its cost."""
    best: Floats = np.cumsum(scores**2 - COST, axis=-1).max(axis=-1)
    return best


def _in_turn(basis: Floats, span: Floats) -> Floats:
    """Orthonormal columns, each what its predecessors and the model leave of it."""
    energy = np.einsum("ij,ij->j", basis, basis)
    left = basis - span @ (span.T @ basis)
    left = left[:, np.einsum("ij,ij->j", left, left) > 1e-4 * energy]
    if not left.shape[1]:
        return left
    waves, triangle = np.linalg.qr(left)
    lengths = np.abs(np.diag(triangle))
    kept: Floats = waves[:, lengths > 1e-3 * lengths.max()]
    return kept


def _bends(session: Session, term: Term, values: Floats) -> list[Floats]:
    """Change of a term's current with each non-linear parameter, and columns it can do without."""
    track = session.coarse.track
    found = []
    if term.keep is not None:
        found = list(session.columns(Term(term.effect, term.parameters), fine=False).T)
    for name, (low, high) in term.effect.limits(track).items():
        if name not in term.parameters:
            continue
        step = 1e-3 * (high - low)
        step = step if term.parameters[name] + step <= high else -step
        moved = Term(term.effect, term.parameters | {name: term.parameters[name] + step}, term.keep)
        columns = session.columns(moved, fine=False) - session.columns(term, fine=False)
        bend = columns @ values / step
        if np.any(bend):
            found.append(bend)
    return found


def imitations(fit: Fit, added: tuple[Term, ...], seed: int) -> dict[int, str]:
    """Tell the added effects that stand for something else.

    Parameters
    ----------
    fit : Fit
        Declared and added effects.
    added : tuple of Term
        The latter.
    seed : int
        For the signs.

    Returns
    -------
    dict of int to str
        Place in `added`, and the domain of what the effect imitates: one in which smooth functions
        explain more than chance and a twentieth of what the effect does, and either leave the
        effect nothing to explain or explain more than it does; or time, if it is periodic and
        comes in bursts.
    """
    if not added:
        return {}
    view = prepare(fit, fine=False)
    result = {}
    if any(term.effect.fast for term in added):
        fine = view if fit.session.coarse is fit.session.fine else prepare(fit, fine=True)
        result = dict.fromkeys(unsteady(fit, fine, added), "time")
    found = misfits(fit, view, added, seed)
    if not found or found[0].excess < LEAST_EXCESS or found[0].p_value > LARGEST_P:
        return result
    worst = found[0]
    start = 0
    variance = view.power / max(view.values.size - view.span.shape[1], 1)
    model = np.concatenate(
        [view.whitened_rows(fit.session.columns(term, fine=False)) for term in fit.terms], axis=1
    )
    for term, values in zip(fit.terms, fit.coefficients, strict=True):
        own = np.s_[start : start + values.size]
        start += values.size
        if term not in added:
            continue
        columns, others = model[:, own], np.delete(model, own, axis=1)
        signal = view.values + columns @ values
        alone = _worth(signal, columns, others) / variance
        beside = _worth(signal, columns, np.concatenate([others, worst.basis], axis=1)) / variance
        if worst.excess < LEAST_SHARE * alone:
            continue
        # What is fast averages out on the coarse grid: there it need not explain the most.
        trifling = worst.excess > alone and not term.effect.fast
        if beside < SUBSUMED * alone or trifling:
            result[added.index(term)] = worst.domain
    return result


def _worth(signal: Floats, columns: Floats, others: Floats) -> float:
    """Fall of the sum of squares by regressors, beside others."""
    span = orthonormal(others.copy())
    own = orthonormal_beside(columns, span)
    return float(np.sum((own.T @ signal) ** 2))


def pressed_limit(session: Session, view: View, candidate: Candidate) -> str | None:
    """Say which limit of its parameters a candidate presses against, or None.

    A form whose best parameters lie where they have no meaning is another form.

    Parameters
    ----------
    session : Session
        Recordings.
    view : View
        The candidate's.
    candidate : Candidate
        From `search`.

    Returns
    -------
    str or None
    """
    term, effect = candidate.term, candidate.term.effect
    if effect.fast:
        return None
    columns = view.whitened_rows(session.columns(term, candidate.fine))
    span = orthonormal(np.concatenate([view.span, columns], axis=1))
    rest = view.values - candidate.contribution
    limits = {
        name: (low, high)
        for name, (low, high) in effect.limits(view.grid.track).items()
        if name in term.parameters
    }
    at_limit = {
        name
        for name, (low, high) in limits.items()
        if not low + NEAR * (high - low) < term.parameters[name] < high - NEAR * (high - low)
    }
    if len(at_limit) > 1 and at_limit == set(limits):
        return "all its parameters lie at their limits"
    for name in sorted(at_limit.difference(effect.open_limits)):
        low, high = limits[name]
        value, near = term.parameters[name], NEAR * (high - low)
        inward = near if value < low + near else -near
        if name in effect.firm_limits:
            return f"its {name} lies at the limit {low if inward > 0 else high:.3g}"
        moved = Term(effect, term.parameters | {name: value + inward}, term.keep)
        bend = (columns - view.whitened_rows(session.columns(moved, candidate.fine))) @ (
            candidate.coefficients
        )
        bend = bend - span @ (span.T @ bend)
        length = float(np.linalg.norm(bend))
        if length > 0 and float(bend @ rest) > PRESSING * length * np.sqrt(view.variance):
            return f"its {name} presses against the limit {low if inward > 0 else high:.3g}"
    return None
