"""How far sessions lie from others: along what healthy ones differ by, and beyond it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opamc_cli.decision.witnesses.deviation import PRIOR_DOF, mean_of_known, moderated

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

LEAST_RIDGE = 0.01
"""Of the healthy sessions' mean variance: what they differ by is known to no better than a tenth
of it, however little their cycles scatter."""

USUAL_RIDGE = 0.1
"""The same where no session has two cycles to tell the noise by: between that and all of it."""

USUAL_NOISE = 0.7
"""Share of noise in the variance of sessions of one cycle: by nights of four and sixteen cycles, in
which it is 0.37 and 0.13, it is 0.70 and 0.71."""

ROUNDING = 1 / 12
"""Variance of a count's rounding over that of its chance where a pattern is seen once (W. F.
Sheppard, 1898): two sessions of few patterns that agree better than that do so by luck, and have no
other to show it."""

LEAST_DISTANCE = 1e-9
"""Identical recordings have distance zero; a billionth of a healthy one's stands for it."""


@dataclass(frozen=True)
class Block:
    """One motion by session: numbers that vary together."""

    sessions: FloatArray
    """Mean of each session; NaN where nothing is known; shape (S, F)."""
    weight: FloatArray
    """Cycles (or patterns) that each mean is of; shape (S,)."""
    within: FloatArray
    """Variance of a single one of them about its session's mean; NaN if unknown; shape (F,)."""
    least_variance: float
    """Sessions that agree within it agree."""


@dataclass(frozen=True)
class Distances:
    """Logarithms of the distances of groups of sessions from others."""

    orthogonal: FloatArray
    """Beyond the span of the others' own differences; NaN where nothing is known; shape (R,)."""
    score: FloatArray
    """Along it, as the leverage that the others have on the group; shape (R,)."""


def distances(
    blocks: Sequence[Block],
    target: BoolArray,
    rest: BoolArray,
    healthy: BoolArray | None = None,
) -> Distances:
    """Hold groups of sessions against others, in units of what healthy ones differ by.

    Parameters
    ----------
    blocks : sequence of Block
        All motions of one axis.
    target, rest : ndarray of bool, shape (R, S)
        Which sessions are compared with which; one row for each comparison.
    healthy : ndarray of bool, shape (R, S) or (1, S), optional
        Whose scatter is the unit; the rest by default.

    Returns
    -------
    Distances
        The mean over the motions in which both groups are known.

    Notes
    -----
    Orthogonal and score distance of principal components (M. Hubert, P. J. Rousseeuw and
    K. Vanden Branden, Technometrics 47, 2005): what one influence (temperature, say) does to all
    parts of a motion is predicted from what it did to them before. The prediction is a ridge
    regression on the sessions' differences, its ridge the share of their variance that is noise;
    its error grows with the leverage, as that of any regression does.
    """
    shape = (len(blocks), len(target))
    orthogonal, score = np.full(shape, np.nan), np.full(shape, np.nan)
    for number, block in enumerate(blocks):
        known = np.isfinite(block.sessions).all(axis=1) & (block.weight > 0)
        if not known.any():
            continue
        x, weight = block.sessions[known], block.weight[known]
        x = x - x.mean(axis=0)
        both = target[:, known].any(axis=1) & rest[:, known].any(axis=1)
        own, others = target[both][:, known], rest[both][:, known]
        unit = others if healthy is None else healthy[:, known]
        variance, noise = _variances(block, x, weight, unit)
        if not both.any() or not np.isfinite(variance).all():
            continue
        scaled = x / np.sqrt(variance * x.shape[1])[:, np.newaxis]
        of_unit, of_own = (_mean_inverse(weight, group) for group in (unit, own))
        with np.errstate(invalid="ignore"):
            expected = np.fmax(variance + noise * (of_own - of_unit), noise * of_own)
        relative = np.where(np.isfinite(noise).all(), expected / variance, 1.0).mean(axis=1)
        beyond, score[number, both] = _of_kernel(
            scaled @ scaled.transpose(0, 2, 1),
            own,
            others,
            _ridge(noise * of_unit, variance),
            relative,
        )
        # the unit of a lone session is chance
        orthogonal[number, both] = beyond + ROUNDING * (unit.sum(axis=1) == 1)
    return Distances(_log_mean(orthogonal), _log_mean(score))


def influences(blocks: Sequence[Block], sessions: NDArray[np.int64]) -> float:
    """How many influences of like size make sessions differ.

    Parameters
    ----------
    blocks : sequence of Block
        All motions of one axis.
    sessions : ndarray, shape (N,)
        Indices of healthy sessions.

    Returns
    -------
    float
        Between 1 and N - 1: the degrees of freedom of a sum of squares with the variances of the
        principal components (F. E. Satterthwaite, Biometrics Bulletin 2, 1946), less than the
        true number where sessions are few. 1 if nothing is known.
    """
    total = np.zeros((len(sessions), len(sessions)))
    everyone = np.ones((1, len(sessions)), dtype=bool)
    for block in blocks:
        own, weight = block.sessions[sessions], block.weight[sessions]
        if np.isfinite(own).all() and (weight > 0).all() and len(own) > 1:
            x = own - own.mean(axis=0)
            scaled = x / np.sqrt(_variances(block, x, weight, everyone)[0] * x.shape[1])
            total += scaled @ scaled.T
    square = float((total**2).sum())
    return max(1.0, float(np.trace(total)) ** 2 / square) if square > 0 else 1.0


