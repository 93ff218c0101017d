"""Leaving units out by subtracting sums, against refitting without them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opamc_cli.joint.fit.parts import FEWEST_UNITS, PARTS_PER_UNIT, Parts, parts_of
from opamc_cli.joint.fit.regressor_cache import RegressorCache


def random_parts(rng, units):
    """Shuffled rows of a grid, some parts of one sample, some of them not judged."""
    unit, sizes = [], []
    for number in range(units):
        for _ in range(int(rng.integers(1, 5))):
            unit.append(number)
            sizes.append(1 if rng.random() < 0.3 else int(rng.integers(2, 20)))
    stops = np.cumsum(sizes)
    slices = tuple((int(b - s), int(b)) for b, s in zip(stops, sizes, strict=True))
    rows = rng.permutation(int(stops[-1]) + 7)[: stops[-1]]
    return Parts(rows, slices, np.array(unit), rng.random(len(unit)) < 0.7)


def sums_of(columns, current, parts):
    return RegressorCache().sums([columns], current, parts, True)


def unit_of_rows(parts):
    return np.repeat(parts.unit, [stop - start for start, stop in parts.slices])


def fitted(columns, signal):
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-100)
    return np.linalg.lstsq(columns / scale, signal, rcond=1e-6)[0] / scale


def slow_held_out(columns, signal, parts):
    """Fit to all other units, predict each part."""
    columns, signal, unit = columns[parts.rows], signal[parts.rows], unit_of_rows(parts)
    errors = []
    for (start, stop), number in zip(parts.slices, parts.unit, strict=True):
        others = unit != number
        values = fitted(columns[others], signal[others])
        errors.append(np.sum((signal[start:stop] - columns[start:stop] @ values) ** 2))
    return np.array(errors)


def slow_without_drift(columns, signal, parts):
    """Likewise, with an offset for every half of a unit among the regressors."""
    columns, signal, unit = columns[parts.rows], signal[parts.rows], unit_of_rows(parts)
    half = np.concatenate(
        [
            np.full(b - a, 2 * number + (2 * place >= np.count_nonzero(parts.unit == number)))
            for number in range(parts.units)
            for place, (a, b) in enumerate(
                cut for cut, u in zip(parts.slices, parts.unit, strict=True) if u == number
            )
        ]
    )
    errors = []
    for number in np.unique(half):
        others, mine = unit != number // 2, half == number
        offsets = half[others][:, None] == np.unique(half[others])
        design = np.concatenate([columns[others], offsets], axis=1)
        values = fitted(design, signal[others])[: columns.shape[1]]
        rest = signal[mine] - columns[mine] @ values
        errors.append(np.sum((rest - rest.mean()) ** 2))
    return np.array(errors)


def drawn(seed, width, units):
    rng = np.random.default_rng(seed)
    parts = random_parts(rng, units)
    size = parts.rows.max() + 9
    columns = rng.normal(size=(size, width)) * 10.0 ** rng.integers(-4, 5, width)
    return rng, parts, columns, rng.normal(size=size)


SIZES = (st.integers(0, 10_000), st.integers(1, 4), st.integers(8, 11))


@settings(max_examples=40)
@given(*SIZES)
def test_leaving_units_out_equals_refitting(seed, width, units):
    _, parts, columns, signal = drawn(seed, width, units)
    fast = sums_of(columns, signal, parts).held_out()
    np.testing.assert_allclose(fast, slow_held_out(columns, signal, parts), rtol=1e-6, atol=1e-9)


@settings(max_examples=30)
@given(*SIZES)
def test_collinear_columns_and_empty_ones_change_no_error(seed, width, units):
    _, parts, columns, signal = drawn(seed, width, units)
    twice = np.concatenate([columns, 3 * columns[:, :1], np.zeros_like(columns[:, :1])], axis=1)
    fast = sums_of(twice, signal, parts).held_out()
    np.testing.assert_allclose(fast, slow_held_out(columns, signal, parts), rtol=1e-5, atol=1e-9)


def test_what_one_unit_alone_excites_has_no_coefficient_from_elsewhere():
    _, parts, columns, signal = drawn(3, 3, 9)
    alone = parts.unit == 4
    columns[parts.rows[unit_of_rows(parts) != 4], 0] *= 1e-9
    fast = sums_of(columns, signal, parts).held_out()
    with_it = slow_held_out(columns, signal, parts)
    without_it = slow_held_out(columns[:, 1:], signal, parts)
    np.testing.assert_allclose(fast[~alone], with_it[~alone], rtol=1e-6)
    np.testing.assert_allclose(fast[alone], without_it[alone], rtol=1e-6)


def test_a_model_of_nothing_leaves_the_current():
    _, parts, columns, signal = drawn(1, 2, 8)
    power = [np.sum(signal[parts.rows][a:b] ** 2) for a, b in parts.slices]
    np.testing.assert_allclose(sums_of(columns[:, :0], signal, parts).held_out(), power)


@settings(max_examples=30)
@given(*SIZES)
def test_a_known_regressor_is_taken_out_of_the_current(seed, width, units):
    rng, parts, columns, signal = drawn(seed, width, units)
    extra = rng.normal(size=(signal.size, 1))
    fast = sums_of(np.concatenate([columns, extra], axis=1), signal, parts).less_last()
    slow = sums_of(columns, signal - extra[:, 0], parts)
    for name in ("gram", "moment", "power"):
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), rtol=1e-7, atol=1e-7)


@settings(max_examples=30)
@given(*SIZES)
def test_drift_is_an_offset_for_every_half_of_a_unit(seed, width, units):
    _, parts, columns, signal = drawn(seed, width, units)
    signal += 50 * np.arange(signal.size) / signal.size
    with_ones = np.concatenate([columns, np.ones((signal.size, 1))], axis=1)
    fast = sums_of(with_ones, signal, parts).without_drift(parts.halves).held_out()
    slow = slow_without_drift(columns, signal, parts)
    np.testing.assert_allclose(fast, slow, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("groups", "units"), [(1, 8), (2, 8), (3, 9), (5, 10), (8, 8), (11, 11)])
def test_few_groups_are_cut_until_there_are_eight_units(groups, units):
    clear = np.ones(groups * 100, dtype=bool)
    clear[::7] = False
    rows = [np.arange(k * 100, k * 100 + 90) for k in range(groups)]
    parts = parts_of([*rows, np.arange(0)], clear)
    assert parts.units == units >= FEWEST_UNITS
    np.testing.assert_array_equal(np.sort(parts.rows), np.concatenate(rows))
    assert np.bincount(parts.unit[parts.judged]).tolist() == [PARTS_PER_UNIT] * units
    for (start, stop), judged in zip(parts.slices, parts.judged, strict=True):
        members = parts.rows[start:stop]
        assert np.all(clear[members] == judged)
        assert np.ptp(members // 100) == 0


def test_a_group_of_two_samples_gives_units_of_one():
    rows = [np.array([3, 4]), np.arange(10, 90)]
    parts = parts_of(rows, np.ones(100, dtype=bool))
    assert parts.units == 6
    np.testing.assert_array_equal(parts.rows[:2], [3, 4])


def test_what_is_an_offset_in_every_half_has_no_part_beside_the_offsets():
    rng = np.random.default_rng(4)
    rows = [np.arange(k * 40, k * 40 + 40) for k in range(8)]
    parts = parts_of(rows, np.ones(320, dtype=bool))
    half = np.repeat(parts.halves, [stop - start for start, stop in parts.slices])
    steps = rng.normal(size=half.max() + 1)[half]
    ramp, ones = rng.normal(size=320), np.ones(320)
    current = 2 * ramp + 5 * steps + 0.1 * rng.normal(size=320)
    plain = sums_of(np.stack([ramp, ones], axis=1), current, parts).without_drift(parts.halves)
    beside = sums_of(np.stack([ramp, steps, ones], axis=1), current, parts).without_drift(
        parts.halves
    )
    np.testing.assert_allclose(beside.held_out(), plain.held_out(), rtol=1e-9)


@pytest.mark.parametrize(
    ("stroke", "stretches"),
    [
        (40, 8),  # a unit is one stroke: two of them move both ways
        (10, 16),  # half a unit moves both ways
        (320, 16),  # nothing ever turns back
        (160, 16),  # one return is too few to tell a drift
    ],
)
def test_a_stretch_of_drift_moves_both_ways(stroke, stretches):
    """A half of one stroke took a friction that wears off for an offset that drifts."""
    rows = [np.arange(k * 20, k * 20 + 20) for k in range(16)]
    parts = parts_of(rows, np.ones(320, dtype=bool))
    direction = np.where(np.arange(320) // stroke % 2, -1.0, 1.0)
    found = parts.stretches(direction)
    if stretches == 16 and stroke > 10:
        np.testing.assert_array_equal(found, parts.halves)
        return
    rows = np.repeat(found, [stop - start for start, stop in parts.slices])
    assert np.all(np.diff(found) >= 0)
    for one in np.unique(found):
        ways = direction[rows == one]
        assert min(np.sum(ways > 0), np.sum(ways < 0)) >= 0.25 * ways.size
    sums = sums_of(np.ones((320, 1)), direction, parts).without_drift(found)
    assert sums.power.sum() > 0.7 * 320
    if stroke == 40:
        halves = sums_of(np.ones((320, 1)), direction, parts).without_drift(parts.halves)
        assert halves.power.sum() < 1e-6
