"""Where a motion begins and ends, on vectors whose first and last turn are known."""

import numpy as np
import pytest

from opamc_cli.signal.motion.boundaries import refine_boundaries

FS_HZ = 2000.0
BEGIN, END, N = 1000, 3000, 4000


def vector(torque=2.0, hold=1.0, noise=0.0, seed=0):
    """A vector that stands, speeds up at constant acceleration, slows down, and stands again."""
    t = np.arange(N)
    moving = (t >= BEGIN) & (t < END)
    speed = np.where(moving, np.minimum(t - BEGIN, END - t) / 1000 * 60.0, 0.0)
    size = np.where(moving, torque, hold)
    angle = 0.7 + 2 * np.pi * np.cumsum(speed) / FS_HZ
    rng = np.random.default_rng(seed)
    return size * np.exp(1j * angle) + noise * (
        rng.standard_normal(N) + 1j * rng.standard_normal(N)
    )


@pytest.mark.parametrize("hold", [1.0, -1.0, 0.5, 0.31, 0.29])
@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_both_ends_are_found_within_milliseconds(hold, noise):
    """A torque that changes its sign turns the vector about, which is no turn of the motor."""
    start, stop = refine_boundaries(vector(hold=hold, noise=noise), 1200, 2800, FS_HZ, noise)
    # a current at rest of less than 0.15 of the motion's is not followed by its angle
    assert abs(start - (BEGIN if abs(hold) > 0.3 else BEGIN - 3)) <= 1
    assert abs(stop - (END if abs(hold) > 0.3 else END + 3)) <= 1


def test_what_is_true_forwards_is_true_backwards():
    z = vector(noise=0.02)
    start, stop = refine_boundaries(z, 1200, 2800, FS_HZ, 0.02)
    assert refine_boundaries(z[::-1], N - 2800, N - 1200, FS_HZ, 0.02) == (N - stop, N - start)


def test_without_current_at_rest_the_motion_begins_where_the_current_does():
    start, stop = refine_boundaries(vector(hold=0.0), 1200, 2800, FS_HZ, 1e-3)
    assert (start, stop) == (BEGIN - 3, END + 3)


def test_boundaries_move_outwards_only_and_stay_without_rest_to_compare_with():
    z = vector(noise=0.02)
    for coarse in ((1010, 2990), (1100, 2900), (1400, 2600)):
        start, stop = refine_boundaries(z, *coarse, FS_HZ, 0.02)
        assert start <= coarse[0]
        assert stop >= coarse[1]
    # ten samples of standstill are less than what the mean of a hundred of them needs
    assert refine_boundaries(z[990:3010], 30, 1990, FS_HZ, 0.02) == (30, 1990)


def test_a_carrier_that_is_lost_at_speed_brakes_as_it_accelerated():
    """No torque holds the joint, and friction alone slows it down: the current is gone before."""
    z = vector(hold=0.0)
    lost = 2500
    z[lost:] = 0.0
    start, stop = refine_boundaries(z, 1200, lost, FS_HZ, 1e-3, n_to_f_last=300)
    assert stop == lost + (1200 + 300 - start)
    held = vector(hold=1.0)
    assert (
        refine_boundaries(held, 1200, 2800, FS_HZ, 0.0, n_to_f_last=300)[1]
        == (refine_boundaries(held, 1200, 2800, FS_HZ, 0.0)[1])
    )


def test_a_single_phase_leaves_its_standstill_value():
    rng = np.random.default_rng(3)
    current = vector(noise=0.0).real + 0.01 * rng.standard_normal(N)
    start, stop = refine_boundaries(current, 1200, 2800, FS_HZ, 0.01)
    assert abs(start - BEGIN) <= 4
    assert abs(stop - END) <= 4


@pytest.mark.parametrize("hold", [0.0, 1.0])
def test_a_torque_that_passes_its_standstill_value_does_not_stay(hold):
    """A quarter of a hundred milliseconds at rest is a rest, less is none."""
    for n_stay, stays in ((40, False), (60, True)):
        z = vector(hold=hold).real if hold else vector(hold=hold)
        z[1100 : 1100 + n_stay] = z[0]
        start, _ = refine_boundaries(z, 1200, 2800, FS_HZ, 0.0)
        assert (start > 1090) is stays


