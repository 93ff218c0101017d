"""Differences over their standard errors."""

import numpy as np
import pytest

from opamc_cli.joint.name.significance import p_value, paired


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
