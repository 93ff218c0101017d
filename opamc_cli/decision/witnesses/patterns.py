"""Distance between recording sessions, each weighed against the same rest of the baseline."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.divergence.jensen_shannon import (
    chance_divergence,
    chance_inflation,
    effect_size,
    jensen_shannon,
)
from opamc_cli.decision.witnesses.evidence import log_mean

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """Pattern counts of one motion and order, by session."""

    motion: int
    order: int
    tau: int
    """With `motion`, `order`: what the patterns are of; tau in samples."""
    baseline: FloatArray
    """Counts of each baseline session; a row of zeros where a session lacks the motion; shape (B,
    K)."""
    target: FloatArray
    """Counts of each target session, likewise; shape (T, K)."""
    cycles: FloatArray
    target_cycles: FloatArray
    """With `cycles`: counts of each cycle of the baseline and of the target; shape (C, K)."""
    inflation: float
    """φ of `divergence.chance_inflation`, from the cycles within baseline sessions."""

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
) -> tuple[FloatArray, FloatArray]:
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
    level : ndarray, shape (U,)
        Mean leave-one-out divergence within `rest`, as it would be for a session of as many
        patterns, at least what chance alone gives.
    """
    pool = rest.sum(axis=0)
    n_pool = pool.sum()
    n_unit = units.sum(axis=1)
    level = np.full(len(units), np.nan)
    if n_pool == 0:
        return np.full(len(units), np.nan), level
    counted = n_unit > 0
    own = rest[rest.sum(axis=1) > 0]
    own = own if len(own) >= 3 else own[:0]
    # the units and the rest's own sessions in one go: of few patterns the calls are what costs
    rows = np.concatenate([units, own])
    others = pool - np.concatenate([np.zeros_like(units), own])
    sizes = np.concatenate([n_unit[counted], own.sum(axis=1)]) / inflation
    of_others = others.sum(axis=1)[np.concatenate([counted, np.ones(len(own), bool)])] / inflation
    divergence, of_own = np.split(jensen_shannon(rows, others), [len(units)])
    chance, usual = np.split(chance_divergence(pool, sizes, of_others), [counted.sum()])
    level[counted] = chance
    if len(own):
        level[counted] = np.maximum(chance, of_own.mean() + chance - usual.mean())
    return divergence, np.maximum(level, 1e-12)


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
    known = np.isfinite(ratios)
    n = known.sum(axis=1)
    total = np.where(known, ratios, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, n, out=np.full(len(n), np.nan), where=n > 0))


@dataclass(frozen=True)
class PatternEvidence:
    """Distance by the Jensen-Shannon divergence of ordinal patterns."""

    cells: Sequence[Cell]
    """All motions and orders of one axis."""
    ranks: ClassVar[bool] = True

    def log_distances(self, units: NDArray[np.int64], rest: NDArray[np.int64]) -> FloatArray:
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

    def effect(self) -> float:
        """Return the relative change of the pattern probabilities where it is largest."""
        effects = effect_by_cell(self.cells)
        return float(np.nanmax(effects)) if np.isfinite(effects).any() else float("nan")


def effect_by_cell(cells: Sequence[Cell]) -> FloatArray:
    """Relative change of the pattern probabilities in each motion and order.

    Parameters
    ----------
    cells : sequence of Cell
        Motions and orders of one axis.

    Returns
    -------
    ndarray, shape (len(cells),)
        Cohen's w of the divergence of the target's sessions, pooled, beyond that of the
        baseline's own; NaN where either has no counts.
    """
    effects = np.full(len(cells), np.nan)
    for j, cell in enumerate(cells):
        pool, target = cell.baseline.sum(axis=0), cell.target.sum(axis=0)
        if pool.sum() == 0 or target.sum() == 0:
            continue
        usual = float(
            chance_divergence(pool, target.sum() / cell.inflation, pool.sum() / cell.inflation)
        )
        present = cell.baseline[cell.baseline.sum(axis=1) > 0]
        if len(present) > 1:
            usual = max(usual, float(np.mean(jensen_shannon(present, pool - present))))
        effects[j] = float(effect_size(float(jensen_shannon(target, pool)) - usual))
    return effects
