"""Averages stay inside each recording."""

import numpy as np
import pytest

from opamc_cli.signal.transform.averages import averaged, block_mean

TWO = ((0, 7), (7, 12))


def test_a_block_is_its_samples_mean_and_a_rest_is_dropped():
    values = np.arange(12.0)
    assert block_mean(values, TWO, 3).tolist() == [1.0, 4.0, 8.0]
    both = block_mean(np.stack([values, -values], axis=1), TWO, 3)
    assert both.tolist() == [[1.0, -1.0], [4.0, -4.0], [8.0, -8.0]]
    assert block_mean(values, TWO, 1) is values


def test_a_moving_average_does_not_reach_into_another_recording():
    values = np.r_[np.zeros(7), np.full(5, 9.0)]
    assert averaged(values, TWO, np.ones(3) / 3) == pytest.approx(values)
    impulse = np.zeros(12)
    impulse[3] = 3.0
    assert averaged(impulse, TWO, np.ones(3) / 3)[:7] == pytest.approx([0, 0, 1, 1, 1, 0, 0])
