"""What a joint's own lines tell of its gear and motor."""

import numpy as np
import pytest

from opamc_cli.decision.measurement.gear import passing_rollers, told

RESOLUTION = 8.0


def spectra(lines, scale=1.0, sessions=5, seed=0):
    """Power over orders, as tall above noise as `lines` say, by order; as wide as a stroke's."""
    orders = np.arange(0.0, 700.0, RESOLUTION / 4)
    rng = np.random.default_rng(seed)
    noise = rng.gamma(4.0, 0.25, (sessions, orders.size))
    for order, times in lines.items():
        noise += times * np.exp(-(((orders - order) / (0.6 * RESOLUTION)) ** 2))
    return "joint" if scale == 1.0 else "electrical", scale * orders, noise, scale * RESOLUTION


@pytest.mark.parametrize("ratio", [50.0, 80.0, 100.4, 101.0, 121.0, 160.0])
def test_a_gears_ratio_is_told_by_twice_a_turn_of_its_wave_generator(ratio):
    found, poles = told(*spectra({2 * ratio: 40.0, 4 * ratio: 10.0 * (ratio > 82)}))
    assert found == pytest.approx(ratio, rel=0.01)
    assert poles is None


@pytest.mark.parametrize(
    "lines",
    [
        {},
        {202.0: 3.0},  # no more than noise may do
        {288.0: 40.0},  # of no usual gear
        {202.0: 40.0, 290.0: 90.0},  # another line stands out more
        {160.0: 40.0, 320.0: 20.0},  # 80, or 160 and its rotor
        {160.0: 20.0, 320.0: 40.0},
    ],
)
def test_a_line_that_may_be_anothers_tells_no_ratio(lines):
    assert told(*spectra(lines)) == (None, None)


def test_a_rotors_faint_line_hides_no_ratio():
    found, _ = told(*spectra({101.0: 12.0, 202.0: 150.0}))
    assert found == pytest.approx(101.0, rel=0.01)


@pytest.mark.parametrize("poles", [3, 4, 5, 7])
def test_pole_pairs_are_told_likewise(poles):
    # the sensors' own lines are at one and two a period
    lines = {2 / poles / 0.004: 40.0, 1 / 0.004: 90.0, 2 / 0.004: 90.0}
    assert told(*spectra(lines, 0.004)) == (None, poles)


@pytest.mark.parametrize(
    ("orders", "pair"),
    [
        ([9.62, 1.98, 11.62], (0, 2)),
        ([9.37, 7.37], (0, 1)),
        ([2.02, 4.04, 6.06, 8.08], None),  # the mesh's
        ([7.0, 5.0], None),  # whole ones
        ([9.37, 11.9], None),
        ([6.06, 4.04, 8.1], None),  # the mesh's, as the flexspline turns
        ([29.37, 27.37], None),  # a structure's that rings
        ([9.37], None),
        ([], None),
    ],
)
def test_a_bearings_lines_are_odd_and_two_apart(orders, pair):
    assert passing_rollers(orders, 0.05, 100.0) == pair
    assert passing_rollers(orders, 0.05, None) == pair
