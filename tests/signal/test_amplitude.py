"""How large a current is, in three numbers."""

import numpy as np
import pytest

from opamc_cli.signal.amplitude import FLOOR_A, log_amplitudes


def test_three_sizes_by_hand():
    found = np.exp(log_amplitudes(np.array([3.0, -4.0, 0.0])))
    assert found == pytest.approx([(25 / 3) ** 0.5, ((7**2 + 4**2) / 2) ** 0.5, 7 / 3])


def test_a_current_twice_as_large_is_log_two_more():
    current = np.random.default_rng(1).normal(size=500)
    moved = log_amplitudes(2 * current) - log_amplitudes(current)
    assert moved == pytest.approx(np.log(2) * np.ones(3))


def test_a_motion_with_a_gap_has_no_size():
    current = np.linspace(0, 1, 50)
    current[20:30] = np.nan
    assert log_amplitudes(current).size == 0


def test_too_few_samples_have_no_size_and_no_current_has_the_least():
    assert log_amplitudes(np.array([1.0])).size == 0
    assert log_amplitudes(np.zeros(9)) == pytest.approx(np.log(FLOOR_A) * np.ones(3))
