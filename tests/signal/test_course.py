"""The course of a current, and what a slow reported current says of itself."""

from itertools import pairwise

import numpy as np
import pytest

from opamc_cli.signal.course import mean_course, repeated_course
from opamc_cli.signal.motion.reported import fluctuation_frequency
from opamc_cli.signal.motion.signs import lacks_sign, signed_by_speed
from opamc_cli.signal.plausible.quality import clipped_share


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


def repeated(seed=0, units=4, samples=60):
    """Strokes forth and back of each unit, and a third kind that the last unit alone has."""
    rng = np.random.default_rng(seed)
    angle, unit, strokes = [], [], []
    for one in range(units):
        ways = [(0.0, 10.0), (10.0, 0.0), *([(0.0, 5.0)] if one == units - 1 else [])]
        for first, last in ways:
            inner = np.sort(rng.uniform(0, 1, samples - 2))
            strokes.append((len(angle), len(angle) + samples))
            angle += [first + (last - first) * place for place in (0.0, *inner, 1.0)]
            unit += [one] * samples
    return np.array(angle), strokes, np.array(unit), rng.normal(size=len(angle))


def test_a_repeated_course_is_that_of_the_source_s_other_units():
    """Beside the same polygon, fitted stroke by stroke with numpy's own interpolation."""
    angle, strokes, unit, values = repeated()
    values[5] = np.nan
    source, corners = unit < 2, np.arange(0.0, 12.1, 2.0)
    found = repeated_course(angle, values, strokes, unit, source, 2.0)
    assert np.flatnonzero(np.isnan(found)).tolist() == [5, *range(480, 540)]
    basis = np.stack([np.interp(angle, corners, one) for one in np.eye(corners.size)], axis=1)
    for number, (start, stop) in enumerate(strokes[:8]):
        others = np.zeros(angle.size, dtype=bool)
        for first, last in strokes[number % 2 : 4 : 2]:
            others[first:last] = unit[first] != unit[start]
        others &= np.isfinite(values)
        slow = basis @ np.linalg.lstsq(basis[others], values[others], rcond=None)[0]
        rows = np.arange(start, stop)[np.isfinite(values[start:stop])]
        np.testing.assert_allclose(found[rows], slow[rows], atol=1e-9)


def test_strokes_that_end_elsewhere_are_another_kind():
    angle, strokes, unit, _ = repeated(units=3)
    moved = angle + np.where(unit == 0, 0.02 * 10.0, 0.0)
    values = 1.0 * (unit == 0)
    assert np.nanmax(repeated_course(angle, values, strokes, unit, unit < 3, 2.0)) > 0.3
    assert np.nanmax(repeated_course(moved, values, strokes, unit, unit < 3, 2.0)) == 0


def test_of_a_ripple_of_whole_cycles_from_corner_to_corner_hardly_any_is_in_a_course():
    angle, strokes, unit, _ = repeated(samples=1000)
    slow, ripple = np.sin(0.5 * angle), np.sin(2 * np.pi * angle)
    for spacing, least, most in ((1.0, 0.0, 0.25), (0.1, 0.9, 1.1)):
        found = repeated_course(angle, slow + ripple, strokes, unit, unit < 4, spacing)
        known = np.isfinite(found)
        assert least <= np.std((found - slow)[known]) / np.std(ripple) < most


def test_what_hangs_on_corners_without_samples_is_not_known():
    angle, strokes, unit, values = repeated()
    values[(unit != 0) & (angle > 5.0)] = np.nan
    found = repeated_course(angle, values, strokes, unit, unit < 4, 1.0)
    assert np.isnan(found[(unit == 0) & (angle > 6.0)]).all()
    assert np.isfinite(found[(unit == 0) & (angle < 5.0)]).all()
