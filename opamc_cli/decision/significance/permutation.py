"""Permutation of whole sessions or cycles between baseline and target."""

from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.significance.spread import moderated_spread, spliced_p_value


def relabellings(
    n_baseline: int, n_target: int, limit: int = 1000, seed: int = 0
) -> NDArray[np.bool_]:
    """Ways of calling some of all units the target.

    Parameters
    ----------
    n_baseline, n_target : int
        Numbers of exchangeable units, baseline first.
    limit : int, default 1000
        Most rows returned; if there are more ways, this many are drawn at random.
    seed : int, default 0
        Seed of the draw.

    Returns
    -------
    ndarray of bool, shape (R, n_baseline + n_target)
        True for the target. The labelling as observed is the first row and occurs once. With
        groups of equal size each split into two occurs once, since which of the two is called
        the target makes no difference to a divergence.
    """
    n = n_baseline + n_target
    observed = np.arange(n) >= n_baseline
    if comb(n, n_target) <= limit:
        rows = np.zeros((comb(n, n_target), n), dtype=bool)
        for row, chosen in zip(rows, combinations(range(n), n_target), strict=True):
            row[list(chosen)] = True
    else:
        rng = np.random.default_rng(seed)
        rows = rng.permuted(np.tile(observed, (limit - 1, 1)), axis=1)
    if n_baseline == n_target:
        rows = np.where(rows[:, :1], ~rows, rows)
        rows = np.unique(rows, axis=0)
    others = rows[(rows != observed).any(axis=1)]
    return np.concatenate([observed[np.newaxis], others])


def relabelled_p_value(values: NDArray[np.float64], n_units: int) -> float:
    """P-value of the observed labelling among all of them.

    Parameters
    ----------
    values : ndarray, shape (R,)
        Positive statistic under each row of `relabellings`, larger the more the groups differ;
        the observed one first.
    n_units : int
        Number of units that were relabelled.

    Returns
    -------
    float
        The share of labellings that differ at least as much (B. Phipson and G. K. Smyth, Stat.
        Appl. Genet. Mol. Biol. 9, 2010, count the observed one too), continued beyond 1/R by the
        Student tail of the logarithms.

    Notes
    -----
    The scatter of few labellings is moderated as that of few sessions is: two sessions against two
    have but two other labellings, and where those happened to agree healthy ones had p-values of
    1e-5 (6 of 252 splits of a measured machine's ten healthy recordings raised an alarm).
    """
    logs = np.log(np.maximum(values, 1e-12))
    others = logs[1:]
    if others.size < 2:
        return 1.0
    centre = float(others.mean())
    spread = moderated_spread(float(others.var(ddof=1)), min(n_units - 2, others.size - 1))
    return spliced_p_value(others - centre, float(logs[0]) - centre, spread)