def noise_share(blocks: Sequence[Block], n_baseline: int) -> float:
    """Share of the baseline sessions' variance that the scatter of their cycles explains.

    Parameters
    ----------
    blocks : sequence of Block
        All motions of one axis.
    n_baseline : int
        Number of baseline sessions, which come first.

    Returns
    -------
    float
        Mean over the motions, 1 at most; `USUAL_NOISE` if no session has two cycles.
    """
    everyone = np.ones((1, n_baseline), dtype=bool)
    shares = []
    for block in blocks:
        own, weight = block.sessions[:n_baseline], block.weight[:n_baseline]
        if np.isfinite(own).all() and (weight > 0).all():
            variance, noise = _variances(block, own - own.mean(axis=0), weight, everyone)
            shares.append((noise * _mean_inverse(weight, everyone)).mean() / variance.mean())
    share = float(np.mean(shares)) if shares else math.nan
    return min(share, 1.0) if math.isfinite(share) else USUAL_NOISE


def _variances(
    block: Block, x: FloatArray, weight: FloatArray, healthy: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Variance of healthy sessions, shape (R, F), and of a single cycle, shape (F,).

    Few sessions say little of one part, so that its variance is moderated by the motion's mean
    (G. K. Smyth, Stat. Appl. Genet. Mol. Biol. 3, 2004). A lone session shows none: its cycles
    show what is least.
    """
    n = healthy.sum(axis=1)[:, np.newaxis]
    noise = moderated(block.within, 1.0)
    dof = n - 1
    squares = np.maximum(healthy @ x**2 - (healthy @ x) ** 2 / np.maximum(n, 1), 0.0)
    typical = squares.mean(axis=1, keepdims=True) / np.maximum(dof, 1)
    variance = (PRIOR_DOF * typical + squares) / (PRIOR_DOF + dof)
    variance = np.where(dof > 0, variance, noise * _mean_inverse(weight, healthy))
    return np.maximum(variance, block.least_variance), noise


def _mean_inverse(weight: FloatArray, group: BoolArray) -> FloatArray:
    """Mean share that a single cycle has in a session of each group, shape (R, 1)."""
    return np.asarray((group @ (1 / weight) / np.maximum(group.sum(axis=1), 1))[:, np.newaxis])


def _ridge(noise: FloatArray, variance: FloatArray) -> FloatArray:
    if not np.isfinite(noise).all():
        return np.full(len(variance), USUAL_RIDGE)
    share = np.broadcast_to(noise, variance.shape).mean(axis=1) / variance.mean(axis=1)
    share = np.clip(share, LEAST_RIDGE, 1 - LEAST_RIDGE)
    return np.asarray(share / (1 - share))


def _of_kernel(
    kernel: FloatArray,
    target: BoolArray,
    rest: BoolArray,
    ridge: FloatArray,
    relative: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Orthogonal and score distance of each labelling, from products of sessions alone.

    Parameters
    ----------
    kernel : ndarray, shape (R, S, S) or (1, S, S)
        Products of all pairs of sessions, each part in units of its standard deviation.
    target, rest : ndarray of bool, shape (R, S)
        The two groups.
    ridge : ndarray, shape (R,) or (1,)
        Share of noise in the sessions' variance.
    relative : ndarray, shape (R,)
        Variance of a session of the target over that of one of the rest.
    """
    n_target, n_rest = target.sum(axis=1), rest.sum(axis=1)
    mean_target = target / n_target[:, np.newaxis]
    mean_rest = rest / n_rest[:, np.newaxis]
    contrast = mean_target - mean_rest
    own_mean = np.where(target[:, :, np.newaxis], mean_target[:, np.newaxis], 0.0)
    own_mean = np.where(rest[:, :, np.newaxis], mean_rest[:, np.newaxis], own_mean)
    # a session less its group's mean; nothing for those in neither group
    scatter = (target | rest)[:, :, np.newaxis] * np.eye(kernel.shape[1]) - own_mean
    shifted = (contrast[:, np.newaxis] @ kernel)[:, 0]
    square = (shifted * contrast).sum(axis=1)
    along = np.einsum("rij,rj->ri", scatter, shifted)
    gram = scatter @ kernel @ scatter.transpose(0, 2, 1)
    dof = np.maximum(n_target + n_rest - 2, 1)
    mean_variance = np.trace(gram, axis1=1, axis2=2) / dof
    penalty = (ridge * mean_variance + LEAST_DISTANCE)[:, np.newaxis, np.newaxis]
    weights = np.linalg.solve(gram + penalty * np.eye(kernel.shape[1]), along[:, :, np.newaxis])[
        ..., 0
    ]
    explained = 2 * (weights * along).sum(axis=1)
    explained -= np.einsum("ri,rij,rj->r", weights, gram, weights)
    leverage = (weights**2).sum(axis=1)
    error = relative / n_target + 1 / n_rest + leverage
    return np.maximum(square - explained, 0.0) / error, leverage


def _log_mean(values: FloatArray) -> FloatArray:
    mean, _ = mean_of_known(values)
    return np.asarray(np.log(np.maximum(mean, LEAST_DISTANCE)))
