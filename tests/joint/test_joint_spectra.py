"""Lines over the angle and over time."""

from dataclasses import replace

import numpy as np
import pytest
from track_of import track_of

from opamc_cli.joint.spectra import (
    highest_folded,
    highest_order,
    line_power,
    order_lines,
    order_spectrum,
    standing_views,
)


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0, 7.0])
def test_order_peak_is_found_within_a_tenth_of_the_resolution(order):
    _, track = track_of()
    angle = order * track.machine_angle_rad
    signal = np.cos(angle + 0.3 * track.direction) + np.random.default_rng(1).normal(
        size=track.size
    )
    peak = order_lines(track, np.where(track.moving, signal, 0.0), 1)[0][0]
    travel = np.ptp(track.machine_angle_rad[track.moving])
    assert abs(peak - order) < 0.1 * 2 * np.pi / travel


def test_white_noise_has_no_order_peak():
    _, track = track_of()
    for seed in range(10):
        noise = np.random.default_rng(seed).normal(size=track.size)
        assert order_lines(track, np.where(track.moving, noise, 0.0), 1) == []


def test_the_highest_order_is_nine_tenths_of_two_samples_a_wave():
    _, track = track_of()
    step = np.median(np.abs(np.gradient(track.machine_angle_rad))[track.moving])
    assert highest_order(track) == pytest.approx(0.9 * np.pi / step)
    # 500 Hz: up to four times as high, where that is not above 500 Hz at the median speed
    assert highest_folded(track) == pytest.approx(500 / (0.45 * 500) * highest_order(track))
    assert track.order_resolution == pytest.approx(
        2 * np.pi / np.ptp(track.machine_angle_rad[track.moving])
    )
    still = replace(track, moving=np.zeros(track.size, dtype=bool))
    assert highest_order(still) == 0.0


def test_white_noise_has_a_power_of_one_in_each_class():
    _, track = track_of()
    noise = np.where(track.moving, np.random.default_rng(0).normal(size=track.size), 0.0)
    orders, power = order_spectrum(track, noise)
    assert np.mean(power[orders > 1]) == pytest.approx(4, rel=0.05)
    assert np.all(np.diff(orders) > 0)
    assert orders[-1] <= highest_order(track)
    few = np.where(np.arange(track.size) < 30, noise, 0.0)
    assert [values.size for values in order_spectrum(track, few)] == [0, 0]


def test_a_line_of_either_direction_alone_is_seen():
    _, track = track_of()
    wave = np.cos(7 * track.machine_angle_rad) * (track.direction > 0)
    peaks = order_lines(track, np.where(track.moving, wave, 0.0), 2)
    assert peaks[0][0] == pytest.approx(7.0, abs=0.1 * track.order_resolution)
    apart = [abs(a - b) for i, (a, _) in enumerate(peaks) for b, _ in peaks[:i]]
    assert not apart or min(apart) >= 1.4 * track.order_resolution


def test_frequency_is_that_of_the_clock_through_what_was_left_out():
    _, track = track_of()
    time = track.time_s + np.where(np.arange(track.size) < 1000, 0.0, 7.3)
    two = replace(track, time_s=time, bounds=((0, 1000), (1000, track.size)))
    wave = np.sin(2 * np.pi * 31.7 * time)
    frequency, power = line_power(two, [wave])
    assert frequency[np.argmax(power)] == pytest.approx(31.7, abs=0.03)
    # Over pauses far longer than what was recorded pieces are laid side by side.
    apart = replace(two, time_s=track.time_s + np.where(np.arange(track.size) < 1000, 0, 1e4))
    assert line_power(apart, [wave])[0].size < 4 * track.size
    noise = np.random.default_rng(1).normal(size=track.size)
    assert np.mean(line_power(track, [noise])[1]) == pytest.approx(1.0, rel=0.1)


def test_what_phases_pick_up_stands_still_in_their_frame():
    _, track = track_of()
    assert [turned for turned, _ in standing_views(track, track.current_a)] == [False]
    field = 40 * track.time_s**2
    phased = replace(track, electrical_rad=field, channels=track.channels | {"phases"})
    hum = np.cos(2 * np.pi * 50 * track.time_s - field)
    (_, plain), (turned, views) = standing_views(phased, hum)
    assert turned
    frequency, power = line_power(phased, views)
    assert frequency[np.argmax(power)] == pytest.approx(50.0, abs=0.2)
    assert power.max() > 5 * line_power(phased, plain)[1].max()
