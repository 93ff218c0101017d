"""Slow effects: what the target's coefficients say that the baseline's own spread does not.

Each unit's slow current is seen through generalised least squares whose covariance holds, beside
noise, what healthy units differ by: every unit has its own coefficients of the declared effects,
drawn from a common distribution. An effect of the library acts in the target alone if the mean of
its coefficients there lies outside what the baseline's units show for the same regressors.
"""

from dataclasses import dataclass

import numpy as np

from opamc_cli.joint.change.moderated import moderated_covariance, shift_p
from opamc_cli.joint.change.units import Unit, own_fit
from opamc_cli.joint.effects.base import Effect
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.motion.track import Floats

GAIN_SPREAD, FRICTION_SPREAD, COMMON_SPREAD = 0.02, 0.05, 0.005
"""What is expected of healthy sessions: all coefficients differ by 2 % alike (current sensors),
friction's by 5 % of themselves, and each by what moves half a per cent of the current."""

FEWEST_EXCITED = 10.0


@dataclass(frozen=True)
class Population:
    """What the baseline's units are like."""

    terms: tuple[Term, ...]
    """Declared effects."""
    mean: Floats
    """Mean coefficients; (k,)."""
    covariance: Floats
    """Of one unit's coefficients; (k, k)."""
    variance: float
    """Of the coarse grid's residual."""
    power: float
    """Mean square of the slow current."""
    names: tuple[str, ...]
    """Effect of each coefficient."""
    between: float
    """Variance, in shares of the slow current's power, by which sessions differ beyond what units
    of one session can show."""


@dataclass(frozen=True)
class Shift:
    """Effects that the target has and the baseline has not, or has less of."""

    terms: tuple[Term, ...]
    """Jointly fitted."""
    coefficients: Floats
    """Mean over the target's units less the baseline's, of all terms' columns."""
    covariance: Floats
    """Of these."""
    p_value: float
    """Of the last term beside the others."""
    width: int
    """Number of the last term's columns."""


@dataclass(frozen=True)
class Prepared:
    """One unit with the part of generalised least squares that no candidate changes."""

    unit: Unit
    declared: Floats
    inner: Floats
    residual: Floats

    def estimate(self, extra: Floats, variance: float) -> tuple[Floats, Floats]:
        """Coefficients of extra columns in this unit, and their information matrix."""
        cross = self.declared.T @ extra
        gram = (extra.T @ extra - cross.T @ self.inner @ cross) / variance
        inner_moment = self.inner @ (self.declared.T @ self.residual)
        moment = (extra.T @ self.residual - cross.T @ inner_moment) / variance
        return np.linalg.pinv(gram, rcond=1e-9, hermitian=True) @ moment, gram


def learn(units: list[Unit], terms: tuple[Term, ...], between: float = 0.0) -> Population:
    """Mean and spread of the declared effects' coefficients over the baseline's units."""
    fits = [own_fit(unit, terms) for unit in units]
    sample = np.stack([coefficients for coefficients, _ in fits])
    sizes = np.mean([np.mean(unit.stacked(terms) ** 2, axis=0) for unit in units], axis=0)
    power = float(np.mean([np.mean(unit.current_a() ** 2) for unit in units]))
    centre = np.median(sample, axis=0)
    owners = [term.effect for term in terms for _ in units[0].columns(term).T]
    own = np.array([0.0 if one.carries_load else FRICTION_SPREAD for one in owners])
    prior = np.diag((own * centre) ** 2 + COMMON_SPREAD**2 * power / np.maximum(sizes, 1e-300))
    prior += GAIN_SPREAD**2 * np.outer(centre, centre)
    # Where sessions differ more than is expected, friction is what differs most.
    friction = np.flatnonzero([one.domain == "velocity" for one in owners])
    ratio = float(np.median(np.var(sample, axis=0, ddof=1) / np.diag(prior)))
    prior[np.ix_(friction, friction)] *= max(ratio, 1.0)
    variance = float(np.median([np.mean(residual**2) for _, residual in fits]))
    covariance = moderated_covariance(sample, prior)
    names = tuple(one.name for one in owners)
    return Population(terms, sample.mean(axis=0), covariance, variance, power, names, between)


