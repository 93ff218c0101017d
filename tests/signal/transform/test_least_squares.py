"""Least squares from sums of products, for regressors of any size and any likeness."""

import numpy as np
import pytest

from opamc_cli.signal.transform import least_squares
from opamc_cli.signal.transform.least_squares import eigenvectors, inverse, leverage, root_of, solve


def random_columns(seed=4, sets=3, rows=40, width=6):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(sets, rows, width)) * 10.0 ** rng.integers(-6, 7, width)
    return columns, rng.normal(size=(sets, rows))


def test_solution_is_that_of_least_squares_whatever_the_units():
    columns, signal = random_columns()
    gram = np.swapaxes(columns, -1, -2) @ columns
    moment = np.einsum("gij,gi->gj", columns, signal)
    for k in range(3):
        expected = np.linalg.lstsq(columns[k] / np.linalg.norm(columns[k], axis=0), signal[k])[0]
        expected /= np.linalg.norm(columns[k], axis=0)
        np.testing.assert_allclose(solve(gram, moment)[k], expected, rtol=1e-8)
        np.testing.assert_allclose(solve(gram[k], moment[k]), expected, rtol=1e-8)


def test_equal_columns_share_the_coefficient():
    column = np.arange(1.0, 9.0)
    columns = np.stack([column, column], axis=1)
    found = solve(columns.T @ columns, columns.T @ (4 * column))
    np.testing.assert_allclose(found, [2, 2])


def test_a_column_of_zeros_gets_nothing_and_breaks_nothing():
    columns = np.stack([np.ones(20), np.zeros(20)], axis=1)
    found = solve(columns.T @ columns, columns.T @ np.full(20, 3.0))
    np.testing.assert_allclose(found, [3, 0], atol=1e-12)
    assert solve(np.zeros((0, 0)), np.zeros(0)).size == 0
    assert solve(np.zeros((1, 1)), np.zeros(1)) == pytest.approx([0.0])


@pytest.mark.parametrize("seed", range(8))
def test_what_nothing_excites_has_no_coefficient_beside_columns_that_are_alike(seed):
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(50, 6))
    columns[:, 3], columns[:, 4] = 0.0, columns[:, 1]
    gram, moment = columns.T @ columns, columns.T @ rng.normal(size=50)
    assert solve(gram, moment)[3] == 0.0
    assert not inverse(gram)[3].any()
    rest = np.delete(np.arange(6), 3)
    expected = solve(gram[np.ix_(rest, rest)], moment[rest])
    np.testing.assert_allclose(solve(gram, moment)[rest], expected, rtol=1e-9)


def test_inverse_is_the_inverse_and_of_a_singular_matrix_the_pseudo_inverse():
    columns, _ = random_columns()
    gram = np.swapaxes(columns, -1, -2) @ columns
    scale = np.sqrt(np.einsum("gii->gi", gram))
    identity = (inverse(gram) @ gram) * scale[:, None, :] ** -1 * scale[:, :, None]
    np.testing.assert_allclose(identity, np.broadcast_to(np.eye(6), gram.shape), atol=1e-8)
    twice = np.ones((1, 2, 2))
    np.testing.assert_allclose(twice @ inverse(twice) @ twice, twice, atol=1e-12)
    assert inverse(np.zeros((3, 0, 0))).shape == (3, 0, 0)


def test_a_matrix_that_divide_and_conquer_gives_up_on_is_solved_all_the_same(monkeypatch):
    columns, signal = random_columns()
    gram = np.swapaxes(columns, -1, -2) @ columns
    moment = np.einsum("gij,gi->gj", columns, signal)
    expected = solve(gram, moment)

    def gives_up(matrix):
        msg = "Eigenvalues did not converge"
        raise np.linalg.LinAlgError(msg)

    monkeypatch.setattr(np.linalg, "eigh", gives_up)
    plain = np.random.default_rng(0).normal(size=(5, 5))
    values, vectors = eigenvectors(plain + plain.T)
    np.testing.assert_allclose(vectors * values @ vectors.T, plain + plain.T, atol=1e-12)
    np.testing.assert_allclose(solve(gram, moment), expected, rtol=1e-6)


def test_eigenvalues_are_asked_for_only_where_one_may_be_small(monkeypatch):
    columns, signal = random_columns()
    size = np.linalg.norm(columns[1, :, 3])
    columns[1, :, 2] = columns[1, :, 3] + 1e-6 * size * signal[1]
    # A column that nothing excites is no reason.
    columns[0, :, 4] = 0.0
    gram = np.swapaxes(columns, -1, -2) @ columns
    asked = []
    own = least_squares.eigenvectors
    monkeypatch.setattr(
        least_squares, "eigenvectors", lambda some: asked.append(some.shape) or own(some)
    )
    found = inverse(gram)
    assert asked == [(1, 6, 6)]
    monkeypatch.setattr(np.linalg, "inv", lambda some: np.full_like(some, np.nan))
    every = inverse(gram)
    sizes = np.sqrt(np.einsum("gii->gi", gram))
    found, every = (one * sizes[:, None, :] * sizes[:, :, None] for one in (found, every))
    np.testing.assert_allclose(found, every, rtol=1e-9, atol=1e-9)
    assert asked[1] == (3, 6, 6)


def test_leverage_is_one_on_the_mean_where_a_fit_was_made():
    columns, _ = random_columns()
    design = columns[0] * np.array([1e-4, 1, 3, 1e5, 1, 1])
    design[:, 5] = 2 * design[:, 4]  # no fit tells the two apart
    root = root_of(design.T @ design / len(design))
    np.testing.assert_allclose(np.tril(root, -1), 0, atol=1e-9)
    np.testing.assert_allclose(root.T @ root, design.T @ design / len(design), rtol=1e-6)
    found = leverage(design, root)
    assert found.mean() == pytest.approx(1.0)
    scaled = design / np.linalg.norm(design, axis=0)
    expected = np.sum((scaled @ np.linalg.pinv(scaled.T @ scaled, rcond=1e-9)) * scaled, axis=1)
    np.testing.assert_allclose(found, expected * len(design) / 5, rtol=1e-6)
    np.testing.assert_allclose(leverage(3 * design, root), 9 * found, rtol=1e-9)
    assert leverage(np.zeros((4, 0)), np.zeros((0, 0))).tolist() == [0, 0, 0, 0]


def test_leverage_is_large_where_the_fit_has_no_coefficient():
    forth = np.stack([np.ones(50), np.ones(50), np.zeros(50)], axis=1)
    root = root_of(forth.T @ forth / len(forth))
    assert leverage(forth, root) == pytest.approx(1.0)
    back, more = np.array([[1.0, -1.0, 0.0]]), np.array([[1.0, 1.0, 0.01]])
    assert leverage(back, root) > 1e6
    assert leverage(more, root) > 1e6
