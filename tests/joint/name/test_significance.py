"""Differences over their standard errors, and what an effect makes of a residual of chance."""

import numpy as np
import pytest
from closing import joint_of, plain_fit

from opamc_cli.joint.effects.library import built_in_library
from opamc_cli.joint.fit.model import Term
from opamc_cli.joint.name.chain import chain_of
from opamc_cli.joint.name.significance import decoy_gain, p_value, paired

DRAWS = 5


def test_a_difference_and_its_standard_error_over_the_parts():
    before, after = np.array([1.0, 2.0, 4.0]), np.array([2.0, 2.0, 2.0])
    # Differences 1, 0, -2 of variance 7/3: three of them have one of 7 in sum.
    assert paired(before, after) == pytest.approx((-1.0, np.sqrt(7.0)))
    assert paired(before, before) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("t_value", "parts", "p"),
    [
        (0.0, 9, 0.5),
        (1.0, 2, 0.25),  # one degree of freedom: Cauchy's
        (-1.0, 2, 0.75),
        (1.0, 1, 0.25),  # of one part as of two
        (np.sqrt(2.0), 3, 0.5 - np.sqrt(2) / 4),  # t / (2 sqrt(2 + t^2)) below one half
    ],
)
def test_the_probability_of_a_t_is_student_s(t_value, parts, p):
    assert p_value(t_value, parts) == pytest.approx(p)


@pytest.fixture(scope="module")
def chain():
    def spring(q, v, a, t):
        return q

    return chain_of(plain_fit(joint_of("cyclic", spring, strength=5.0, rate=100.0)), 0)


def slow_gains(chain, term, seed):
    """Turn the sign of half of the units, and leave each out in turn, by plain least squares."""
    parts = chain.fit.dataset.parts[0]
    columns = term.columns(chain.fit.dataset.fine.track)[parts.rows]
    residual = chain.fit.residual_a[parts.rows]
    unit = np.repeat(parts.unit, [b - a for a, b in parts.slices])
    draw = np.random.default_rng(seed)
    gains = []
    for _ in range(DRAWS):
        turned = draw.permutation(np.resize([-1.0, 1.0], parts.units))[unit] * residual
        left = 0.0
        for number in range(parts.units):
            rest, mine = unit != number, unit == number
            values = np.linalg.lstsq(columns[rest], turned[rest])[0]
            left += float(np.sum((turned[mine] - columns[mine] @ values) ** 2))
        gains.append(1 - left / float(residual @ residual))
    return gains


@pytest.mark.parametrize("seed", [0, 1])
def test_a_decoy_is_the_best_of_five_residuals_half_of_which_is_turned(chain, seed):
    term = Term(built_in_library()["spring"], {})
    gains = slow_gains(chain, term, seed)
    assert decoy_gain(chain.fit, term, seed) == pytest.approx(max(gains), rel=1e-6)
    # The effect is there, and with signs of chance it does not show.
    assert max(gains) < 0.2
    assert len(set(gains)) > 1
