import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.joint.normal import (
    appended,
    eigenvectors,
    extended,
    held_out_error,
    normal_equations,
    solve,
)


def slow_held_out(columns, signal, slices):
    errors = []
    for start, stop in slices:
        rest = np.r_[0:start, stop : len(signal)]
        fitted = np.linalg.lstsq(columns[rest], signal[rest], rcond=None)[0]
        errors.append(np.sum((signal[start:stop] - columns[start:stop] @ fitted) ** 2))
    return np.array(errors)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 5), st.integers(2, 6))
def test_leaving_groups_out_equals_refitting(seed, width, groups):
    rng = np.random.default_rng(seed)
    sizes = rng.integers(width + 2, 30, groups)
    stops = np.cumsum(sizes)
    slices = tuple((int(b - s), int(b)) for b, s in zip(stops, sizes, strict=True))
    columns = rng.normal(size=(stops[-1], width)) * 10.0 ** rng.integers(-4, 5, width)
    signal = rng.normal(size=stops[-1])
    fast = held_out_error(normal_equations(columns, signal, slices))
    np.testing.assert_allclose(fast, slow_held_out(columns, signal, slices), rtol=1e-6)


def test_equal_columns_share_the_coefficient():
    column = np.arange(1.0, 9.0)
    columns = np.stack([column, column], axis=1)
    found = solve(columns.T @ columns, columns.T @ (4 * column))
    np.testing.assert_allclose(found, [2, 2])


def test_a_column_of_zeros_gets_nothing_and_breaks_nothing():
    columns = np.stack([np.ones(20), np.zeros(20)], axis=1)
    normal = normal_equations(columns, np.full(20, 3.0), ((0, 10), (10, 20)))
    assert held_out_error(normal) == pytest.approx([0, 0], abs=1e-12)


def blocks_of(columns, widths):
    return np.split(columns, np.cumsum(widths)[:-1], axis=1)


def test_sums_are_the_same_whether_terms_come_together_or_one_after_the_other():
    rng = np.random.default_rng(0)
    columns, signal = rng.normal(size=(60, 6)), rng.normal(size=60)
    rows = [np.arange(5, 20), np.arange(25, 31), np.arange(40, 60)]
    inside = np.concatenate(rows)
    slices = ((0, 15), (15, 21), (21, 41))
    wanted = normal_equations(columns[inside], signal[inside], slices)
    blocks = blocks_of(columns, [2, 1, 3])
    first = extended(None, [None, None], [blocks[2], blocks[0]], signal, rows)
    later = extended(first, [3, None, 0], blocks, signal, rows)
    beside = appended(
        normal_equations(columns[inside][:, :4], signal[inside], slices),
        columns[inside][:, :4],
        columns[inside][:, 4:],
        signal[inside],
        slices,
    )
    for found in (later, beside):
        np.testing.assert_allclose(found.gram, wanted.gram, atol=1e-12)
        np.testing.assert_allclose(found.moment, wanted.moment, atol=1e-12)
        np.testing.assert_allclose(found.power, wanted.power, atol=1e-12)
        np.testing.assert_allclose(found.count, wanted.count)


def test_a_matrix_that_divide_and_conquer_gives_up_on_is_solved_all_the_same(monkeypatch):
    generator = np.random.default_rng(4)
    columns = generator.normal(size=(3, 40, 6))
    gram = np.swapaxes(columns, -1, -2) @ columns
    moment = generator.normal(size=(3, 6))
    expected = solve(gram, moment)

    def gives_up(matrix):
        msg = "Eigenvalues did not converge"
        raise np.linalg.LinAlgError(msg)

    monkeypatch.setattr(np.linalg, "eigh", gives_up)
    values, vectors = eigenvectors(gram[0])
    assert np.allclose(vectors * values @ vectors.T, gram[0])
    assert np.allclose(solve(gram, moment), expected)
