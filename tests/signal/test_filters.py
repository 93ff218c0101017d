"""The filters do what those of scipy.signal do, over every way in which lengths can meet."""

import numpy as np
import pytest
import scipy.signal

from opamc_cli.signal.filters import (
    autocorrelation,
    convolved,
    local_polynomial,
    polynomial_weights,
)

# one block, as many as fit, one more, and kernels around half of and all of the recording
LENGTHS = [
    (2, 2),
    (7, 5),
    (51, 51),
    (50, 24),
    (50, 25),
    (50, 26),
    (300, 3),
    (5003, 137),
    (9001, 35),
]


def close(found, expected):
    size = np.max(np.abs(expected))
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * size)


@pytest.mark.parametrize("columns", [None, 1, 2])
@pytest.mark.parametrize(("n", "k"), LENGTHS)
def test_convolved_is_the_sum_of_products(n, k, columns):
    rng = np.random.default_rng(n + k)
    values = rng.normal(size=n if columns is None else (n, columns))
    kernel = rng.normal(size=k)
    found = convolved(values, kernel)
    windows = np.lib.stride_tricks.sliding_window_view(values, k, axis=0)
    np.testing.assert_allclose(found, windows @ kernel[::-1], rtol=0, atol=1e-11)
    shape = (-1,) if columns is None else (-1, 1)
    close(found, scipy.signal.oaconvolve(values, kernel.reshape(shape), "valid", axes=0))


@pytest.mark.parametrize("n", [1, 2, 17, 1000])
def test_autocorrelation_is_the_sum_of_products(n):
    values = np.random.default_rng(n).normal(size=n)
    slow = [float(values[: n - lag] @ values[lag:]) for lag in range(n)]
    np.testing.assert_allclose(autocorrelation(values), slow, rtol=0, atol=1e-10)


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize("window", [5, 7, 15, 341])
def test_local_polynomials_are_those_of_scipy(window, derivative):
    step = 1 / 2048
    for use, theirs in (("convolution", "conv"), ("product", "dot")):
        weights = polynomial_weights(window, 3, derivative, step, use)
        close(weights, scipy.signal.savgol_coeffs(window, 3, derivative, step, use=theirs))
    for n in (window, window + 1, 4 * window):
        values = np.cumsum(np.random.default_rng(n).normal(size=n))
        for order in (2, 3):
            found = local_polynomial(values, window, order, derivative, step)
            close(found, scipy.signal.savgol_filter(values, window, order, derivative, step))


def test_a_cubic_is_its_own_local_polynomial_up_to_the_ends():
    time = np.arange(40) / 10
    found = local_polynomial(time**3 - 2 * time, 9, 3, 1, 0.1)
    np.testing.assert_allclose(found, 3 * time**2 - 2, atol=1e-9)
