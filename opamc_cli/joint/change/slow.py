"""Slow effects: what the target's coefficients say that the baseline's own spread does not.

Each unit's slow current is seen through generalised least squares whose covariance holds, beside
noise, what healthy units differ by: coefficients of the declared effects, of each unit its own. An
effect acts in the target alone if its mean coefficients there lie outside what the baseline shows.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from opamc_cli.decision.significance.moderated import moderated_covariance, shift_p
from opamc_cli.joint.change.units import Compared, own_fit
from opamc_cli.joint.fit.model import Term, currents
from opamc_cli.joint.fit.parts import Sums
from opamc_cli.joint.motion.track import Floats

GAIN_SPREAD, FRICTION_SPREAD, COMMON_SPREAD = 0.02, 0.05, 0.005
"""What is expected of healthy sessions: all coefficients differ by 2 % alike (current sensors),
friction's by 5 % of themselves, and each by what moves half a per cent of the current."""


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
    """Variance, in shares of the slow current's power, that units of one session cannot show."""

    @cached_property
    def precision(self) -> Floats:
        """Inverse of the covariance, in units of the residual's variance; (k, k)."""
        return np.asarray(self.variance * np.linalg.pinv(self.covariance, hermitian=True))


@dataclass(frozen=True)
class Shift:
    """Effects that the target has and the baseline has not, or has less of."""

    terms: tuple[Term, ...]
    """Jointly fitted."""
    coefficients: Floats
    """Mean over the target's units less the baseline's, of all terms' columns."""
    p_value: float
    """Of the last term beside the others."""
    width: int
    """Number of the last term's columns."""

    @property
    def last(self) -> "Shift":
        """The last term's part alone."""
        return replace(self, terms=self.terms[-1:], coefficients=self.coefficients[-self.width :])

    @property
    def falls(self) -> float:
        """By how much the last term is less, where it is friction all over the travel; else 0."""
        effect = self.terms[-1].effect
        everywhere = effect.resists and not effect.at_a_place
        return everywhere * max(-float(self.last.coefficients[0]), 0.0)


def learn(compared: Compared, terms: tuple[Term, ...], between: float = 0.0) -> Population:
    """Mean and spread of the declared effects' coefficients over the baseline's units."""
    healthy = ~compared.after
    sums = compared.sums(terms)
    counts = sums.parts.counts
    coefficients, left = own_fit(compared, terms)
    sample = coefficients[healthy]
    power = float(np.mean((sums.power / counts)[healthy]))
    centre = np.median(sample, axis=0)
    owners = [
        term.effect for term in terms for _ in range(compared.dataset.columns(term, False).shape[1])
    ]
    own = np.array([0.0 if one.carries_load else FRICTION_SPREAD for one in owners])
    sizes = np.maximum(_sizes(sums)[healthy].mean(axis=0), 1e-300)
    prior = np.diag((own * centre) ** 2 + COMMON_SPREAD**2 * power / sizes)
    prior += GAIN_SPREAD**2 * np.outer(centre, centre)
    # Where sessions differ more than is expected, friction is what differs most.
    friction = np.flatnonzero([one.domain == "velocity" for one in owners])
    ratio = float(np.median(np.var(sample, axis=0, ddof=1) / np.diag(prior)))
    prior[np.ix_(friction, friction)] *= max(ratio, 1.0)
    covariance = moderated_covariance(sample, prior)
    names = tuple(one.name for one in owners)
    variance = float(np.median(left[healthy]))
    return Population(terms, sample.mean(axis=0), covariance, variance, power, names, between)


def with_model(compared: Compared, population: Population) -> Compared:
    """Put the load and the current of the baseline's mean model on both grids."""
    dataset, terms = compared.dataset, population.terms
    blocks = [dataset.columns(term, True) for term in terms]
    own = np.split(population.mean, np.cumsum([block.shape[1] for block in blocks])[:-1])
    parts = (block @ values for block, values in zip(blocks, own, strict=True))
    _, model, load = currents(terms, parts, compared.track.size)
    return replace(compared, dataset=dataset.with_model(load, model, terms))


