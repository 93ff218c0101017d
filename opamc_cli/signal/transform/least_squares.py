"""Least squares of scaled sums of products, for regressors of any size and any likeness."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SINGULAR_BELOW = 1e-7
"""Of the largest eigenvalue: regressors that differ by less than 3e-4 of their size are not told
apart; what noise makes of the difference would be extrapolated (docs/loop.md)."""


def solve(gram: Floats, moment: Floats) -> Floats:
    """Minimum-norm least squares of scaled normal equations; (k,), or (groups, k) of stacked ones.

    Of products of regressors, (k, k), and these times the signal, (k,); directions below 1e-7 of
    the largest get no coefficient.
    """
    return (inverse(gram) @ moment[..., None])[..., 0]


def inverse(gram: Floats) -> Floats:
    """Pseudo-inverses of scaled, stacked matrices of products, shape (..., k, k)."""
    if gram.shape[-1] == 0:
        return gram
    sizes = np.diagonal(gram, axis1=-2, axis2=-1)
    # What nothing excites has no coefficient, not even the rounding of an eigenvector.
    scale = np.sqrt(np.where(sizes > 0, sizes, np.inf))
    both = scale[..., :, None] * scale[..., None, :]
    scaled = gram / both + np.eye(gram.shape[-1]) * (sizes <= 0)[..., None]
    try:
        found = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        found = np.full_like(scaled, np.nan)
    # Norms of a matrix and its inverse bound how far its eigenvalues lie apart.
    with np.errstate(over="ignore"):
        norms = [np.linalg.norm(one, axis=(-2, -1)) for one in (scaled, found)]
    near = ~(math.prod(norms) * SINGULAR_BELOW < 1)
    if near.any():
        values, vectors = eigenvectors(scaled[near])
        spread = np.abs(values)
        large = spread > SINGULAR_BELOW * spread.max(axis=-1, keepdims=True)
        factors = np.divide(1.0, values, out=np.zeros_like(values), where=large)
        found[near] = (vectors * factors[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(found / both)


def eigenvectors(symmetric: Floats) -> tuple[Floats, Floats]:
    """Eigenvalues, ascending, and eigenvectors, in columns, of symmetric matrices (..., k, k).

    LAPACK's divide and conquer, which is numpy's and the fastest, gives up on a rare matrix that
    has nothing wrong with it; plain QR iteration then takes its place.
    """
    try:
        values, vectors = np.linalg.eigh(symmetric)
    except np.linalg.LinAlgError:
        from scipy.linalg import eigh  # a hundredth of a lone night to load, for a rare matrix

        values, vectors = eigh(symmetric, driver="ev")
    return values, vectors


def root_of(gram: Floats) -> Floats:
    """Upper triangular R with ``R.T @ R`` a matrix of products, both (k, k)."""
    scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    values, vectors = eigenvectors(gram / np.outer(scale, scale))
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return np.asarray(np.linalg.qr(root, mode="r") * scale)


def leverage(columns: Floats, root: Floats) -> Floats:
    """Squared distance of regressors, (n, k), from zero per direction that a fit could tell; (n,).

    `root`, (any, k), is that of their mean products where they were fitted: there it is 1 on the
    mean. Directions below 1e-7 of the largest got no coefficient; what lies farther out in one of
    them than it may have where the fit was made is as far from it.
    """
    size = np.linalg.norm(root, axis=0)
    # What nothing excited there is unknown wherever it is anything.
    scale = np.where(size > 0, size, 1e-150)
    _, sizes, vectors = np.linalg.svd(root / scale, full_matrices=False)
    least = math.sqrt(SINGULAR_BELOW) * sizes.max(initial=0.0)
    told = sizes > least
    whitened = columns @ (vectors / np.maximum(sizes, least)[:, None] / scale).T
    return np.asarray(np.sum(whitened**2, axis=1) / max(np.count_nonzero(told), 1))
