import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from opamc_cli.testbed.mechanics.mesh import damaged_share, zone_torque

angles = st.floats(-50.0, 50.0)
windups = st.floats(-3e-3, 3e-3)


@given(angles, st.floats(0.1, 1.5), st.floats(0.05, 0.8))
@settings(max_examples=200)
def test_the_share_is_periodic_bounded_and_its_slope_its_derivative(
    angle: float, sector: float, zone: float
) -> None:
    share, slope = damaged_share(angle, sector, zone)
    assert 0.0 <= share <= 1.0
    assert damaged_share(angle + 2 * math.pi, sector, zone)[0] == pytest.approx(share, abs=1e-9)
    step = 1e-6
    numeric = (
        damaged_share(angle + step, sector, zone)[0] - damaged_share(angle - step, sector, zone)[0]
    ) / (2 * step)
    assert slope == pytest.approx(numeric, abs=1e-3 / min(sector, zone) ** 2)


def test_a_zone_over_the_sectors_middle_is_damaged_and_opposite_is_not() -> None:
    assert damaged_share(0.0, math.pi / 4, 0.3)[0] == 1.0
    assert damaged_share(math.pi, math.pi / 4, 0.3)[0] == 0.0
    assert damaged_share(math.pi / 4, math.pi / 4, 0.3)[0] == pytest.approx(0.5)


def test_a_zone_longer_than_the_sector_is_never_damaged_as_a_whole() -> None:
    assert damaged_share(0.0, 0.2, 0.4) == (0.5, 0.0)


def _energy(windup: float, half_play: float, closing: float, weight: float) -> float:
    return weight * zone_torque(windup, half_play, closing, weight, 1.6e4, 1e9)[2]


@given(windups, st.floats(0.0, 8e-4), st.floats(0.0, 0.5))
@settings(max_examples=300)
def test_torques_are_derivatives_of_the_energy(
    windup: float, half_play: float, closing: float
) -> None:
    half = half_play - closing * abs(windup)
    assume(abs(half) > 1e-6 and abs(abs(windup) - max(half, 0.0)) > 1e-6 and half_play > 1e-6)
    weight, step = 0.45, 1e-8
    torque, by_play, per_weight = zone_torque(windup, half_play, closing, weight, 1.6e4, 1e9)
    for value, change in (
        (torque, (step, 0.0)),
        (by_play, (0.0, step)),
    ):
        up = _energy(windup + change[0], half_play + change[1], closing, weight)
        down = _energy(windup - change[0], half_play - change[1], closing, weight)
        assert value == pytest.approx((up - down) / (2 * step), abs=1e-3)
    assert per_weight * weight == pytest.approx(_energy(windup, half_play, closing, weight))


@given(windups, st.floats(0.0, 8e-4))
@settings(max_examples=100)
def test_play_never_adds_torque_and_torque_opposes(windup: float, half_play: float) -> None:
    loose = zone_torque(windup, half_play, 0.0, 0.5, 1.6e4, 1e9)[0]
    tight = zone_torque(windup, 0.0, 0.0, 0.5, 1.6e4, 1e9)[0]
    assert abs(loose) <= abs(tight)
    assert loose * windup >= 0.0
    if abs(windup) < half_play:
        assert loose == 0.0


def test_closing_restores_the_healthy_torque_under_load() -> None:
    """Where wind-up has closed the play, the zone is as stiff as a healthy one."""
    windups_rad = np.linspace(0.0, 5e-3, 200)
    open_ = np.array([zone_torque(w, 2e-4, 0.1, 0.5, 1.6e4, 0.0)[0] for w in windups_rad])
    healthy = 0.5 * 1.6e4 * windups_rad
    closed = windups_rad > 2e-4 / 0.1
    assert np.allclose(open_[closed], healthy[closed])
    assert np.all(open_[~closed][1:] < 1.1 * healthy[~closed][1:])
