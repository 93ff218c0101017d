"""How certain a fit's coefficients are, and which of its terms the data cannot tell apart."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.motion.track import Bools, Floats
from opamc_cli.signal.transform.least_squares import SINGULAR_BELOW, eigenvectors

INSEPARABLE = 0.995
"""Multiple correlation of a regressor with the others from which on it is not told apart."""


@dataclass(frozen=True)
class Certainty:
    """Block-robust certainty of one fit."""

    standard_errors: tuple[Floats, ...]
    """One array per term, in the coefficient's unit."""
    factor: float
    """Student factor of the 95 % interval (degrees of freedom: units less one)."""
    condition_number: float
    """Of the regressors scaled to unit length."""
    inseparable: tuple[tuple[str, ...], ...]
    """Sets of effects that can replace one another within the data."""
    one: tuple[tuple[str, ...], ...]
    """Likewise, of which only the sum is known; their coefficients' errors are infinite."""


def certainty(fit: Fit) -> Certainty:
    """Compute standard errors that allow for any correlation inside a unit, and collinear terms.

    References
    ----------
    Liang and Zeger, Biometrika 73, 1986 (the cluster sandwich), with the factor units/(units-1).
    """
    sums = fit.sums
    gram = sums.gram.sum(axis=0)
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    sizes, vectors = eigenvectors(gram / np.outer(scale, scale))
    largest = sizes.max(initial=1e-300)
    unknown = sizes <= SINGULAR_BELOW * largest
    inverse = (vectors / np.where(unknown, np.inf, sizes)) @ vectors.T
    flat = np.concatenate(fit.coefficients) if fit.coefficients else np.zeros(0)
    units = sums.parts.units
    scores = (1 - sums.parts.others) @ (sums.moment - sums.gram @ flat) / scale
    meat = scores.T @ scores * (units / max(units - 1, 1))
    errors = np.sqrt(np.maximum(np.diagonal(inverse @ meat @ inverse), 0.0)) / scale
    # which coefficients each direction is made of
    held = vectors**2 > 0.05 * (vectors**2).max(axis=0, initial=0.0)
    errors[held[:, unknown].any(axis=1)] = np.inf
    widths = [values.size for values in fit.coefficients]
    return Certainty(
        tuple(np.split(errors, np.cumsum(widths)[:-1])) if widths else (),
        float(stdtrit(max(units - 1, 1), 0.975)),
        float(np.sqrt(largest / max(sizes.min(initial=largest), 1e-16 * largest))),
        _sets(fit, held[:, sizes <= 1 - INSEPARABLE]),
        _sets(fit, held[:, unknown]),
    )


def drag_t(fit: Fit) -> float:
    """Mean friction against the motion, over its jackknife error; below 0 it drives."""
    dataset, grid = fit.dataset, fit.dataset.fine
    direction = grid.track.direction[grid.parts.rows]
    weights = [
        direction @ grid.parts.taken(dataset.columns(term, fine=True)) / direction.size
        if term.effect.resists or term.effect.domain == "velocity"
        else np.zeros(values.size)
        for term, values in zip(fit.terms, fit.coefficients, strict=True)
    ]
    drags = fit.sums.coefficients @ np.concatenate([np.zeros(0), *weights])
    error = float(np.std(drags)) * float(np.sqrt(max(drags.size - 1, 1)))
    return float(np.mean(drags)) / max(error, 1e-300)


def _sets(fit: Fit, held: Bools) -> tuple[tuple[str, ...], ...]:
    """Name the terms that cancel in each of some directions, in columns."""
    sizes = [values.size for values in fit.coefficients]
    names = np.repeat([term.effect.name for term in fit.terms], sizes)
    sets = (tuple(sorted(set(names[each].tolist()))) for each in held.T)
    return tuple(dict.fromkeys(one for one in sets if len(one) > 1))
