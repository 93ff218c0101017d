import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.joint.normal import held_out_error, normal_equations, solve


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
