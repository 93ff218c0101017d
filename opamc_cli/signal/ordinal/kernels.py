"""Compiled loops behind the ordinal patterns: encode a block, count its codes.

With C_k[t] = (x[t] > x[t + kτ]) and D_k = C_1 + … + C_k, the Lehmer code of order m + 1 is
code_{m+1}[t] = m!·D_m[t] + code_m[t + τ], starting from code_1 = 0: compares and adds only, no
sorting. The strict `>` lets ties keep time order.
"""

from math import factorial

import numpy as np
from numba import njit
from numpy.typing import NDArray

BLOCK = 8192  # codes and digits of a block stay in the first-level cache
N_TABLES = 4  # equal codes in a row would wait for each other's increment in a single table


def count_codes(x: NDArray[np.floating], order: int, tau: int) -> NDArray[np.int64]:
    """Count all patterns of `x`, which holds no NaN and at least one pattern.

    Parameters
    ----------
    x : array, shape (n,), contiguous, float32 or float64
        Samples.
    order, tau : int
        Order 2..7 and delay in samples.

    Returns
    -------
    array of int64, shape (α!,)
        Count of each code.
    """
    # Order 5 has 120 codes: bytes hold them and twice as many fit a vector register.
    code_type = np.uint8 if order <= 5 else np.uint16
    n_codes = x.size - (order - 1) * tau
    # A block also needs the lower orders' codes up to (order-2)·τ past its end: long delays get
    # longer blocks, so that this stays a small part of the work.
    block = min(n_codes, max(BLOCK, 4 * (order - 1) * tau))
    work = np.zeros((3, block + (order - 1) * tau), dtype=code_type)
    # 32 bits: 17e9 equal patterns would be needed to overflow the four tables.
    tables = np.zeros((N_TABLES, factorial(order)), dtype=np.uint32)
    _count_blocks(x, order, tau, block, work, tables)
    counts: NDArray[np.int64] = tables.sum(axis=0, dtype=np.int64)
    return counts


@njit(cache=True, nogil=True)
def encode(
    x: NDArray[np.floating],
    missing: NDArray[np.bool_],
    order: int,
    tau: int,
    codes: NDArray[np.int16],
) -> None:
    """Write the code of every pattern of `x` into `codes`, -1 where it touches a missing sample.

    The plain form of the recurrence, for few samples or samples with gaps.
    """
    for t in range(codes.size):
        code = 0
        for i in range(order):
            if missing[t + i * tau]:
                code = -1
                break
            smaller_later = 0
            for j in range(i + 1, order):
                smaller_later += x[t + i * tau] > x[t + j * tau]
            code = code * (order - i) + smaller_later
        codes[t] = code


@njit(cache=True, nogil=True)
def _count_blocks(x, order, tau, block, work, tables):  # type: ignore[no-untyped-def]
    n_codes = x.size - (order - 1) * tau
    for start in range(0, n_codes, block):
        length = min(block, n_codes - start)
        code, following, digit = work[0], work[1], work[2]
        code[:] = 0
        digit[:] = 0
        weight = 1
        for m in range(1, order):
            weight *= m
            here = x[start:]
            n = length + (order - 1 - m) * tau
            _next_order(here, here[m * tau :], n, weight, code[tau:], following, digit)
            code, following = following, code
        _histogram(code, length, tables)


@njit(cache=True, nogil=True)
def _next_order(x, later, n, weight, code, following, digit):  # type: ignore[no-untyped-def]
    # One array per pointer and a unit step: the compiler turns this into vector instructions.
    for t in range(n):
        digit[t] += x[t] > later[t]
        following[t] = weight * digit[t] + code[t]


@njit(cache=True, nogil=True)
def _histogram(code, n, tables):  # type: ignore[no-untyped-def]
    whole = n - n % 4
    for t in range(0, whole, 4):
        tables[0, code[t]] += 1
        tables[1, code[t + 1]] += 1
        tables[2, code[t + 2]] += 1
        tables[3, code[t + 3]] += 1
    for t in range(whole, n):
        tables[0, code[t]] += 1
