import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.testbed.trajectory import evaluate_move, plan_move

positive = st.floats(0.05, 50.0)


@given(st.floats(-8.0, 8.0), positive, positive, positive)
@settings(max_examples=200)
def test_a_move_keeps_its_limits_and_arrives_at_rest(
    distance: float, velocity: float, acceleration: float, jerk: float
) -> None:
    move = plan_move(distance, velocity, acceleration, jerk)
    time = np.linspace(0.0, move.duration_s, 2001)
    p, v, a = evaluate_move(move, time)
    assert p[0] == pytest.approx(0.0, abs=1e-9)
    assert p[-1] == pytest.approx(distance, abs=1e-9 + 1e-9 * abs(distance))
    assert v[-1] == pytest.approx(0.0, abs=1e-6 * velocity)
    assert np.abs(v).max() <= velocity * (1 + 1e-9)
    assert np.abs(a).max() <= acceleration * (1 + 1e-9)
    assert np.all(np.sign(distance) * v >= -1e-9)


@given(st.floats(0.1, 5.0), positive, positive, positive)
@settings(max_examples=50)
def test_velocity_and_acceleration_are_the_derivatives(
    distance: float, velocity: float, acceleration: float, jerk: float
) -> None:
    move = plan_move(distance, velocity, acceleration, jerk)
    time = np.linspace(0.0, move.duration_s, 40001)
    p, v, a = evaluate_move(move, time)
    step = time[1] - time[0]
    assert np.allclose(np.diff(p) / step, (v[1:] + v[:-1]) / 2, atol=jerk * step**2)
    assert np.allclose(np.diff(v)[1:-1] / step, (a[1:] + a[:-1])[1:-1] / 2, atol=2 * jerk * step)


def test_long_moves_reach_the_velocity_and_short_ones_do_not() -> None:
    time = np.linspace(0.0, 3.0, 30001)
    _, fast, _ = evaluate_move(plan_move(3.0, 2.0, 20.0, 400.0), time)
    _, slow, _ = evaluate_move(plan_move(0.01, 2.0, 20.0, 400.0), time)
    assert fast.max() == pytest.approx(2.0, rel=1e-6)
    assert slow.max() < 1.0


def test_limits_must_be_positive() -> None:
    with pytest.raises(ValueError, match="positive"):
        plan_move(1.0, 0.0, 1.0, 1.0)
