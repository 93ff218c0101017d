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

USUAL_NOISE = 0.7
"""Share of noise in the variance of sessions of one cycle: by nights of four and sixteen cycles, in
which it is 0.37 and 0.13, it is 0.70 and 0.71."""

ROUNDING = 1 / 12
"""Variance of a count's rounding over that of its chance where a pattern is seen once (W. F.
Sheppard, 1898): two sessions of few patterns that agree better than that do so by luck, and have no
other to show it."""

LEAST_DISTANCE = 1e-9
"""Identical recordings have distance zero; a billionth of a healthy one's stands for it."""

MOST_AT_ONCE = 2_000_000
"""Products of pairs of sessions that are held at once, 16 MB."""


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
    healthy : ndarray of bool, shape (1, S), optional
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
    for numbers, known in _alike(blocks):
        both = target[:, known].any(axis=1) & rest[:, known].any(axis=1)
        if not both.any():
            continue
        own, others = target[both][:, known], rest[both][:, known]
        unit = others if healthy is None else healthy[:, known]
        at_once = max(MOST_AT_ONCE // (own.size * own.shape[1]), 1)
        for first in range(0, len(numbers), at_once):
            some = numbers[first : first + at_once]
            beyond, along = _of_alike([blocks[i] for i in some], known, own, others, unit)
            # the unit of a lone session is chance
            places = np.ix_(np.array(some), both)
            orthogonal[places] = beyond + ROUNDING * (unit.sum(axis=1) == 1)
            score[places] = along
    return Distances(_log_mean(orthogonal), _log_mean(score))


def _alike(blocks: Sequence[Block]) -> list[tuple[list[int], BoolArray]]:
    """Return the places of blocks of one width in which the same sessions are known, and which.

    Mostly all of them: one by one they take twice as long.
    """
    found: dict[tuple[bytes, int], tuple[list[int], BoolArray]] = {}
    for number, block in enumerate(blocks):
        known = np.isfinite(block.sessions).all(axis=1) & (block.weight > 0)
        if known.any():
            key = known.tobytes(), block.sessions.shape[1]
            found.setdefault(key, ([], known))[0].append(number)
    return list(found.values())


def _of_alike(
    blocks: Sequence[Block], known: BoolArray, own: BoolArray, others: BoolArray, unit: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Distances of some blocks' sessions, shape (blocks, R); NaN where no variance is known."""
    x = np.stack([block.sessions[known] for block in blocks])
    x = x - x.mean(axis=1, keepdims=True)
    weights = [block.weight[known] for block in blocks]
    found = [_variances(*one, unit) for one in zip(blocks, x, weights, strict=True)]
    variance, noise = (np.stack(parts) for parts in zip(*found, strict=True))
    noise = noise[:, np.newaxis]
    of_unit, of_own = (
        np.stack([_mean_inverse(weight, group) for weight in weights]) for group in (unit, own)
    )
    told = np.isfinite(noise).all(axis=2)
    with np.errstate(invalid="ignore"):
        scaled = x[:, np.newaxis] / np.sqrt(variance * x.shape[2])[:, :, np.newaxis]
        expected = np.fmax(variance + noise * (of_own - of_unit), noise * of_own)
    relative = np.where(told, (expected / variance).mean(axis=2), 1.0)
    ridge = np.where(told, _ridge(noise * of_unit, variance), USUAL_NOISE / (1 - USUAL_NOISE))
    usable = np.isfinite(variance).all(axis=(1, 2))
    shape = len(blocks), len(own)
    beyond, along = np.full(shape, np.nan), np.full(shape, np.nan)
    scaled = scaled[usable]
    kernel = scaled @ scaled.swapaxes(2, 3)
    beyond[usable], along[usable] = _of_kernel(kernel, own, others, ridge[usable], relative[usable])
    return beyond, along


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
    noise = moderated(block.within)
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
    """Ridge over the mean variance, shape (..., R) of variances of shape (..., R, F)."""
    share = np.broadcast_to(noise, variance.shape).mean(axis=-1) / variance.mean(axis=-1)
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
    kernel : ndarray, shape (M, R, S, S) or (M, 1, S, S)
        Products of all pairs of sessions of M motions, each part in units of its standard
        deviation.
    target, rest : ndarray of bool, shape (R, S)
        The two groups.
    ridge : ndarray, shape (M, R) or (M, 1)
        Share of noise in the sessions' variance.
    relative : ndarray, shape (M, R)
        Variance of a session of the target over that of one of the rest.
    """
    n_target, n_rest = target.sum(axis=1), rest.sum(axis=1)
    mean_target = target / n_target[:, np.newaxis]
    mean_rest = rest / n_rest[:, np.newaxis]
    contrast = mean_target - mean_rest
    own_mean = np.where(target[:, :, np.newaxis], mean_target[:, np.newaxis], 0.0)
    own_mean = np.where(rest[:, :, np.newaxis], mean_rest[:, np.newaxis], own_mean)
    # a session less its group's mean; nothing for those in neither group
    scatter = (target | rest)[:, :, np.newaxis] * np.eye(kernel.shape[-1]) - own_mean
    shifted = (contrast[:, np.newaxis] @ kernel)[:, :, 0]
    square = (shifted * contrast).sum(axis=2)
    along = np.einsum("rij,mrj->mri", scatter, shifted)
    gram = scatter @ kernel @ scatter.transpose(0, 2, 1)
    dof = np.maximum(n_target + n_rest - 2, 1)
    mean_variance = np.trace(gram, axis1=2, axis2=3) / dof
    penalty = (ridge * mean_variance + LEAST_DISTANCE)[..., np.newaxis, np.newaxis]
    weights = np.linalg.solve(gram + penalty * np.eye(kernel.shape[-1]), along[..., np.newaxis])
    weights = weights[..., 0]
    explained = 2 * (weights * along).sum(axis=2)
    explained -= np.einsum("mri,mrij,mrj->mr", weights, gram, weights)
    leverage = (weights**2).sum(axis=2)
    error = relative / n_target + 1 / n_rest + leverage
    return np.maximum(square - explained, 0.0) / error, leverage


def _log_mean(values: FloatArray) -> FloatArray:
    mean, _ = mean_of_known(values)
    return np.asarray(np.log(np.maximum(mean, LEAST_DISTANCE)))
