"""A track is averaged and cut inside each recording, and never over a border."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from opamc_cli.joint.motion.kinematics import Recording
from opamc_cli.joint.motion.recordings import grouped_track
from opamc_cli.joint.motion.track import (
    Joint,
    Reference,
    averaged,
    block_mean,
    coarsen,
    excerpt,
)

BOUNDS = ((0, 7), (7, 18))


def track_of(runs=2, rate=200.0, **more):
    time = np.arange(1000) / rate
    place = np.sin(2.0 * time)
    recordings = [
        Recording(f"run {k}", rate, current_a=np.cos(2.0 * time) + k, position_rad=place, **more)
        for k in range(runs)
    ]
    return grouped_track(recordings, Joint())[0]


def test_blocks_end_with_their_recording():
    values = np.arange(18.0)
    assert block_mean(values, BOUNDS, 1) is values
    np.testing.assert_array_equal(block_mean(values, BOUNDS, 3), [1, 4, 8, 11, 14])
    pairs = np.stack([values, -values], axis=1)
    np.testing.assert_array_equal(block_mean(pairs, BOUNDS, 5)[:, 1], [-2, -9, -14])
    assert block_mean(values, BOUNDS, 9).tolist() == [11]


@pytest.mark.parametrize("width", [1, 3, 5])
def test_a_moving_average_keeps_the_last_value_at_both_ends(width):
    rng = np.random.default_rng(0)
    values = rng.normal(size=(18, 2))
    kernel = rng.random(width)
    kernel = (kernel + kernel[::-1]) / kernel.sum() / 2
    half = width // 2
    slow = np.empty_like(values)
    for start, stop in BOUNDS:
        for i in range(start, stop):
            near = np.clip(np.arange(i - half, i + half + 1), start, stop - 1)
            slow[i] = kernel @ values[near]
    np.testing.assert_allclose(averaged(values, BOUNDS, kernel), slow, atol=1e-12)


def test_a_reference_stands_for_what_moving_samples_reach():
    track = track_of(1, temperature_c=np.linspace(20, 30, 1000))
    speeds = np.abs(track.velocity[track.moving])
    assert track.speed_scale == np.quantile(speeds, 0.95)
    assert track.middle_temperature_c == pytest.approx(track.temperature_c[track.moving].mean())
    told = replace(track, reference=Reference(7.0, 40.0))
    assert (told.speed_scale, told.middle_temperature_c) == (7.0, 40.0)
    half_told = replace(track, reference=Reference(7.0, None))
    assert half_told.middle_temperature_c == track.middle_temperature_c
    assert track_of(1).middle_temperature_c == 0.0


def test_a_block_moves_and_is_clear_if_all_of_its_samples_are():
    track = track_of()
    moving, clear = np.ones(2000, dtype=bool), np.ones(2000, dtype=bool)
    moving[5], clear[13] = False, False
    group = np.repeat([0, 1, 2, 3], 500)
    group[498:500] = 1
    track = replace(track, moving=moving, clear=clear, group=group)
    coarse = coarsen(track, 4)
    assert coarse.rate_hz == 50.0
    assert coarse.bounds == ((0, 250), (250, 500))
    assert np.flatnonzero(~coarse.moving).tolist() == [1, 124]
    assert np.flatnonzero(~coarse.clear).tolist() == [3]
    # of two groups: none
    assert coarse.group[[0, 123, 124, 125, 499]].tolist() == [0, 0, -1, 1, 3]
    smooth = averaged(track.current_a, track.bounds, track.kernel)
    np.testing.assert_array_equal(coarse.full.current_a, smooth)
    np.testing.assert_array_equal(coarse.current_a, block_mean(smooth, track.bounds, 4))
    even = coarsen(replace(track, evenly_smooth=True), 4)
    np.testing.assert_array_equal(even.full.velocity, track.velocity)
    assert not np.array_equal(coarse.full.velocity, track.velocity)


def test_spans_become_recordings_of_their_own():
    track = replace(track_of(), group=np.repeat([0, 1], 1000))
    inside = np.zeros(2000, dtype=bool)
    inside[120:1100] = True
    cut = excerpt(track, inside, ((100, 300), (1050, 1200)))
    assert cut.bounds == ((0, 200), (200, 350))
    np.testing.assert_array_equal(cut.current_a[:200], track.current_a[100:300])
    np.testing.assert_array_equal(cut.time_s[200:], track.time_s[1050:1200])
    assert cut.group[[0, 19, 20, 199, 200, 249, 250]].tolist() == [-1, -1, 0, 0, 1, 1, -1]


def test_the_static_terms_are_summed_from_zero_in_each_recording():
    track = track_of()
    assert track.static_columns.shape == (track.size, 0)
    term = SimpleNamespace(
        columns=lambda on: np.stack([on.velocity, on.position_rad], axis=1),
        key="motion",
        is_constant=True,
    )
    track = replace(track, static_terms=(term,))
    assert track.static_sums.shape == (2002, 2)
    assert (track.static_sums[[0, 1001]] == 0).all()
    columns = track.static_columns
    np.testing.assert_allclose(track.static_sums[2001], columns[1000:].sum(axis=0), rtol=1e-9)
    coarse = coarsen(track, 5).with_model(track.velocity, 2 * track.velocity, (term,))
    means = block_mean(coarse.full_columns, track.bounds, 5)
    np.testing.assert_allclose(coarse.static_columns, means)
    np.testing.assert_allclose(coarse.load_a, block_mean(track.velocity, track.bounds, 5))
    np.testing.assert_array_equal(coarse.full.model_a, 2 * track.velocity)
    coarse.forget()
    assert not {"full_columns", "static_columns", "static_sums"} & set(vars(coarse))


def test_static_regressors_are_laid_once_unless_they_follow_the_model():
    track, asked = coarsen(track_of(), 5), []

    def term(name, is_constant):
        def columns(on):
            asked.append(name)
            return (on.velocity if is_constant else on.load_a)[:, None]

        return SimpleNamespace(columns=columns, key=name, is_constant=is_constant)

    terms = (term("motion", True), term("load", False))
    for size in (1.0, 2.0):
        load = size * np.ones(2000)
        track = track.with_model(load, load, terms)
        means = np.column_stack(
            [block_mean(track.full.velocity, track.full.bounds, 5), size * np.ones(400)]
        )
        np.testing.assert_allclose(track.static_columns, means)
    assert asked == ["motion", "load", "load"]


def test_a_loads_inertia_is_told_beside_weight_and_springs_and_what_tells_it_stays():
    track = track_of()
    track = replace(track, acceleration=np.random.default_rng(8).normal(size=track.size))
    weight = np.sin(track.position_rad) - 0.3 * track.position_rad + 0.2
    for inertia in (0.0, 1.5):
        load = inertia * track.acceleration + weight
        loaded = track.with_model(load, load, ())
        places, weights = loaded.inertia_weights
        assert weights @ load[places] == pytest.approx(inertia, abs=1e-6)
        assert loaded.inertia_weights is track.inertia_weights
        assert loaded.speed_scale == track.speed_scale
