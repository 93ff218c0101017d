"""How certain a fit's coefficients are, and which of its terms the data cannot tell apart."""

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from opamc_cli.joint.fit.model import Fit
from opamc_cli.joint.motion.track import Floats
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


def certainty(fit: Fit) -> Certainty:
    """Compute standard errors that allow for any correlation inside a unit, and collinear terms.

    References
    ----------
    Liang and Zeger, Biometrika 73, 1986 (the cluster sandwich), with the factor units/(units-1).
    """
    sums = fit.sums
    gram = sums.gram.sum(axis=0)
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    scaled = gram / np.outer(scale, scale)
    inverse = np.linalg.pinv(scaled, rcond=SINGULAR_BELOW, hermitian=True)
    flat = np.concatenate(fit.coefficients) if fit.coefficients else np.zeros(0)
    units = sums.parts.units
    scores = (1 - sums.parts.others) @ (sums.moment - sums.gram @ flat) / scale
    meat = scores.T @ scores * (units / max(units - 1, 1))
    covariance = inverse @ meat @ inverse
    errors = np.sqrt(np.maximum(np.diagonal(covariance), 0.0)) / scale
    widths = [values.size for values in fit.coefficients]
    sizes = np.linalg.eigvalsh(scaled) if flat.size else np.ones(1)
    return Certainty(
        tuple(np.split(errors, np.cumsum(widths)[:-1])) if widths else (),
        float(stdtrit(max(units - 1, 1), 0.975)),
        float(np.sqrt(sizes[-1] / max(sizes[0], 1e-16 * sizes[-1]))),
        _inseparable(scaled, fit, widths),
    )


def drag_t(fit: Fit) -> float:
    """Mean friction against the motion, over its jackknife error; below 0 it drives."""
    dataset, grid = fit.dataset, fit.dataset.fine
    direction = grid.track.direction[grid.parts.rows]
    weights = [
        direction @ grid.parts.taken(dataset.columns(term, fine=True)) / direction.size
        if term.effect.domain == "velocity" or term.effect.follows_load
        else np.zeros(values.size)
        for term, values in zip(fit.terms, fit.coefficients, strict=True)
    ]
    drags = fit.sums.coefficients @ np.concatenate([np.zeros(0), *weights])
    error = float(np.std(drags)) * float(np.sqrt(max(drags.size - 1, 1)))
    return float(np.mean(drags)) / max(error, 1e-300)


def _inseparable(scaled: Floats, fit: Fit, widths: list[int]) -> tuple[tuple[str, ...], ...]:
    """Small eigenvectors of the scaled products name the terms that cancel in them."""
    if not widths:
        return ()
    owner = np.repeat(np.arange(len(widths)), widths)
    values, vectors = eigenvectors(scaled)
    sets: list[tuple[str, ...]] = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value > 1 - INSEPARABLE:
            break
        weights = vector**2
        members = {
            fit.terms[owner[i]].effect.name for i in np.flatnonzero(weights > 0.05 * weights.max())
        }
        if len(members) > 1:
            sets.append(tuple(sorted(members)))
    return tuple(dict.fromkeys(sets))
