"""Least squares from sums per group, so that leaving a group out is cheap."""

from dataclasses import dataclass

import numpy as np

from opamc_cli.joint.track import Floats

SINGULAR_BELOW = 1e-9


@dataclass(frozen=True)
class Normal:
    """Sums of products per group.

    Attributes
    ----------
    gram : array of shape (groups, k, k)
        Products of regressors.
    moment : array of shape (groups, k)
        Regressors times the signal.
    power : array of shape (groups,)
        Sum of squares of the signal.
    count : array of shape (groups,)
        Samples.
    """

    gram: Floats
    moment: Floats
    power: Floats
    count: Floats

    def taken(self, columns: list[int]) -> "Normal":
        """Return the sums of a subset of the regressors."""
        index = np.asarray(columns, dtype=np.int64)
        return Normal(
            self.gram[:, index[:, None], index], self.moment[:, index], self.power, self.count
        )


def normal_equations(
    columns: Floats, signal: Floats, slices: tuple[tuple[int, int], ...]
) -> Normal:
    """Sum products over each group.

    Parameters
    ----------
    columns : array of shape (n, k)
        Regressors.
    signal : array of shape (n,)
        Current or residual.
    slices : tuple of (int, int)
        Half-open sample ranges of the groups.
    """
    k = columns.shape[1]
    groups = len(slices)
    gram = np.zeros((groups, k, k))
    moment = np.zeros((groups, k))
    power = np.zeros(groups)
    count = np.zeros(groups)
    for g, (start, stop) in enumerate(slices):
        part = columns[start:stop]
        values = signal[start:stop]
        gram[g] = part.T @ part
        moment[g] = part.T @ values
        power[g] = values @ values
        count[g] = stop - start
    return Normal(gram, moment, power, count)


def solve(gram: Floats, moment: Floats) -> Floats:
    """Minimum-norm least squares of scaled normal equations.

    Parameters
    ----------
    gram : array of shape (k, k) or (groups, k, k)
        Products of regressors.
    moment : array of shape (k,) or (groups, k)
        Regressors times the signal.

    Returns
    -------
    array of shape (k,) or (groups, k)
        Coefficients; directions below 1e-9 of the largest get none.
    """
    if moment.shape[-1] == 0:
        return moment
    if moment.shape == (1,):
        alone: Floats = moment / np.maximum(gram[0], 1e-200)
        return alone
    scale = np.sqrt(np.maximum(np.diagonal(gram, axis1=-2, axis2=-1), 1e-200))
    scaled = gram / (scale[..., :, None] * scale[..., None, :])
    solution: Floats = np.einsum("...ij,...j->...i", _inverse(scaled), moment / scale) / scale
    return solution


def _inverse(gram: Floats) -> Floats:
    """Pseudo-inverse of symmetric matrices, shape (..., k, k), by their eigenvectors."""
    values, vectors = np.linalg.eigh(gram)
    sizes = np.abs(values)
    large = sizes > SINGULAR_BELOW * sizes.max(axis=-1, keepdims=True)
    factors = np.divide(1.0, values, out=np.zeros_like(values), where=large)
    inverse: Floats = (vectors * factors[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return inverse


def fitted_error(normal: Normal) -> float:
    """Sum of squared residuals of the fit to all groups."""
    coefficients = solve(normal.gram.sum(axis=0), normal.moment.sum(axis=0))
    return float(normal.power.sum() - coefficients @ normal.moment.sum(axis=0))


def held_out_error(normal: Normal, ridged: int = 0) -> Floats:
    """Sum of squared residuals in each group of the fit to all other groups.

    Parameters
    ----------
    normal : Normal
        Sums per group, at least 2 groups.
    ridged : int
        Number of last regressors that are held back by a ridge of 1e-3 of their energy: flexible
        bases have knots that a group alone excites.

    Returns
    -------
    array of shape (groups,)
    """
    gram_total = normal.gram.sum(axis=0)
    scale = np.sqrt(np.diagonal(gram_total))
    unit = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 1e-100)
    gram = normal.gram * (unit[:, None] * unit)
    moment = normal.moment * unit
    rest = gram.sum(axis=0) - gram
    if ridged:
        rest = rest + np.diag(np.where(np.arange(unit.size) >= unit.size - ridged, 1e-3, 0.0))
    coefficients = np.einsum("gij,gj->gi", _inverse(rest), moment.sum(axis=0) - moment)
    quadratic = np.einsum("gi,gij,gj->g", coefficients, gram, coefficients)
    linear = np.einsum("gi,gi->g", coefficients, moment)
    error: Floats = np.maximum(normal.power - 2 * linear + quadratic, 0.0)
    return error
