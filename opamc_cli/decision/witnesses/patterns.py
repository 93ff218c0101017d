"""Distance between recording sessions by the ordinal patterns of their envelopes."""

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
from opamc_cli.decision.significance.spread import Spread
from opamc_cli.decision.witnesses.departure import Block
from opamc_cli.decision.witnesses.evidence import Kind

FloatArray = NDArray[np.float64]

LEAST_VARIANCE = 1e-9
"""Of a root of a probability: a millionth of the patterns is less than a motion has."""


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
    session_of_target_cycle: NDArray[np.int64] | None = None
    """Row of `target` that each of `target_cycles` belongs to; None: not known."""

    def of_sessions(self, baseline: Sequence[int], target: Sequence[int]) -> "Cell":
        """Return the cell with some sessions, numbered baseline first, on either side.

        The cycles of the target stay where it is known of which session they are.
        """
        counts = np.concatenate([self.baseline, self.target])
        cycles, of = self.target_cycles, self.session_of_target_cycle
        return replace(
            self,
            baseline=counts[list(baseline)],
            target=counts[list(target)],
            target_cycles=(
                cycles if of is None else cycles[np.isin(of + len(self.baseline), target)]
            ),
            session_of_target_cycle=None,
        )


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


@dataclass(frozen=True)
class PatternEvidence:
    """Distance by the probabilities of ordinal patterns."""

    cells: Sequence[Cell]
    """All motions and orders of one axis."""
    kinds: ClassVar[Sequence[Kind]] = ("orthogonal",)
    healthy_spread: ClassVar[Spread] = Spread(0.6, 4.0)
    """0.1, 0.5 and 1.0 in the middle of joints of three simulators (18 to 100 robots each)."""
    weight: ClassVar[float] = 1.0
    tells_conditions: ClassVar[bool] = False
    depends_on_conditions: ClassVar[bool] = True

    def blocks(self) -> list[Block]:
        """Return the square roots of the probabilities of each motion and order.

        Their squared difference is the Hellinger distance, to which the Jensen-Shannon divergence
        is proportional where it is small; chance gives each of them the same variance, and a
        quarter of a count takes the mean error of a root away (M. S. Bartlett, 1947).
        """
        blocks = []
        for cell in self.cells:
            counts = np.concatenate([cell.baseline, cell.target])
            total = counts.sum(axis=1)
            independent = np.where(total > 0, total, np.nan)[:, np.newaxis] / cell.inflation
            roots = np.sqrt((counts / cell.inflation + 0.25) / independent)
            within = np.full(counts.shape[1], cell.inflation / 4)
            blocks.append(Block(roots, total, within, LEAST_VARIANCE))
        return blocks

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
