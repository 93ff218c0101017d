"""Choice of order and delay on healthy data alone: what tells a robot's own motions apart."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from opamc_cli.decision.divergence.jensen_shannon import jensen_shannon


def self_consistency(counts: ArrayLike, motion: ArrayLike, cycle: ArrayLike) -> float:
    """How surely segments are told by their own motion's pool from that of another motion.

    Parameters
    ----------
    counts : array_like, shape (S, K)
        Pattern counts of the baseline's segments, all of one axis, order and scale factor.
    motion : array_like, shape (S,)
        Motion of each segment.
    cycle : array_like, shape (S,)
        Cycle of each segment, unique over recordings; it is left out of every pool.

    Returns
    -------
    float
        Divergence from the most similar other motion less that from the own one: mean over
        standard deviation. Near or below 0 the patterns say nothing of the motion, be it that
        they are the same everywhere (too short a delay) or chance (too long a delay, too high
        an order for the data). NaN with fewer than two motions or two cycles.

    Notes
    -----
    Patterns that are reproducible and yet depend on what the torque does are those in which a
    change of the torque will show. Nothing of a fault is needed for the choice.
    """
    rows = np.asarray(counts, dtype=np.float64)
    motions, cycles = np.asarray(motion), np.asarray(cycle)
    names = np.unique(motions)
    if len(names) < 2 or len(np.unique(cycles)) < 2:
        return float("nan")
    own = np.full(len(rows), np.nan)
    nearest = np.full(len(rows), np.nan)
    for left_out in np.unique(cycles):
        here, rest = cycles == left_out, cycles != left_out
        pools = np.array([rows[rest & (motions == name)].sum(axis=0) for name in names])
        divergence: NDArray[np.float64] = np.stack(
            [np.asarray(jensen_shannon(rows[here], pool)) for pool in pools], axis=1
        )
        same = motions[here][:, np.newaxis] == names
        own[here] = np.where(same, divergence, 0.0).sum(axis=1)
        others = np.where(same | ~np.isfinite(divergence), np.inf, divergence).min(axis=1)
        nearest[here] = np.where(np.isfinite(others), others, np.nan)
    # What chance adds to both divergences cancels; its scatter stays in the denominator.
    gain = nearest - own
    gain = gain[np.isfinite(gain)]
    if gain.size < 2:
        return float("nan")
    return float(gain.mean() / max(float(gain.std(ddof=1)), 1e-12))
