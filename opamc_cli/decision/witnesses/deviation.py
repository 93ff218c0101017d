"""How far sessions lie from others, part by part, in units of what healthy ones differ by."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Cell = TypeVar("Cell", bound=Any)
"""A dataclass with arrays that have one row for each session."""

PRIOR_DOF = 4.0
"""Degrees of freedom that the motion's mean variance counts for in each bin's own."""


def chosen(cells: Sequence[Cell], by_session: Sequence[str], rows: Sequence[int]) -> list[Cell]:
    """Return the cells with some of the sessions; `by_session` names the arrays that have them."""
    return [
        replace(cell, **{name: getattr(cell, name)[list(rows)] for name in by_session})
        for cell in cells
    ]


def variance_within_sessions(
    log_power: FloatArray, session_of_cycle: NDArray[np.int64]
) -> FloatArray:
    """Variance of single cycles about their session's mean, bin by bin.

    Parameters
    ----------
    log_power : ndarray, shape (C, F)
        One row per cycle; NaN entries are passed over.
    session_of_cycle : ndarray, shape (C,)
        Label of the session of each.

    Returns
    -------
    ndarray, shape (F,)
        NaN where no session has two cycles.
    """
    squares = np.zeros(log_power.shape[1])
    dof = np.zeros(log_power.shape[1])
    for session in np.unique(session_of_cycle):
        own = log_power[session_of_cycle == session]
        mean, n = mean_of_known(own)
        squares += np.nansum((own - mean) ** 2, axis=0)
        dof += np.maximum(n - 1, 0)
    return np.asarray(np.divide(squares, dof, out=np.full(len(dof), np.nan), where=dof > 0))


def change_between(sessions: FloatArray, n_baseline: int) -> tuple[FloatArray, FloatArray]:
    """Change of each part's mean, and its variance among healthy sessions; NaN if unknown.

    Parameters
    ----------
    sessions : ndarray, shape (B + T, F)
        Baseline first; NaN where nothing is known.
    n_baseline : int
        B.

    Returns
    -------
    change, variance : ndarray, shape (F,)
    """
    baseline = sessions[:n_baseline]
    target, n_target = mean_of_known(sessions[n_baseline:])
    mean, n = mean_of_known(baseline)
    squares = np.nansum((baseline - mean) ** 2, axis=0)
    enough = (n > 1) & (n_target > 0)
    per_session = np.divide(squares, n - 1, out=np.full(n.shape, np.nan), where=enough)
    return target - mean, per_session * (1 / np.maximum(n, 1) + 1 / np.maximum(n_target, 1))


def change_beyond_noise(
    motions: Sequence[tuple[FloatArray, FloatArray, FloatArray]], n_baseline: int
) -> float:
    """Root-mean-square change of the mean session, less what the scatter of cycles explains.

    Parameters
    ----------
    motions : sequence of (ndarray, ndarray, ndarray)
        Of each motion the sessions, shape (B + T, F), the cycles of each, and the variance of a
        single cycle, shape (F,), NaN if unknown.
    n_baseline : int
        B.

    Returns
    -------
    float
        NaN if nothing is known.
    """
    excess = []
    for sessions, cycles, within in motions:
        own, n_own = mean_of_known(sessions[:n_baseline])
        other, n_other = mean_of_known(sessions[n_baseline:])
        both = (n_own > 0) & (n_other > 0)
        if both.any():
            total = cycles[:n_baseline].sum(), cycles[n_baseline:].sum()
            noise = np.nan_to_num(within) * (1 / total[0] + 1 / total[1])
            excess.append(float(((other - own) ** 2 - noise)[both].mean()))
    return math.sqrt(max(float(np.mean(excess)), 0.0)) if excess else math.nan


def clearest_part(
    change: FloatArray, variance: FloatArray, least_variance: float
) -> tuple[float, int]:
    """How clearly the part whose change stands out most does so, and which one it is.

    Parameters
    ----------
    change, variance : ndarray, shape (F,)
        As `change_between` returns them.
    least_variance : float
        Sessions that agree within it agree.

    Returns
    -------
    float
        Squared change over its variance, moderated by the mean of all parts; 0 if nothing is known.
    int
        The part.
    """
    known = np.isfinite(variance)
    if not known.any():
        return 0.0, 0
    typical = float(variance[known].mean())
    ratio = np.where(known, change**2 / (variance + typical + least_variance), 0.0)
    place = int(ratio.argmax())
    return float(ratio[place]), place


def clearest_of(
    sessions: Sequence[FloatArray], n_baseline: int, least_variance: float
) -> tuple[int, int, float, int] | None:
    """Find the motion and the part of it whose change stands out most.

    Parameters
    ----------
    sessions : sequence of ndarray, shape (B + T, F)
        Of each motion, as for `change_between`.
    n_baseline : int
        B.
    least_variance : float
        Sessions that agree within it agree.

    Returns
    -------
    tuple of (int, int, float, int) or None
        Which of `sessions`, which part, its change, and F; None if nothing stands out.
    """
    best, found = 0.0, None
    for number, own in enumerate(sessions):
        change, variance = change_between(own, n_baseline)
        ratio, place = clearest_part(change, variance, least_variance)
        if ratio > best:
            best, found = ratio, (number, place, float(change[place]), change.size)
    return found


def mean_of_known(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean over the first axis of what is known of rows, (n, ...), and its number; NaN without."""
    known = np.isfinite(rows)
    n = known.sum(axis=0).astype(np.float64)
    total = np.where(known, rows, 0.0).sum(axis=0)
    return np.divide(total, n, out=np.full(n.shape, np.nan), where=n > 0), n


def moderated(variance: FloatArray) -> FloatArray:
    """Blend the variance of each bin, (...), with the mean of all; unknown ones take the mean."""
    known = np.isfinite(variance)
    if not known.any():
        return variance
    typical = float(variance[known].mean())
    return (PRIOR_DOF * typical + np.where(known, variance, typical)) / (PRIOR_DOF + 1.0)
