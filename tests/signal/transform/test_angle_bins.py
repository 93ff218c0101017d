"""The spectrum over an angle beside a sum over all samples."""

import numpy as np
import pytest

from opamc_cli.signal.transform import angle_bins
from opamc_cli.signal.transform.angle_bins import AngleBins, vertex


def slow_power(orders, angle, values):
    return np.abs(np.exp(-1j * orders[:, None] * angle) @ values) ** 2


def test_the_power_is_that_of_all_samples_at_their_own_angles():
    rng = np.random.default_rng(3)
    angle = np.sort(rng.uniform(0, 40.0, 800))
    values = np.cos(3 * angle) + 0.1 * rng.normal(size=angle.size)
    bins = AngleBins.of(float(angle.max()), 8.0)
    found, slow = bins.power(angle, values), slow_power(bins.orders, angle, values)
    # half a bin at most: a sixteenth of the shortest wave
    assert np.abs(found - slow).max() < 0.02 * slow.max()
    assert bins.orders[np.argmax(found)] == pytest.approx(3.0, abs=0.05)
    assert bins.orders[-1] < 8.0


def test_a_long_travel_is_wound_up_by_whole_turns(monkeypatch):
    angle = np.linspace(0, 400.0, 8000)
    whole = AngleBins.of(400.0, 8.0)
    monkeypatch.setattr(angle_bins, "MOST_BINS", whole.orders.size // 8)
    wound = AngleBins.of(400.0, 8.0)
    assert wound.travel_rad / (2 * np.pi) == pytest.approx(round(wound.travel_rad / (2 * np.pi)))
    power = wound.power(angle, np.cos(3 * angle))
    assert wound.orders[np.argmax(power)] == pytest.approx(3.0, abs=wound.orders[1])


def test_the_vertex_of_a_parabola_lies_between_the_samples():
    orders = np.array([1.0, 1.5, 2.0, 2.5])
    assert vertex(orders, -((orders - 1.6) ** 2), 1) == pytest.approx(1.6)
    # No peak, or none with two neighbours: the sample itself.
    assert vertex(orders, np.array([1.0, 1.0, 1.0, 1.0]), 1) == 1.5
    assert vertex(orders, np.array([3.0, 2.0, 1.0, 0.0]), 0) == 1.0
