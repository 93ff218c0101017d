"""Distance between recording sessions, each weighed against the same rest of the baseline."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

from opamc_cli.stats.divergence import (
    chance_divergence,
    chance_inflation,
    jensen_shannon,
    normalise,
)

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """Pattern counts of one motion and order, by session.

    Attributes
    ----------
    motion, order, tau : int
        What the patterns are of; tau in samples.
    baseline : ndarray, shape (B, K)
        Counts of each baseline session; a row of zeros where a session lacks the motion.
    target : ndarray, shape (T, K)
        Counts of each target session, likewise.
    cycles, target_cycles : ndarray, shape (C, K)
        Counts of each single cycle of the baseline and of the target.
    inflation : float
        φ of `divergence.chance_inflation`, from the cycles within baseline sessions.
    """

    motion: int
    order: int
    tau: int
    baseline: FloatArray
    target: FloatArray
    cycles: FloatArray
    target_cycles: FloatArray
    inflation: float

    def with_units(self, baseline: FloatArray, target: FloatArray) -> "Cell":
        """Return the same cell with other units, such as cycles, in the place of sessions."""
        return replace(self, baseline=baseline, target=target)


def inflation_within_sessions(cycles: FloatArray, session_of_cycle: NDArray[np.int64]) -> float:
    """How many times more cycles of one session scatter than independent patterns would.

    Parameters
    ----------
    cycles : ndarray, shape (C, K)
        Counts of each baseline cycle of one motion and order.
    session_of_cycle : ndarray, shape (C,)
        Label of the session of each.

    Returns
    -------
    float
        φ of `divergence.chance_inflation`, each cycle held against the others of its session; 1
        if no session has two cycles.
    """
    divergences, sizes, rests = [], [], []
    for session in np.unique(session_of_cycle):
        own = cycles[session_of_cycle == session]
        own = own[own.sum(axis=1) > 0]
        if len(own) < 2:
            continue
        pool = own.sum(axis=0)
        divergences.append(np.asarray(jensen_shannon(own, pool - own)))
        sizes.append(own.sum(axis=1))
        rests.append(pool.sum() - own.sum(axis=1))
    if not divergences:
        return 1.0
    return chance_inflation(
        np.concatenate(divergences),
        cycles.sum(axis=0),
        np.concatenate(sizes),
        np.concatenate(rests),
    )


def divergence_from_rest(
    units: FloatArray, rest: FloatArray, inflation: float
) -> tuple[FloatArray, float]:
    """Divergence of sessions from the pool of others, and the pool's own level of it.

    Parameters
    ----------
    units : ndarray, shape (U, K)
        Counts of the sessions to be judged.
    rest : ndarray, shape (R, K)
        Counts of the sessions they are compared with; none of `units` is among them.
    inflation : float
        φ, for the level that chance alone would give.

    Returns
    -------
    divergence : ndarray, shape (U,)
        In bits; NaN for a session without counts.
    level : float
        Mean leave-one-out divergence within `rest`, at least what chance alone gives.
    """
    pool = rest.sum(axis=0)
    n_pool = pool.sum()
    if n_pool == 0:
        return np.full(len(units), np.nan), float("nan")
    n_unit = units.sum(axis=1)
    divergence = np.asarray(jensen_shannon(units, pool))
    counted = n_unit[n_unit > 0]
    if not counted.size:
        return divergence, float("nan")
    typical = float(np.mean(counted))
    chance = float(chance_divergence(pool, typical / inflation, n_pool / inflation))
    present = rest[rest.sum(axis=1) > 0]
    if len(present) >= 3:
        own = np.asarray(jensen_shannon(present, pool - present))
        chance = max(chance, float(own.mean()))
    return divergence, max(chance, 1e-12)


ENTROPY_PRIOR_DOF = 4.0
"""Degrees of freedom that the cells' mean variance of entropy counts for in each cell's own."""


ENTROPY_WEIGHT = 0.1
"""Weight of an entropy's ratio beside a divergence's: one squared number scatters far more than a
sum over all patterns. Larger weights find a little more of what changes the entropy (AUC for a
quarter of the damage on the testbed 0.864, 0.887, 0.896 at 0, 0.1, 0.25) and less of what does
not."""


def pattern_entropy(counts: FloatArray) -> FloatArray:
    """Entropy of pattern counts along the last axis, in nats; NaN without counts."""
    pmf = normalise(counts)
    return np.asarray(-xlogy(pmf, pmf).sum(axis=-1))


def paired_log_divergences(cells: Sequence[Cell]) -> tuple[FloatArray, FloatArray]:
    """Log distance of each baseline session and of the target, from the same rest.

    Each baseline session i in turn is set aside; it and every target session are compared with
    the others, so that the two numbers of a pair differ in nothing but the session: same pool,
    same level, the same finite-sample bias.

    Parameters
    ----------
    cells : sequence of Cell
        All motions and orders of one axis.

    Returns
    -------
    baseline : ndarray, shape (B,)
        Log of session i's distance, in units of the rest's own level.
    target : ndarray, shape (B, T)
        The same of each target session, against the rest without i.

    Notes
    -----
    The pairs of the jackknife+ of R. F. Barber et al., Ann. Statist. 49 (2021). The distance is
    a weighted mean of two ratios over all cells: divergence over the rest's own, and squared
    change of permutation entropy over its variance between the rest's sessions, where these are
    three or more. The second looks in one direction only, that of more or less order, in which
    sessions differ little and damage goes: it finds small damage that the divergence, which sums
    over all directions, loses in their scatter, and the divergence finds what leaves the entropy
    as it was. The mean is taken before the logarithm, so that one motion that changes strongly
    is not outvoted by three that do not.
    """
    n_baseline, n_target = len(cells[0].baseline), len(cells[0].target)
    ratios = np.full((n_baseline, 1 + n_target, 2, len(cells)), np.nan)
    entropies = np.array(
        [pattern_entropy(np.concatenate([cell.baseline, cell.target])) for cell in cells]
    )
    for i in range(n_baseline):
        for j, cell in enumerate(cells):
            rest = np.delete(cell.baseline, i, axis=0)
            units = np.concatenate([cell.baseline[i : i + 1], cell.target])
            divergence, level = divergence_from_rest(units, rest, cell.inflation)
            ratios[i, :, 0, j] = divergence / level
        rest_entropies = np.delete(entropies[:, :n_baseline], i, axis=1)
        unit_entropies = entropies[:, [i, *range(n_baseline, n_baseline + n_target)]]
        ratios[i, :, 1] = _entropy_ratios(unit_entropies, rest_entropies).T
    weights = np.repeat([1.0, ENTROPY_WEIGHT], len(cells))
    logs = _log_mean(ratios.reshape(n_baseline, 1 + n_target, -1), weights)
    return logs[:, 0], logs[:, 1:]


def _entropy_ratios(units: FloatArray, rest: FloatArray) -> FloatArray:
    """Squared change of entropy over its variance between sessions; rows are cells."""
    known = np.isfinite(rest)
    n = known.sum(axis=1)
    enough = n >= 3
    if not enough.any():
        return np.full(units.shape, np.nan)
    values = np.where(known, rest, 0.0)
    mean = values.sum(axis=1) / np.maximum(n, 1)
    squares = np.where(known, (rest - mean[:, np.newaxis]) ** 2, 0.0).sum(axis=1)
    typical = squares[enough].sum() / (n[enough] - 1).sum()
    variance = (ENTROPY_PRIOR_DOF * typical + squares) / (ENTROPY_PRIOR_DOF + np.maximum(n - 1, 0))
    # Identical sessions have no variance; a millionth of a nat is no change.
    ratio = (units - mean[:, np.newaxis]) ** 2 / np.maximum(variance, 1e-12)[:, np.newaxis]
    return np.where(enough[:, np.newaxis], ratio, np.nan)


def _log_mean(ratios: FloatArray, weights: FloatArray | float = 1.0) -> FloatArray:
    known = np.isfinite(ratios)
    total = np.where(known, weights * ratios, 0.0).sum(axis=-1)
    weight = (weights * known).sum(axis=-1)
    mean = np.divide(total, weight, out=np.full(total.shape, np.nan), where=weight > 0)
    # Identical recordings have divergence zero; a millionth of the baseline's level stands for it.
    return np.asarray(np.log(np.maximum(mean, 1e-6)))


def pooled_divergence(cells: Sequence[Cell], is_target: NDArray[np.bool_]) -> FloatArray:
    """Divergence between two pools of sessions, averaged over cells in units of chance.

    Parameters
    ----------
    cells : sequence of Cell
        All motions and orders of one axis.
    is_target : ndarray of bool, shape (R, B + T)
        Which sessions, baseline then target, form the target's pool; one row per labelling.

    Returns
    -------
    ndarray, shape (R,)
        NaN where no cell has counts on both sides.
    """
    ratios = np.full((len(is_target), len(cells)), np.nan)
    for j, cell in enumerate(cells):
        sessions = np.concatenate([cell.baseline, cell.target])
        target = is_target.astype(np.float64) @ sessions
        total = sessions.sum(axis=0)
        n_target, n_baseline = target.sum(axis=1), (total - target).sum(axis=1)
        both = (n_target > 0) & (n_baseline > 0)
        if not both.any():
            continue
        chance = chance_divergence(
            total, n_target[both] / cell.inflation, n_baseline[both] / cell.inflation
        )
        divergence = jensen_shannon(target[both], (total - target)[both])
        ratios[both, j] = divergence / np.maximum(chance, 1e-12)
    return np.exp(_log_mean(ratios))
