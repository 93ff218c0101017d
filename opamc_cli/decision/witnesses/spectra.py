"""Distance between recording sessions by the short-time spectra of their envelopes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.witnesses.deviation import (
    change_between,
    clearest_of,
    deviation_from_rest,
    moderated,
)
from opamc_cli.decision.witnesses.evidence import log_mean

FloatArray = NDArray[np.float64]

LEAST_VARIANCE = 1e-6
"""Of a log power: sessions that agree to a thousandth of the power agree."""


@dataclass(frozen=True)
class SpectrumCell:
    """Log power of one motion's frames and bins, by session."""

    motion: int
    """What it is of."""
    sessions: FloatArray
    """Mean over each session's cycles, baseline first; NaN where nothing is known; shape (B + T,
    F)."""
    cycles: FloatArray
    """Cycles that each mean is of; shape (B + T,)."""
    within: FloatArray
    """Variance of a single cycle about its session's mean, from all sessions; NaN if unknown; shape
    (F,)."""
    frames: int
    bins: int
    """With `frames`: f is their product, frames first."""
    bin_hz: float
    """Frequency of the first bin; bin k lies at k + 1 times it."""


@dataclass(frozen=True)
class SpectrumEvidence:
    """Distance by the short-time spectrum of the envelope."""

    cells: Sequence[SpectrumCell]
    """All motions of one axis."""
    n_baseline: int
    """Number of baseline sessions."""
    ranks: ClassVar[bool] = True

    def log_distances(self, units: NDArray[np.int64], rest: NDArray[np.int64]) -> FloatArray:
        """Return the log of the squared deviation, averaged over frames, bins and motions."""
        ratios = [
            deviation_from_rest(
                cell.sessions, cell.cycles, cell.within, units, rest, LEAST_VARIANCE
            )
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
    """Where the envelope's fluctuations have changed most clearly."""

    motion: int
    """In which motion."""
    start: float
    stop: float
    """With `start`: part of it, 0 at its beginning and 1 at its end."""
    frequency_hz: float
    """Of the fluctuation."""
    size_ratio: float
    """Its amplitude over the baseline's mean."""


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
        change, variance = change_between(cell.sessions, n_baseline)
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
    found = clearest_of([cell.sessions for cell in cells], n_baseline, LEAST_VARIANCE)
    if found is None:
        return None
    number, place, change, _ = found
    cell = cells[number]
    frame, bin_number = divmod(place, cell.bins)
    length = 2 / (cell.frames + 1)
    start = frame / max(cell.frames - 1, 1) * (1 - length)
    return BandChange(
        motion=cell.motion,
        start=start,
        stop=start + length,
        frequency_hz=(bin_number + 1) * cell.bin_hz,
        size_ratio=math.exp(0.5 * change),
    )


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
        variance = np.maximum(moderated(sessions.var(axis=0), len(sessions)), LEAST_VARIANCE)
        sums = target[both] @ sessions
        n_a, n_b = n_target[both, np.newaxis], n_other[both, np.newaxis]
        difference = sums / n_a - (sessions.sum(axis=0) - sums) / n_b
        ratios[both, j] = np.mean(difference**2 / variance, axis=1)
    known = np.isfinite(ratios)
    total = np.where(known, ratios, 0.0).sum(axis=1)
    n = known.sum(axis=1)
    return np.asarray(np.divide(total, n, out=np.full(len(total), np.nan), where=n > 0))
