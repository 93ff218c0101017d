"""A speed logged in other units than the position's."""

import numpy as np
import pytest
from simulator import simulate

from opamc_cli.joint.motion.kinematics import speed_ratio


@pytest.mark.parametrize("ratio", [1.0, 180 / np.pi, 30 / np.pi, np.pi / 180])
def test_the_ratio_of_a_logged_speed_to_the_position_s_change_is_told(ratio):
    made = simulate(4, rate=500.0, quantum=1e-4)
    noise = np.random.default_rng(0).normal(0, 0.05, made.velocity.size)
    found = speed_ratio(made.position, ratio * (made.velocity + noise), made.rate_hz)
    assert found == pytest.approx(ratio, rel=0.01)


def test_no_ratio_is_told_where_speed_and_position_are_of_different_motions_or_of_none():
    made, other = (simulate(seed, rate=500.0) for seed in (4, 5))
    n = min(made.velocity.size, other.velocity.size)
    assert speed_ratio(made.position[:n], other.velocity[:n], 500.0) is None
    assert speed_ratio(np.zeros(n), np.zeros(n), 500.0) is None
