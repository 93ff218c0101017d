"""Single samples far from their neighbours."""

import numpy as np
import pytest

from opamc_cli.signal.plausible.spikes import spikes


@pytest.fixture
def current():
    t = np.arange(5000) / 500
    strokes = np.sign(np.sin(2 * np.pi * 0.3 * t)) + 0.5 * np.sin(2 * np.pi * 0.3 * t)
    return strokes + 0.02 * np.random.default_rng(0).normal(size=t.size)


def test_noise_and_reversals_hold_none(current):
    assert spikes(current).size == 0
    assert spikes(np.round(current / 0.1) * 0.1).size == 0
    assert spikes(np.zeros(100)).size == 0
    assert spikes(np.arange(2.0)).size == 0


def test_single_samples_are_found_and_two_are_chance(current):
    places = [300, 1700, 4100]
    current[places] += [2.0, -1.5, 3.0]
    current[2000:2100] = np.nan
    assert spikes(current).tolist() == places
    current[300] -= 2.0
    assert spikes(current).size == 0


def test_what_lasts_for_two_samples_is_no_spike(current):
    for place in (300, 1700, 4100, 4500):
        current[place : place + 2] += 2.0
    assert spikes(current).size == 0
