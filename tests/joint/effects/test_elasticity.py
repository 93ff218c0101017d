"""A gear that winds up, seen from either side of it."""

from dataclasses import replace

import numpy as np
import pytest
from closing import close_recording
from simulator import simulate
from track_of import track_of

from opamc_cli.joint.effects.elasticity import LINK_HZ, Elasticity
from opamc_cli.joint.motion.track import coarsen


@pytest.mark.parametrize("factor", [1, 5])
def test_what_the_link_lacks_are_its_accelerations_own_rates_of_change(factor):
    _, track = track_of()
    w, time = 2 * np.pi * 2.0, np.arange(track.size) / track.rate_hz
    track = replace(track, acceleration=np.sin(w * time))
    grid = track if factor == 1 else coarsen(track, factor)
    bend, rise = Elasticity().columns(grid, {"link": 1.0}).T
    unit = 2 * np.pi * LINK_HZ
    inner = slice(grid.size // 10, -grid.size // 10)
    expected = -((w / unit) ** 2) * grid.own_means(np.sin(w * time))
    np.testing.assert_allclose(bend[inner], expected[inner], atol=0.02 * (w / unit) ** 2)
    expected = (w / unit) * grid.own_means(np.cos(w * time))
    np.testing.assert_allclose(rise[inner], expected[inner], atol=0.02 * w / unit)


def test_what_is_damped_as_much_as_may_be_is_a_lag_and_no_gear():
    coefficients = np.array([0.1, 0.05])
    assert Elasticity().plausible(coefficients, {"resonance_hz": 9.0, "damping": 0.2})
    assert not Elasticity().plausible(coefficients, {"resonance_hz": 9.0, "damping": 0.25})


@pytest.mark.parametrize("sign", [1.0, pytest.param(-1.0, marks=pytest.mark.long)])
def test_a_soft_gear_is_named_where_the_position_is_the_link_s(sign):
    """A current that lacks as much is rounded off, not wound up."""
    rate, window = 250.0, np.hanning(51) / np.hanning(51).sum()
    made = simulate(3, (), rate=rate, cycles=6)
    path = np.convolve(np.pad(made.position, 25, mode="edge"), window, mode="valid")
    v, a = np.gradient(path) * rate, np.gradient(np.gradient(path)) * rate**2
    bend = sign * np.gradient(np.gradient(a))
    moving = np.abs(v) > 0.02 * np.abs(v).max()
    current = 0.2 * a + np.sin(path) + 0.5 * np.sign(v) + 0.3 * v
    current += 0.1 / np.std(bend[moving]) * bend
    current += np.random.default_rng(7).normal(0, 0.02, v.size)
    _, loop = close_recording(replace(made, position=path), current)
    assert ("link" in [step.term.form for step in loop.steps]) == (sign > 0)