def prepared(units: list[Unit], population: Population) -> list[Prepared]:
    """Do once per unit what every candidate needs."""
    precision = population.variance * np.linalg.pinv(population.covariance, hermitian=True)
    ready = []
    for unit in units:
        declared = unit.stacked(population.terms)
        inner = np.linalg.inv(declared.T @ declared + precision)
        ready.append(Prepared(unit, declared, inner, unit.current_a() - declared @ population.mean))
    return ready


def shifts(
    units: list[Prepared], population: Population, chosen: tuple[Term, ...], candidates: list[Term]
) -> list[Shift]:
    """Compare both sides for every candidate beside the chosen terms; least likely first."""
    trials = []
    for candidate in candidates:
        terms = (*chosen, candidate)
        columns = [one.unit.stacked(terms) for one in units]
        if all(_excited(part[:, -1]) and np.all(np.isfinite(part)) for part in columns):
            pairs = [
                one.estimate(part, population.variance)
                for one, part in zip(units, columns, strict=True)
            ]
            trials.append((terms, candidate, columns, pairs))
    after = np.array([one.unit.after for one in units])
    ratios = [
        _spread_ratio([pair for pair, new in zip(pairs, after, strict=True) if not new])
        for _, _, _, pairs in trials
    ]
    # Units differ by more than noise in what the declared effects do not hold, too; how their
    # declared friction differs, the population's covariance knows already.
    inflation = max(float(np.median(ratios)), 1.0) if ratios else 1.0
    friction = {t.effect.name for t in population.terms if t.effect.domain == "velocity"}
    found = []
    for terms, candidate, columns, pairs in trials:
        estimates = np.stack([estimate for estimate, _ in pairs])
        information = np.mean(
            [gram for (_, gram), new in zip(pairs, after, strict=True) if not new], axis=0
        )
        expected = np.linalg.pinv(information, rcond=1e-9, hermitian=True)
        expected *= 1.0 if candidate.effect.name in friction else inflation
        before, later = estimates[~after], estimates[after]
        shift = later.mean(axis=0) - before.mean(axis=0)
        covariance = moderated_covariance(before, expected) * (1 / len(before) + 1 / len(later))
        sizes = np.mean([np.mean(part**2, axis=0) for part in columns], axis=0)
        covariance += np.diag(2 * population.between * population.power / sizes)
        own = units[0].unit.columns(candidate).shape[1]
        last = slice(shift.size - own, shift.size)
        p_value = shift_p(shift[last], covariance[last, last], len(before))
        found.append(Shift(terms, shift, covariance, p_value, own))
    return sorted(found, key=lambda one: one.p_value)


def _excited(column: Floats) -> bool:
    """Tell whether more than a few samples carry a regressor."""
    squares = column**2
    return float(squares.sum()) ** 2 > FEWEST_EXCITED * max(float((squares**2).sum()), 1e-300)


def _spread_ratio(pairs: list[tuple[Floats, Floats]]) -> float:
    """Observed over expected variance of a candidate's coefficients among the baseline's units."""
    estimates = np.stack([estimate for estimate, _ in pairs])
    information = np.mean([gram for _, gram in pairs], axis=0)
    centred = estimates - estimates.mean(axis=0)
    freedom = (len(pairs) - 1) * estimates.shape[1]
    square = float(np.einsum("ni,ij,nj->", centred, information, centred))
    return square / float(max(freedom, 1))


def slow_candidates(units: list[Unit], effects: list[Effect]) -> list[Term]:
    """Every effect with every guess of its parameters, where all units can show it."""
    found = []
    track = units[-1].coarse
    for effect in effects:
        if all(effect.untestable(unit.fine) is None for unit in units):
            guesses = effect.guesses(track, np.zeros(track.size))
            found += [Term(effect, guess) for guess in guesses]
    return found


def shift_current(unit: Unit, shift: Shift | None, fine: bool = False) -> Floats | float:
    """Compute a shift's own current in a unit of the target; the baseline has none."""
    if shift is None or not unit.after:
        return 0.0
    return unit.stacked(shift.terms, fine) @ shift.coefficients


def without(unit: Unit, shift: Shift | None, fine: bool = True) -> Floats:
    """Take a shift from a unit's current."""
    rest: Floats = unit.current_a(fine) - shift_current(unit, shift, fine)
    return rest
