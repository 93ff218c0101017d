"""Lines of constant frequency are no colour of a noise."""

import numpy as np
import pytest
from closing import close_on

from opamc_cli.joint.narrow_lines import without_lines


def test_lines_are_taken_out_and_noise_is_left():
    rng = np.random.default_rng(1)
    time = np.arange(20_000) / 1000
    valid = time % 1.3 > 0.4
    noise = rng.normal(size=time.size)
    lines = 2.0 * np.cos(2 * np.pi * 49.97 * time) + np.sin(2 * np.pi * 150.1 * time + 0.3)
    left = without_lines(noise + lines, valid, 1000.0)
    assert not np.any(left[~valid])
    assert np.std((left - noise)[valid]) < 0.15


@pytest.mark.parametrize("slow", [False, True])
def test_noise_without_lines_stays_as_it_is(slow):
    noise = np.random.default_rng(2).normal(size=20_000)
    noise = np.cumsum(noise) if slow else noise
    valid = np.arange(noise.size) % 900 > 100
    np.testing.assert_array_equal(without_lines(noise, valid, 1000.0)[valid], noise[valid])


def test_hum_of_twice_the_noise_does_not_whiten_itself_away():
    # Two thirds of a period of the hum are left over in every cycle.
    made, loop = close_on(5, ("mains_hum",), ratio=2.0)
    assert [step.term.effect.name for step in loop.steps] == ["mains_hum"]
    found = loop.steps[0].term.parameters["frequency_hz"]
    assert found == pytest.approx(made.truth["frequency_hz"], abs=0.01)
