"""Distance between recording sessions by the short-time spectra of their envelopes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.witnesses.evidence import log_mean

FloatArray = NDArray[np.float64]

PRIOR_DOF = 4.0
"""Degrees of freedom that the motion's mean variance counts for in each bin's own."""

LEAST_VARIANCE = 1e-6
"""Of a log power: sessions that agree to a thousandth of the power agree."""


@dataclass(frozen=True)
class SpectrumCell:
    """Log power of one motion's frames and bins, by session.

    Attributes
    ----------
    motion : int
        What it is of.
    sessions : ndarray, shape (B + T, F)
        Mean over each session's cycles, baseline first; NaN where nothing is known.
    cycles : ndarray, shape (B + T,)
        Cycles that each mean is of.
    within : ndarray, shape (F,)
        Variance of a single cycle about its session's mean, from all sessions; NaN if unknown.
    frames, bins : int
        F is their product, frames first.
    bin_hz : float
        Frequency of the first bin; bin k lies at k + 1 times it.
    """

    motion: int
    sessions: FloatArray
    cycles: FloatArray
    within: FloatArray
    frames: int
    bins: int
    bin_hz: float


@dataclass(frozen=True)
class SpectrumEvidence:
    """Distance by the short-time spectrum of the envelope.

    Attributes
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.
    """

    cells: Sequence[SpectrumCell]
    n_baseline: int
    ranks: ClassVar[bool] = True

    def log_distances(self, units: NDArray[np.int64], rest: NDArray[np.int64]) -> FloatArray:
        """Return the log of the squared deviation, averaged over frames, bins and motions."""
        ratios = [
            deviation_from_rest(cell.sessions, cell.cycles, cell.within, units, rest)
            for cell in self.cells
        ]
        return log_mean(np.array(ratios).T)

    def pooled(self, is_target: NDArray[np.bool_]) -> FloatArray:
        """Return the squared difference between the groups' means."""
        return pooled_deviation(self.cells, is_target)

    def effect(self) -> float:
        """Return the relative change of the size of the fluctuations; see `size_effect`."""
        return size_effect(self.cells, self.n_baseline)


@dataclass(frozen=True)
class BandChange:
    """Where the envelope's fluctuations have changed most clearly.

    Attributes
    ----------
    motion : int
        In which motion.
    start, stop : float
        Part of it, 0 at its beginning and 1 at its end.
    frequency_hz : float
        Of the fluctuation.
    size_ratio : float
        Its amplitude over the baseline's mean.
    """

    motion: int
    start: float
    stop: float
    frequency_hz: float
    size_ratio: float


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


def deviation_from_rest(
    sessions: FloatArray,
    cycles: FloatArray,
    within: FloatArray,
    units: NDArray[np.int64],
    rest: NDArray[np.int64],
    least_variance: float = LEAST_VARIANCE,
) -> FloatArray:
    """Mean squared deviation of sessions from others, in units of what healthy ones deviate by.

    Parameters
    ----------
    sessions : ndarray, shape (B + T, F)
        Mean of each session's cycles; NaN where nothing is known.
    cycles : ndarray, shape (B + T,)
        Cycles that each mean is of.
    within : ndarray, shape (F,)
        Variance of a single cycle about its session's mean; NaN if unknown.
    units : ndarray, shape (U,)
        Indices of the sessions to be judged.
    rest : ndarray, shape (R,)
        Indices of the sessions they are compared with; none of `units` is among them.
    least_variance : float
        Sessions that agree within it agree.

    Returns
    -------
    ndarray, shape (U,)
        About 1 for a healthy session, whatever the number of its cycles; NaN where the rest has
        neither two sessions nor a session of two cycles.

    Notes
    -----
    The variance of a session's mean is that between sessions plus that of a cycle over the number
    of cycles. The rest's own sessions show both together; what a unit of more or fewer cycles has
    less or more is corrected for, and the rest's mean has an error of its own. Few sessions say
    little of one bin, so that its variance is moderated by the motion's mean (Smyth 2004).
    """
    mean, n = mean_of_known(sessions[rest])
    squares = np.nansum((sessions[rest] - mean) ** 2, axis=0)
    within = _moderated(within, 1.0)
    share = np.mean(1 / cycles[rest][cycles[rest] > 0]) if (n > 0).any() else np.nan
    dof = np.maximum(n - 1, 0)
    if (dof > 0).any():
        typical = squares.sum() / dof.sum()
        variance = (PRIOR_DOF * typical + squares) / (PRIOR_DOF + dof)
    else:
        # A single session shows no variation between sessions; its cycles show what is least.
        variance = within * share
    result = np.full(len(units), np.nan)
    for k, unit in enumerate(units):
        if cycles[unit] == 0:
            continue
        own = 1 / cycles[unit]
        expected = np.fmax(variance + np.nan_to_num(within) * (own - share), within * own)
        expected = expected + variance / np.maximum(n, 1)
        ratio = (sessions[unit] - mean) ** 2 / np.maximum(expected, least_variance)
        known = np.isfinite(ratio)
        if known.any():
            result[k] = float(ratio[known].mean())
    return result