FOUND = {
    (1.0, 0, 0.1): (0, 0, 2, 2, 39, -39, 2, 2),
    (1.0, 0, 0.4): (0, 0, 95, -4, 40, -40, 40, -4),
    (1.0, 0, 1.0): (105, -71, 126, -169, 40, -40, 40, -40),
    (1.0, 940, 0.1): (7, 0, -2, -11, 40, -39, -2, -11),
    (1.0, 940, 0.4): (6, 0, 2, -154, 40, -40, 2, -40),
    (1.0, 940, 1.0): (4, -114, 116, -177, 33, -40, 40, -40),
    (0.4, 0, 0.1): (0, 0, -1, 2, 40, -40, -1, 2),
    (0.4, 0, 0.4): (1, 1, 109, -1, 1, 1, 5, -1),
    (0.4, 0, 1.0): (100, -4, 140, -175, 40, -4, 40, -40),
    (0.4, 940, 0.1): (9, 0, -2, 1, 40, -40, -3, 1),
    (0.4, 940, 0.4): (7, -2, 0, -30, -1, -2, 0, -30),
    (0.4, 940, 1.0): (4, -121, 125, -189, 3, -40, 40, -40),
    (0.05, 0, 0.1): (-2, 3, -2, 3, -2, 3, -2, 3),
    (0.05, 0, 0.4): (0, 1, 117, 0, 0, 1, 2, 0),
    (0.05, 0, 1.0): (55, -2, 151, -179, 40, -2, 40, -40),
    (0.05, 940, 0.1): (9, 2, -3, 2, -3, 2, -3, 2),
    (0.05, 940, 0.4): (7, 0, 0, -3, -1, 0, 0, -3),
    (0.05, 940, 1.0): (5, -118, 130, -200, 2, -40, 40, -40),
}
"""By current at rest, samples cut off before, and noise said to be in it: how late start and stop
are found from two coarse starts and stops, in the vector and in one phase, samples."""


@pytest.mark.parametrize(("hold", "cut", "noise_a"), FOUND)
def test_boundaries_of_an_uneven_torque_to_the_sample(hold, cut, noise_a):
    k = np.arange(N - cut)
    # as uneven as noise, and the same on every machine
    uneven = np.modf(k * 0.6180339887)[0] - 0.5 + 1j * (np.modf(k * 0.7548776662)[0] - 0.5)
    z = vector(torque=1.0, hold=0.0)[cut:] * (2.0 + 0.8 * np.sin(k / 190)) + 0.02 * uneven
    z += vector(torque=0.0, hold=hold)[cut:]
    found = [
        refine_boundaries(part(z), start - cut, stop - cut, FS_HZ, noise_a)
        for start, stop in ((1200, 2800), (1040, 2960))
        for part in (np.asarray, np.real)
    ]
    late = [(start + cut - BEGIN, stop + cut - END) for start, stop in found]
    assert np.ravel(late) == pytest.approx(FOUND[hold, cut, noise_a], abs=1)


def test_a_current_that_still_rests_at_the_coarse_boundary_moves_none():
    zero = np.zeros(N)
    assert refine_boundaries(zero + 0j, 1200, 2800, FS_HZ, 0.0) == (1200, 2800)
    # what comes after the boundary is not smoothed into the standstill before it
    zero[1200:2800] = 1.0
    assert refine_boundaries(zero, 1200, 2800, FS_HZ, 0.0) == (1200, 2800)


def test_the_way_of_turning_is_that_of_the_tenth_of_a_second_after_the_coarse_boundary():
    t = np.arange(N)
    forth = np.where((t >= BEGIN) & (t < 1500), (t - BEGIN) / 1000 * 60.0, 0.0)
    z = np.exp(2j * np.pi * np.cumsum(forth - 60.0 * (t >= 1500)) / FS_HZ)
    start, _ = refine_boundaries(z, 1200, 2800, FS_HZ, 0.0)
    assert abs(start - BEGIN) <= 1
