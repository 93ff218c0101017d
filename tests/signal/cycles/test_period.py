"""The lag at which paths repeat themselves."""

import numpy as np
import pytest

from opamc_cli.signal.cycles.period import _mismatch, cycle_length


def test_cycle_is_the_lag_at_which_the_path_repeats():
    rng = np.random.default_rng(3)
    cycle = np.convolve(rng.normal(size=1234), np.hanning(101), mode="same")
    assert cycle_length(np.tile(cycle, 5)) == 1234


def test_a_path_that_never_repeats_has_no_cycle():
    rng = np.random.default_rng(3)
    assert cycle_length(np.convolve(rng.normal(size=9000), np.hanning(101), "same")) is None


def test_a_motion_repeats_in_what_is_known_of_it():
    rng = np.random.default_rng(3)
    path = np.tile(np.convolve(rng.normal(size=500), np.hanning(101), mode="same"), 5)
    known = np.arange(path.size) % 500 > 60
    # Where the current was too small, one cycle's motion was guessed wrongly.
    path[1000:1061] += 10 * path.std()
    assert cycle_length(path) != 500
    assert cycle_length(path, known=known) == 500
    assert cycle_length(path, known=np.zeros(path.size, dtype=bool)) is None


def test_the_mismatch_is_that_of_the_pairs_that_are_known():
    rng = np.random.default_rng(4)
    path, known = rng.normal(size=90), rng.random(90) < 0.8
    found = _mismatch(path, known)
    for lag in range(0, 80, 7):
        both = known[: 90 - lag] & known[lag:]
        square = (path[lag:] - path[: 90 - lag])[both] ** 2
        assert found[lag] == pytest.approx(square.mean(), abs=1e-12)
    assert _mismatch(path, np.arange(90) < 40)[40] == np.inf


def test_several_joints_have_to_repeat_at_once():
    rng = np.random.default_rng(3)
    one, other = (np.convolve(rng.normal(size=n), np.hanning(51), "same") for n in (500, 750))
    assert cycle_length(np.tile(one, 9)) == 500
    assert cycle_length(np.tile(one, 9), np.tile(other, 6)) == 1500
    assert cycle_length(np.tile(one, 2), np.tile(other, 2)[:1000]) is None
    assert cycle_length(np.tile(one, 9), np.zeros(4500)) is None
