"""The course of a current, and what a slow reported current says of itself."""

from itertools import pairwise

import numpy as np
import pytest

from opamc_cli.signal.course import mean_course
from opamc_cli.signal.motion.reported import fluctuation_frequency
from opamc_cli.signal.motion.signs import lacks_sign, signed_by_speed
from opamc_cli.signal.quality import clipped_share


@pytest.mark.parametrize(("n", "parts"), [(64, 8), (65, 8), (7, 8), (100, 33)])
def test_every_sample_counts_once_in_equal_parts(n, parts):
    x = np.random.default_rng(n).normal(size=n)
    m = min(parts, n // 2)
    edges = [-(-k * n // m) for k in range(m + 1)]
    slow = [x[a:b].mean() for a, b in pairwise(edges)]
    np.testing.assert_allclose(mean_course(x, parts), slow)


def test_unknown_samples_are_passed_over_and_a_part_without_any_is_unknown():
    x = np.arange(8.0)
    x[[0, 4, 5]] = np.nan
    np.testing.assert_array_equal(mean_course(x, 4), [1.0, 2.5, np.nan, 6.5])
    assert not mean_course(x[:1], 4).size


@pytest.mark.parametrize("frequency_hz", [0.8, 2.0, 5.0])
def test_fluctuations_tell_their_frequency(frequency_hz):
    time = np.arange(400) / 50
    x = 3 + 0.2 * time + np.sin(2 * np.pi * frequency_hz * time)
    assert fluctuation_frequency(x, 50.0) == pytest.approx(frequency_hz, rel=0.3)


def speed_and_friction(load):
    v = np.concatenate([np.zeros(50), np.ones(100), np.zeros(50), -np.ones(100), np.zeros(50)])
    return v, 0.8 * np.sign(v) + 0.1 * v + load


@pytest.mark.parametrize("load", [0.0, 0.3])
def test_an_unsigned_current_gets_its_sign_from_the_speed(load):
    v, current = speed_and_friction(load)
    assert lacks_sign(np.abs(current), v) is True
    found = signed_by_speed(np.abs(current), v)
    np.testing.assert_allclose(found[v != 0], current[v != 0])


@pytest.mark.parametrize("load", [0.0, 3.0, -3.0])
def test_a_current_that_has_its_sign_keeps_it(load):
    v, current = speed_and_friction(load)
    assert lacks_sign(current, v) is False


def test_a_joint_that_never_rests_does_not_tell_a_load_from_a_lost_sign():
    v = np.sign(np.sin(np.arange(400) / 20))
    assert lacks_sign(np.abs(0.8 * v), v) is None
    assert lacks_sign(0.8 * v, v) is False
    assert lacks_sign(np.full(400, 0.8), np.ones(400)) is False


def test_a_current_that_rests_at_zero_is_not_clipped():
    rng = np.random.default_rng(0)
    x = np.concatenate([np.zeros(500), np.abs(rng.normal(1, 0.2, 500))])
    assert clipped_share(x) == 0.0
    assert clipped_share(np.minimum(x, 1.0)) > 0.1
