"""Least squares from sums per group, so that leaving a group out is cheap."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

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


def halves(slices: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    """Cut half-open ranges in two."""
    parts = ((start, (start + stop) // 2, stop) for start, stop in slices)
    return tuple(piece for a, b, c in parts for piece in ((a, b), (b, c)) if piece[1] > piece[0])


def extended(
    known: Normal | None,
    places: Sequence[int | None],
    columns: Sequence[Floats],
    signal: Floats,
    rows: Sequence[NDArray[np.int64]],
) -> Normal:
    """Sum products over each group, taking what is known from an earlier sum.

    Parameters
    ----------
    known : Normal or None
        Of other regressors and the same signal and rows.
    places : sequence of (int or None)
        For each block its first regressor's place in `known`, or None where it is new.
    columns : sequence of arrays of shape (n, k)
        Blocks of regressors on the whole grid.
    signal : array of shape (n,)
        Current or residual on the whole grid.
    rows : sequence of int arrays
        Samples of each group on the grid.
    """
    widths = [block.shape[1] for block in columns]
    total = sum(widths)
    starts = np.concatenate([[0], np.cumsum(widths)]).astype(int)
    new = [i for i, place in enumerate(places) if place is None or known is None]
    fresh = [k for i in new for k in range(starts[i], starts[i + 1])]
    old = [k for k in range(total) if k not in set(fresh)]
    gram = np.zeros((len(rows), total, total))
    moment = np.zeros((len(rows), total))
    if known is not None and old:
        before = [
            place + k
            for place, width in zip(places, widths, strict=True)
            if place is not None
            for k in range(width)
        ]
        gram[:, np.array(old)[:, None], old] = known.gram[:, np.array(before)[:, None], before]
        moment[:, old] = known.moment[:, before]
    power = np.zeros(len(rows))
    for g, members in enumerate(rows):
        values = signal[members]
        power[g] = values @ values
        if not fresh:
            continue
        part = np.empty((members.size, total), order="F")
        for block, start in zip(columns, starts[:-1], strict=True):
            for k in range(block.shape[1]):
                np.take(block[:, k], members, out=part[:, start + k])
        mine = part[:, fresh]
        products = mine.T @ part
        gram[g, fresh, :] = products
        gram[g, :, fresh] = products
        moment[g, fresh] = values @ mine
    count = np.array([float(members.size) for members in rows])
    return Normal(gram, moment, power, count)


def appended(
    known: Normal,
    base: Floats,
    columns: Floats,
    signal: Floats,
    slices: tuple[tuple[int, int], ...],
) -> Normal:
    """Add regressors to sums that are known.

    Parameters
    ----------
    known : Normal
        Of `base` and `signal`.
    base : array of shape (n, k)
        Regressors that are in the sums already.
    columns : array of shape (n, m)
        Those that are not.
    signal : array of shape (n,)
        Current or residual.
    slices : tuple of (int, int)
        Half-open sample ranges of the groups.
    """
    width, more = base.shape[1], columns.shape[1]
    gram = np.zeros((len(slices), width + more, width + more))
    gram[:, :width, :width] = known.gram
    moment = np.zeros((len(slices), width + more))
    moment[:, :width] = known.moment
    for g, (start, stop) in enumerate(slices):
        part = columns[start:stop]
        cross = base[start:stop].T @ part
        gram[g, :width, width:] = cross
        gram[g, width:, :width] = cross.T
        gram[g, width:, width:] = part.T @ part
        moment[g, width:] = part.T @ signal[start:stop]
    return Normal(gram, moment, known.power, known.count)


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


def eigenvectors(symmetric: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues, ascending, and eigenvectors of symmetric matrices.

    LAPACK's divide and conquer, which is numpy's and the fastest, gives up on a rare matrix that
    has nothing wrong with it; plain QR iteration then takes its place.

    Parameters
    ----------
    symmetric : array of shape (..., k, k)
        Finite.

    Returns
    -------
    values, vectors : arrays of shape (..., k) and (..., k, k)
        Vectors are columns.
    """
    try:
        values, vectors = np.linalg.eigh(symmetric)
    except np.linalg.LinAlgError:
        size = symmetric.shape[-1]
        pairs = [eigh(one, driver="ev") for one in symmetric.reshape(-1, size, size)]
        values = np.stack([pair[0] for pair in pairs]).reshape(symmetric.shape[:-1])
        vectors = np.stack([pair[1] for pair in pairs]).reshape(symmetric.shape)
    return values, vectors


def _inverse(gram: Floats) -> Floats:
    """Pseudo-inverse of symmetric matrices, shape (..., k, k), by their eigenvectors."""
    values, vectors = eigenvectors(gram)
    sizes = np.abs(values)
    large = sizes > SINGULAR_BELOW * sizes.max(axis=-1, keepdims=True)
    factors = np.divide(1.0, values, out=np.zeros_like(values), where=large)
    inverse: Floats = (vectors * factors[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return inverse


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
