"""Orthonormal columns of a model's span."""

import numpy as np

from opamc_cli.joint.normal import eigenvectors
from opamc_cli.joint.track import Floats

SPANNED = 1e-6
"""A column of which a span leaves less than this share of the energy is rounding."""
ROWS_AT_A_TIME = 16_384


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