def size_effect(cells: Sequence[SpectrumCell], n_baseline: int) -> float:
    """Relative change of the size of the envelope's fluctuations.

    Parameters
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    float
        Root-mean-square change of the log amplitudes over all motions, frames and bins, beyond
        what the baseline's sessions show; 0.1 is a change by 10 %. NaN for fewer than two
        baseline sessions.
    """
    excess: list[float] = []
    for cell in cells:
        change, variance = _change(cell, n_baseline)
        known = np.isfinite(variance)
        if known.any():
            excess.append(float((change[known] ** 2 - variance[known]).mean()))
    # half, because a log power is twice a log amplitude
    return 0.5 * math.sqrt(max(float(np.mean(excess)), 0.0)) if excess else math.nan


def clearest_change(cells: Sequence[SpectrumCell], n_baseline: int) -> BandChange | None:
    """Find the part of a motion and the frequency whose change stands out most.

    Parameters
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions.

    Returns
    -------
    BandChange or None
        None for fewer than two baseline sessions.
    """
    best, found = 0.0, None
    for cell in cells:
        change, variance = _change(cell, n_baseline)
        known = np.isfinite(variance)
        if not known.any():
            continue
        typical = float(variance[known].mean())
        ratio = np.where(known, change**2 / (variance + typical + LEAST_VARIANCE), 0.0)
        place = int(ratio.argmax())
        if ratio[place] > best:
            best = float(ratio[place])
            frame, number = divmod(place, cell.bins)
            length = 2 / (cell.frames + 1)
            start = frame / max(cell.frames - 1, 1) * (1 - length)
            found = BandChange(
                motion=cell.motion,
                start=start,
                stop=start + length,
                frequency_hz=(number + 1) * cell.bin_hz,
                size_ratio=math.exp(0.5 * float(change[place])),
            )
    return found


def _change(cell: SpectrumCell, n_baseline: int) -> tuple[FloatArray, FloatArray]:
    """Change of each bin's log power, and its variance among healthy sessions; NaN if unknown."""
    baseline = cell.sessions[:n_baseline]
    target, n_target = mean_of_known(cell.sessions[n_baseline:])
    mean, n = mean_of_known(baseline)
    squares = np.nansum((baseline - mean) ** 2, axis=0)
    enough = (n > 1) & (n_target > 0)
    per_session = np.divide(squares, n - 1, out=np.full(n.shape, np.nan), where=enough)
    return target - mean, per_session * (1 / np.maximum(n, 1) + 1 / np.maximum(n_target, 1))


def pooled_deviation(cells: Sequence[SpectrumCell], is_target: NDArray[np.bool_]) -> FloatArray:
    """Squared difference between the means of two groups of sessions, averaged over all bins.

    Parameters
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    is_target : ndarray of bool, shape (R, B + T)
        Which sessions form the target's group; one row per labelling.

    Returns
    -------
    ndarray, shape (R,)
        In units of each bin's variance over all sessions, which no labelling changes; NaN where
        no motion is known in both groups.
    """
    ratios = np.full((len(is_target), len(cells)), np.nan)
    for j, cell in enumerate(cells):
        present = np.isfinite(cell.sessions).all(axis=1)
        sessions = cell.sessions[present]
        target = is_target[:, present].astype(np.float64)
        n_target = target.sum(axis=1)
        n_other = len(sessions) - n_target
        both = (n_target > 0) & (n_other > 0)
        if not both.any():
            continue
        variance = np.maximum(_moderated(sessions.var(axis=0), len(sessions)), LEAST_VARIANCE)
        sums = target[both] @ sessions
        n_a, n_b = n_target[both, np.newaxis], n_other[both, np.newaxis]
        difference = sums / n_a - (sessions.sum(axis=0) - sums) / n_b
        ratios[both, j] = np.mean(difference**2 / variance, axis=1)
    known = np.isfinite(ratios)
    total = np.where(known, ratios, 0.0).sum(axis=1)
    n = known.sum(axis=1)
    return np.asarray(np.divide(total, n, out=np.full(len(total), np.nan), where=n > 0))


def mean_of_known(rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean of the known values of each column, NaN without any, and their number."""
    known = np.isfinite(rows)
    n = known.sum(axis=0).astype(np.float64)
    total = np.where(known, rows, 0.0).sum(axis=0)
    return np.divide(total, n, out=np.full(n.shape, np.nan), where=n > 0), n


def _moderated(variance: FloatArray, dof: float) -> FloatArray:
    """Blend each bin's variance with the mean of all bins'; unknown ones take the mean."""
    known = np.isfinite(variance)
    if not known.any():
        return variance
    typical = float(variance[known].mean())
    return (PRIOR_DOF * typical + dof * np.where(known, variance, typical)) / (PRIOR_DOF + dof)
