"""What speaks for a change between sessions, and how several such things are weighed together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from opamc_cli.stats.sessions import Cell, divergence_from_rest, pooled_divergence
from opamc_cli.stats.spectra import SpectrumCell, pooled_deviation, squared_deviation
from opamc_cli.stats.spread import MAD_TO_SIGMA

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_RATIO = 1e-6
"""Identical recordings have distance zero; a millionth of a healthy one stands for it."""

LEAST_SCALE = 0.01
"""Distances that agree to a percent agree: none weighs infinitely."""


class Evidence(Protocol):
    """One way of telling sessions apart; sessions are numbered, baseline first."""

    def log_distances(self, units: IntArray, rest: IntArray) -> FloatArray:
        """Return the log distance of each of some sessions from the others."""

    def pooled(self, is_target: NDArray[np.bool_]) -> FloatArray:
        """Return the distance between two groups of sessions, one for each labelling."""


@dataclass(frozen=True)
class PatternEvidence:
    """Distance by the Jensen-Shannon divergence of ordinal patterns.

    Attributes
    ----------
    cells : sequence of Cell
        All motions and orders of one axis.
    """

    cells: Sequence[Cell]

    def log_distances(self, units: IntArray, rest: IntArray) -> FloatArray:
        """Return the log of the mean divergence, each in units of the rest's own.

        The mean over motions and orders is taken before the logarithm, so that one motion that
        changes strongly is not outvoted by three that do not.
        """
        ratios = np.full((len(units), len(self.cells)), np.nan)
        for j, cell in enumerate(self.cells):
            sessions = np.concatenate([cell.baseline, cell.target])
            divergence, level = divergence_from_rest(
                sessions[units], sessions[rest], cell.inflation
            )
            ratios[:, j] = divergence / level
        return log_mean(ratios)

    def pooled(self, is_target: NDArray[np.bool_]) -> FloatArray:
        """Return the divergence between two pools of sessions."""
        return pooled_divergence(self.cells, is_target)


@dataclass(frozen=True)
class SpectrumEvidence:
    """Distance by the short-time spectrum of the envelope.

    Attributes
    ----------
    cells : sequence of SpectrumCell
        All motions of one axis.
    """

    cells: Sequence[SpectrumCell]

    def log_distances(self, units: IntArray, rest: IntArray) -> FloatArray:
        """Return the log of the squared deviation, averaged over frames, bins and motions."""
        ratios = [squared_deviation(cell, units, rest) for cell in self.cells]
        return log_mean(np.array(ratios).T)

    def pooled(self, is_target: NDArray[np.bool_]) -> FloatArray:
        """Return the squared difference between the groups' means."""
        return pooled_deviation(self.cells, is_target)


@dataclass(frozen=True)
class SessionDistances:
    """Log distances of one axis's sessions.

    Attributes
    ----------
    own : ndarray, shape (B,)
        Of baseline session i from the other baseline sessions.
    target : ndarray, shape (B, T)
        Of each target session from the baseline without session i: the two numbers of a pair
        differ in nothing but the session, same pool, same level, same finite-sample bias.
    each : ndarray, shape (B + 1,)
        Of every session from all others, the first target session last: all on the same footing,
        so that the target's rank among them is that of any healthy session.
    """

    own: FloatArray
    target: FloatArray
    each: FloatArray


def session_distances(evidence: Evidence, n_baseline: int, n_target: int) -> SessionDistances:
    """Hold each session against the rest.

    Parameters
    ----------
    evidence : Evidence
        Of one axis.
    n_baseline, n_target : int
        Numbers of its sessions; at least two of the baseline.

    Returns
    -------
    SessionDistances

    Notes
    -----
    `own` and `target` are the pairs of the jackknife+ of R. F. Barber et al., Ann. Statist. 49
    (2021); `each` is full conformal prediction (V. Vovk et al., Algorithmic Learning in a Random
    World, 2005).
    """
    baseline = np.arange(n_baseline)
    targets = np.arange(n_baseline, n_baseline + n_target)
    pairs = np.array(
        [
            evidence.log_distances(np.concatenate([[i], targets]), np.delete(baseline, i))
            for i in baseline
        ]
    )
    everyone = np.arange(n_baseline + 1)
    each = [evidence.log_distances(everyone[[i]], np.delete(everyone, i))[0] for i in everyone]
    return SessionDistances(pairs[:, 0], pairs[:, 1:], np.array(each))


def weigh_together(
    by_axis: Mapping[int, Sequence[SessionDistances]],
) -> dict[int, SessionDistances]:
    """Combine the distances by several kinds of evidence into one for each axis.

    Parameters
    ----------
    by_axis : mapping of int to sequence of SessionDistances
        One entry per kind of evidence, the same kinds in the same order on every axis.

    Returns
    -------
    dict of int to SessionDistances
        Weighted mean of the log distances. A kind weighs the less, the more its distances scatter
        between sessions, in the middle over all axes; one that lacks a session is left out.

    Notes
    -----
    The scatter is that of all sessions, the target among them, by the median absolute deviation:
    taken from the baseline alone it would favour the kind in which the target is odd, and the
    target would rank first too often.
    """
    kinds = max((len(each) for each in by_axis.values()), default=0)
    scale = [
        max(np.median([_robust_scale(each[k].each) for each in by_axis.values()]), LEAST_SCALE)
        for k in range(kinds)
    ]
    combined = {}
    for axis, each in by_axis.items():
        known = [
            all(np.isfinite(part).all() for part in (one.own, one.target, one.each)) for one in each
        ]
        weight = known / np.array(scale[: len(each)])
        if not weight.any():
            weight[0] = 1.0
        weight /= weight.sum()
        used = [(w, one) for w, one in zip(weight, each, strict=True) if w]
        combined[axis] = SessionDistances(
            np.sum([w * one.own for w, one in used], axis=0),
            np.sum([w * one.target for w, one in used], axis=0),
            np.sum([w * one.each for w, one in used], axis=0),
        )
    return combined


def pooled_together(evidence: Sequence[Evidence], is_target: NDArray[np.bool_]) -> FloatArray:
    """Distance between two groups of sessions by several kinds of evidence.

    Parameters
    ----------
    evidence : sequence of Evidence
        Of one axis.
    is_target : ndarray of bool, shape (R, B + T)
        One row per labelling.

    Returns
    -------
    ndarray, shape (R,)
        Weighted geometric mean; a kind weighs the less, the more it differs between labellings.
    """
    logs = [np.log(np.maximum(one.pooled(is_target), LEAST_RATIO)) for one in evidence]
    logs = [log for log in logs if np.isfinite(log).all()] or logs[:1]
    weight = 1 / np.array([max(float(np.nanstd(log)), LEAST_SCALE) for log in logs])
    return np.asarray(np.exp(np.average(logs, axis=0, weights=weight)))


def _robust_scale(values: FloatArray) -> float:
    deviation = np.abs(values - np.median(values))
    return MAD_TO_SIGMA * float(np.median(deviation)) if np.isfinite(values).all() else np.inf


def log_mean(ratios: FloatArray) -> FloatArray:
    """Log of the mean of the known values along the last axis; NaN without any."""
    known = np.isfinite(ratios)
    total = np.where(known, ratios, 0.0).sum(axis=-1)
    n = known.sum(axis=-1)
    mean = np.divide(total, n, out=np.full(total.shape, np.nan), where=n > 0)
    return np.asarray(np.log(np.maximum(mean, LEAST_RATIO)))
