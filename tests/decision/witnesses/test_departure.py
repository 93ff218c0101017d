"""Distances along and beyond what sessions differ by, beside their definition."""

import numpy as np
import pytest

from opamc_cli.decision.witnesses import departure
from opamc_cli.decision.witnesses.departure import LEAST_RIDGE, Block, distances, influences
from opamc_cli.decision.witnesses.deviation import PRIOR_DOF


def slow_distances(block: Block, target, rest):
    """One comparison by its definition, part by part; returns beyond and along."""
    known = np.isfinite(block.sessions).all(axis=1) & (block.weight > 0)
    own, others = block.sessions[known & target], block.sessions[known & rest]
    n_own, n_others = len(own), len(others)
    dof = n_others - 1
    squares = ((others - others.mean(axis=0)) ** 2).sum(axis=0)
    variance = (PRIOR_DOF * squares.mean() / dof + squares) / (PRIOR_DOF + dof)
    variance = np.maximum(variance, block.least_variance)
    typical = block.within.mean()
    noise = (PRIOR_DOF * typical + block.within) / (PRIOR_DOF + 1)
    of_others = np.mean(1 / block.weight[known & rest])
    of_own = np.mean(1 / block.weight[known & target])
    share = np.clip((noise * of_others).mean() / variance.mean(), LEAST_RIDGE, 1 - LEAST_RIDGE)
    expected = np.maximum(variance + noise * (of_own - of_others), noise * of_own)
    scale = np.sqrt(variance * len(variance))
    away = (own.mean(axis=0) - others.mean(axis=0)) / scale
    # of several target sessions the scatter about their own mean counts as well
    spread = np.concatenate([others - others.mean(axis=0), own - own.mean(axis=0)]) / scale
    gram = spread @ spread.T
    ridge = share / (1 - share) * np.trace(gram) / max(n_own + n_others - 2, 1)
    weights = np.linalg.solve(gram + (ridge + 1e-9) * np.eye(len(gram)), spread @ away)
    left = ((away - weights @ spread) ** 2).sum()
    leverage = float(weights @ weights)
    error = (expected / variance).mean() / n_own + 1 / n_others + leverage
    return np.log(left / error), np.log(leverage)


def block(n_sessions: int = 7, n_parts: int = 12, seed: int = 0, noise: float = 0.3) -> Block:
    """Sessions that one influence moves, and that scatter besides."""
    rng = np.random.default_rng(seed)
    sessions = rng.normal(size=(n_sessions, 1)) * rng.normal(size=n_parts)
    sessions += noise * rng.normal(size=sessions.shape)
    weight = rng.integers(2, 6, n_sessions).astype(float)
    return Block(sessions, weight, rng.uniform(0.05, 0.2, n_parts), 1e-9)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_target", [1, 2])
def test_distances_are_those_of_their_definition(seed, n_target):
    one = block(seed=seed)
    if seed == 3:
        one.sessions[1] = np.nan
    target = np.arange(7) >= 7 - n_target
    found = distances([one], target[np.newaxis], ~target[np.newaxis])
    beyond, along = slow_distances(one, target, ~target)
    assert found.orthogonal == pytest.approx([beyond], rel=1e-6)
    assert found.score == pytest.approx([along], rel=1e-6)


@pytest.mark.parametrize("at_once", [1, 200, 10**6])
def test_distances_of_several_motions_are_the_mean_of_each_ones_own(monkeypatch, at_once):
    """They are reckoned together where they are alike: of other sessions or widths they are not."""
    monkeypatch.setattr(departure, "MOST_AT_ONCE", at_once)
    blocks = [block(seed=seed, n_parts=(12, 5)[seed % 2]) for seed in range(8)]
    for number, session in ((1, 3), (2, 6), (4, 0)):
        blocks[number].sessions[session] = np.nan
    blocks[6].within[:] = np.nan
    blocks[7].sessions[:] = np.nan
    target = np.eye(7, dtype=bool)
    found = distances(blocks, target, ~target)
    alone = [distances([one], target, ~target) for one in blocks]
    for kind in ("orthogonal", "score"):
        each = np.exp([getattr(one, kind) for one in alone])
        mean = np.nanmean(each, axis=0)
        np.testing.assert_allclose(np.exp(getattr(found, kind)), mean, rtol=1e-12)


def test_what_one_influence_does_lies_along_and_what_is_new_beyond():
    usual = block(noise=0.05)
    direction = np.linalg.svd(usual.sessions[:6] - usual.sessions[:6].mean(axis=0))[2][0]
    new = np.random.default_rng(9).normal(size=12)
    new -= (new @ direction) * direction
    target = (np.arange(7) == 6)[np.newaxis]
    rest = ~target
    moved = {}
    for name, change in {"none": 0 * new, "along": 8 * direction, "beyond": new}.items():
        sessions = usual.sessions.copy()
        sessions[6] = sessions[:6].mean(axis=0) + change
        one = Block(sessions, usual.weight, usual.within * 0.01, 1e-9)
        moved[name] = distances([one], target, rest)
    assert moved["along"].score[0] > moved["none"].score[0] + 5
    assert moved["beyond"].orthogonal[0] > moved["none"].orthogonal[0] + 3
    # the error of a prediction grows with its weights: what lies along is not taken for new
    assert moved["along"].orthogonal[0] < moved["beyond"].orthogonal[0] - 2


def test_sessions_that_differ_by_noise_alone_explain_nothing():
    """A change in all parts is not halved because it resembles some of the noise."""
    rng = np.random.default_rng(4)
    sessions = rng.normal(size=(7, 200))
    sessions[6] += 30
    one = Block(sessions, np.ones(7), np.ones(200), 1e-9)
    found = distances([one], (np.arange(7) == 6)[np.newaxis], (np.arange(7) != 6)[np.newaxis])
    # thirty standard deviations, squared, over 1 + 1/6
    assert np.exp(found.orthogonal[0]) == pytest.approx(900 / (7 / 6), rel=0.1)


def test_influences_are_counted():
    rng = np.random.default_rng(2)
    one = Block(rng.normal(size=(40, 1)) * rng.normal(size=30), np.ones(40), np.ones(30), 1e-9)
    many = Block(rng.normal(size=(40, 30)), np.ones(40), np.ones(30), 1e-9)
    assert influences([one], np.arange(40)) == pytest.approx(1.0)
    assert influences([many], np.arange(40)) > 10
    assert influences([], np.arange(3)) == 1.0