def estimates(sums: Sums, population: Population) -> tuple[Floats, Floats]:
    """Coefficients, (units, k), of columns beside the declared ones, and their information.

    Generalised least squares, in each unit, of sums in which the declared columns come first.
    """
    own = population.mean.size
    cross, products = sums.gram[:, :own, own:], sums.gram[:, own:, own:]
    moment = sums.moment - sums.gram[:, :, :own] @ population.mean
    declared = sums.gram[:, :own, :own] + population.precision
    held = np.swapaxes(cross, 1, 2) @ np.linalg.inv(declared)
    # A bump leaves 1e-310 in a unit that never comes near its place; the inverse would be infinite.
    information = np.where(abs(products) > 1e-200, products - held @ cross, 0) / population.variance
    asked = moment[:, own:] - (held @ moment[:, :own, None])[..., 0]
    inverse = np.linalg.pinv(information, rcond=1e-9, hermitian=True) / population.variance
    return (inverse @ asked[..., None])[..., 0], information


def shifts(
    compared: Compared, population: Population, chosen: tuple[Term, ...], candidates: list[Term]
) -> list[Shift]:
    """Compare both sides for every candidate beside the chosen terms; least likely first."""
    after, own = compared.after, population.mean.size
    trials = []
    for candidate in candidates:
        terms = (*chosen, candidate)
        sums = compared.sums((*population.terms, *terms))
        sizes = _sizes(sums)[:, own:].mean(axis=0)
        if np.all(sizes > 0):
            trials.append((terms, sizes, *estimates(sums, population)))
    ratios = [_spread_ratio(found[~after], known[~after]) for *_, found, known in trials]
    # Units differ by more than noise in what the declared effects do not hold, too; how their
    # declared friction differs, the population's covariance knows already.
    inflation = max(float(np.median(ratios)), 1.0) if ratios else 1.0
    friction = {t.effect.name for t in population.terms if t.effect.domain == "velocity"}
    found = []
    for terms, sizes, sample, information in trials:
        expected = np.linalg.pinv(information[~after].mean(axis=0), rcond=1e-9, hermitian=True)
        expected *= 1.0 if terms[-1].effect.name in friction else inflation
        before, later = sample[~after], sample[after]
        shift = later.mean(axis=0) - before.mean(axis=0)
        covariance = moderated_covariance(before, expected) * (1 / len(before) + 1 / len(later))
        covariance += np.diag(2 * population.between * population.power / sizes)
        width = compared.dataset.columns(terms[-1], False).shape[1]
        p_value = shift_p(shift[-width:], covariance[-width:, -width:], len(before))
        found.append(Shift(terms, shift, p_value, width))
    return sorted(found, key=lambda one: one.p_value)


def _sizes(sums: Sums) -> Floats:
    """Mean square of each column in each unit, (units, k)."""
    return np.asarray(np.diagonal(sums.gram, axis1=1, axis2=2) / sums.parts.counts[:, None])


def _spread_ratio(sample: Floats, information: Floats) -> float:
    """Observed over expected variance of a candidate's coefficients among the baseline's units."""
    centred = sample - sample.mean(axis=0)
    square = float(np.einsum("ni,ij,nj->", centred, information.mean(axis=0), centred))
    return square / float(max((len(sample) - 1) * sample.shape[1], 1))


def left_by(compared: Compared, population: Population, shift: Shift | None = None) -> Floats:
    """Mean square of each unit beyond the baseline's mean model and a shift, (units,)."""
    terms, coefficients = population.terms, population.mean
    if shift is not None:
        terms = (*terms, *shift.terms)
        coefficients = np.concatenate([coefficients, shift.coefficients])
    sums = compared.sums(terms)
    return sums.left(coefficients) / sums.parts.counts


def shift_current(compared: Compared, shift: Shift | None, fine: bool = True) -> Floats | None:
    """Compute a shift's own current in the target, (n,); the baseline has none."""
    if shift is None:
        return None
    columns = [compared.dataset.columns(term, fine) for term in shift.terms]
    acting = np.append(compared.after, False)[compared.dataset.grid_of(fine).track.group]
    return acting * (np.concatenate(columns, axis=1) @ shift.coefficients)


def shift_power(compared: Compared, shift: Shift) -> float:
    """Mean square of a shift's own current in the target's units, A^2."""
    sums = compared.sums(shift.terms)
    powers = np.einsum("i,uij,j->u", shift.coefficients, sums.gram, shift.coefficients)
    return float(np.mean((powers / sums.parts.counts)[compared.after]))
