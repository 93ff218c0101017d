"""One baseline session: how improbable a target is where nobody knows what sessions differ by."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import stdtrit

from opamc_cli.decision.comparison import MAD_EFFICIENCY, Compared, Shift
from opamc_cli.decision.divergence.jensen_shannon import (
    chance_divergence,
    effect_size,
    jensen_shannon,
)
from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA
from opamc_cli.decision.significance.permutation import relabelled_p_value, relabellings
from opamc_cli.decision.significance.spread import Spread, moderated_spread, upper_tail
from opamc_cli.decision.witnesses.patterns import Cell

HEALTHY_SHIFT_BITS = 0.0075
"""Divergence between two healthy sessions where only one is known.

Geometric mean of Δμ of the thesis's healthy joints before and after reassembly, order 4, Tables
5-3 and 5-6: 5.2, 10.1, 14.7, 8.6, 4.8 and 5.3 times 1e-3. Those of order 5 are larger because the
thesis holds its baseline, not its target, against a pool that contains it; that bias is gone here.
"""

HEALTHY_SHIFT_SPREAD = Spread(0.36, 5.0)
"""Spread of the logarithms of those six numbers and of order 5's six (24, 32, 35, 29, 20, 22 times
1e-3, Tables 5-4 and 5-7), each order about its own mean. Both orders are of the same six joints,
so that they are worth five degrees of freedom and not ten."""

CYCLES_DIFFER = 0.05
"""Level at which cycles of baseline and target count as different where one session is known.
Of 528 joints of a stranger's robots, each held against one of its baseline sessions, one more is at
fault without that question: a worn joint's neighbour."""


def one_session_log_ratio(cells: Sequence[Cell]) -> float:
    """Log of the target's divergence over what healthy sessions are allowed.

    Parameters
    ----------
    cells : sequence of Cell
        Motions and orders of an axis with a single baseline session.

    Returns
    -------
    float
        0 if the divergence equals chance plus `HEALTHY_SHIFT_BITS`.
    """
    ratios = []
    for cell in cells:
        pool = cell.baseline.sum(axis=0)
        sessions = cell.target[cell.target.sum(axis=1) > 0]
        if pool.sum() == 0 or not len(sessions):
            continue
        n = sessions.sum(axis=1) / cell.inflation
        chance = chance_divergence(pool, n, pool.sum() / cell.inflation)
        ratio = jensen_shannon(sessions, pool) / (chance + HEALTHY_SHIFT_BITS)
        ratios.append(float(np.mean(ratio)))
    return math.log(max(float(np.mean(ratios)), 1e-6)) if ratios else math.nan


def least_effect(cells: Sequence[Cell], usual: float, spread: Spread, level: float) -> float:
    """Relative change of the patterns from which a single baseline session shows one.

    Parameters
    ----------
    cells : sequence of Cell
        Motions and orders of an axis with a single baseline session.
    usual : float
        Log ratio of `one_session_log_ratio` at which healthy joints lie.
    spread : Spread
        Of it.
    level : float
        Probability at which a joint is called changed.

    Returns
    -------
    float
        Cohen's w of the divergence that lies at the level, the mean over motions and orders.
    """
    ratio = math.exp(min(usual - spread.scale * float(stdtrit(spread.dof, level)), 100.0))
    excesses = []
    for cell in cells:
        pool, n = cell.baseline.sum(axis=0), cell.target.sum(axis=1)
        if pool.sum() and n.any():
            of_target = n[n > 0] / cell.inflation
            chance = chance_divergence(pool, of_target, pool.sum() / cell.inflation)
            excesses.append(float(np.mean(ratio * (chance + HEALTHY_SHIFT_BITS) - chance)))
    # a divergence is one bit at most
    return float(effect_size(min(float(np.mean(excesses)), 1.0))) if excesses else math.nan


def one_session_shift(log_ratios: Mapping[int, float], axis: int) -> Shift:
    """Place a joint among its siblings where the variation between sessions is unknown.

    Parameters
    ----------
    log_ratios : mapping of int to float
        `one_session_log_ratio` of each joint.
    axis : int
        The joint in question.

    Returns
    -------
    Shift
        Relative to the median of the siblings and of published healthy joints, with a spread
        blended from both.

    Notes
    -----
    The siblings went through the same two sessions and most of them are healthy: what they show
    is the variation between sessions. Median and median absolute deviation let less than half of
    them be at fault.
    """
    others = [value for key, value in log_ratios.items() if key != axis and math.isfinite(value)]
    prior = HEALTHY_SHIFT_SPREAD
    if len(others) < 2:
        scale = prior.scale * math.sqrt(1 + 1 / (prior.dof + 1))
        return Shift(log_ratios[axis], prior.scale, Spread(scale, prior.dof))
    values = np.array([0.0, *others])
    centre = float(np.median(values))
    deviation = MAD_TO_SIGMA * float(np.median(np.abs(values - centre)))
    blended = moderated_spread(deviation**2, MAD_EFFICIENCY * len(others), prior)
    scale = blended.scale * math.sqrt(1 + 1 / len(values))
    return Shift(log_ratios[axis] - centre, blended.scale, Spread(scale, blended.dof))


def compare_one_session(
    cells: Sequence[Cell],
    log_ratios: Mapping[int, float],
    axis: int,
    permutations: int,
    seed: int,
) -> Compared:
    """Say how improbable a joint's target is beside a single baseline session.

    Parameters
    ----------
    cells : sequence of Cell
        The joint's motions and orders.
    log_ratios, axis
        As of `one_session_shift`.
    permutations, seed : int
        Of the ways in which cycles are exchanged, as of `compare_sessions`.
    """
    shift = one_session_shift(log_ratios, axis)
    tail = upper_tail(shift.log_ratio, shift.spread)
    # What exchanging cycles cannot tell from chance is no change, however large it looks. Beyond
    # that the cycles say nothing: they cannot know how much sessions differ.
    by_cycles = _cycle_p_value(cells, permutations, seed)
    p = tail if by_cycles <= CYCLES_DIFFER else max(tail, by_cycles)
    return Compared(shift, p, p, 0.0, {})


def _cycle_p_value(cells: Sequence[Cell], permutations: int, seed: int) -> float:
    """Exchange cycles between baseline and target; 0 if there are too few to show anything."""
    n_baseline = max(len(cell.cycles) for cell in cells)
    n_target = max(len(cell.target_cycles) for cell in cells)
    labels = relabellings(n_baseline, n_target, permutations, seed)
    distances = []
    for cell in cells:
        if len(cell.cycles) == n_baseline and len(cell.target_cycles) == n_target:
            counts = np.concatenate([cell.cycles, cell.target_cycles])
            divergence = np.asarray(jensen_shannon(labels @ counts, ~labels @ counts))
            distances.append(divergence / max(float(divergence.mean()), 1e-12))
    if not distances or len(labels) * CYCLES_DIFFER < 1:
        return 0.0
    return relabelled_p_value(np.mean(distances, axis=0), n_baseline + n_target)
