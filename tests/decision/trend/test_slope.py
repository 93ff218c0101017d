"""Slope and forecast against another library and the truth."""

import numpy as np
import pytest
from scipy.stats import theilslopes

from opamc_cli.decision.trend.slope import (
    LEAST_NIGHTS,
    NORMAL_999,
    is_step,
    later_half,
    nights_until,
    robust_slope,
    slope_of_spread,
)


@pytest.mark.parametrize("seed", range(3))
def test_the_slope_is_that_of_theil_and_sen(seed):
    rng = np.random.default_rng(seed)
    nights = np.sort(rng.choice(60, 25, replace=False)).astype(float)
    values = 0.01 * nights + rng.normal(0, 0.05, 25)
    values[3] += 4
    found = robust_slope(nights, values)
    other = theilslopes(values, nights, 0.90)
    assert found is not None
    assert found.per_night == pytest.approx(other.slope)
    # which of two neighbouring slopes ends the interval is a matter of rounding
    pairs = np.triu_indices(25, 1)
    slopes = np.sort((values[pairs[1]] - values[pairs[0]]) / (nights[pairs[1]] - nights[pairs[0]]))
    for own, its in ((found.low, other.low_slope), (found.high, other.high_slope)):
        assert abs(np.searchsorted(slopes, own) - np.searchsorted(slopes, its)) <= 1


def test_the_forecast_holds_the_truth_in_nine_of_ten():
    inside = 0
    for seed in range(400):
        rng = np.random.default_rng([7, seed])
        nights = np.arange(20.0)
        found = robust_slope(nights, 0.1 + 0.01 * nights + rng.normal(0, 0.02, 20))
        assert found is not None
        low, high = nights_until(found, 0.5) or (np.inf, np.inf)
        inside += low <= (0.5 - (0.1 + 0.01 * 19)) / 0.01 <= high
    assert 0.8 <= inside / 400 <= 0.97


def test_wear_that_quickens_is_forecast_by_its_later_nights():
    """A straight line through all nights comes too late; 0.5 is reached 7 nights after the last."""
    straight = quickened = 0
    nights = np.arange(24.0)
    for seed in range(200):
        rng = np.random.default_rng(seed)
        values = 0.05 + 0.45 * (nights / 30) ** 1.5 + rng.normal(0, 0.03, 24)
        found = robust_slope(nights, values)
        lately = robust_slope(later_half(nights), later_half(values))
        assert found is not None
        low, high = nights_until(found, 0.5, lately) or (np.inf, np.inf)
        quickened += np.floor(low) <= 7 <= high
        straight += np.floor((nights_until(found, 0.5) or (np.inf,))[0]) <= 7
    assert straight / 200 < 0.1
    assert quickened / 200 > 0.85


def test_the_later_half_is_of_six_nights_at_least():
    assert [later_half(np.arange(float(n))).tolist() for n in (5, 9, 13)] == [
        [0.0, 1.0, 2.0, 3.0, 4.0],
        [3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        [6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0],
    ]


def test_what_does_not_grow_has_no_forecast():
    nights = np.arange(20.0)
    flat = robust_slope(nights, np.random.default_rng(3).normal(0.1, 0.02, 20))
    assert flat is not None
    assert nights_until(flat, 0.5) is None
    assert nights_until(flat, 0.01) == (0.0, 0.0)
    assert robust_slope(nights[: LEAST_NIGHTS - 1], nights[: LEAST_NIGHTS - 1]) is None


def test_a_slope_and_its_interval_by_hand():
    """Sen's interval of six nights: 15 slopes, and 9 of them either side of the middle."""
    nights, values = np.arange(6.0), np.array([0.0, 1.0, 4.0, 9.0, 16.0, 25.0])
    slopes = np.sort([a + b for a in range(6) for b in range(a)])
    found = robust_slope(nights, values)
    reach = 1.6449 * np.sqrt(6 * 5 * 17 / 18)
    low, high = int((15 - reach) / 2), int(np.ceil((15 + reach) / 2))
    assert (low, high) == (3, 12)
    assert (found.per_night, found.low, found.high) == (5.0, slopes[low], slopes[high])
    assert (found.middle, found.age) == (np.median(values - 5 * (nights - 2.5)), 2.5)
    assert found.level == found.middle + 12.5
    assert robust_slope(nights[:5], values[:5]) is None
    # what does not grow for sure is no growth
    still = robust_slope(nights, np.array([0.0, 0, 0, 0, 0, 1]))
    assert still.low == 0
    assert not still.clear
    assert nights_until(still, 9.0) is None
    assert nights_until(found, found.level) == (0.0, 0.0)


def test_few_nights_have_a_slope_where_it_is_known_how_much_nights_differ():
    rng = np.random.default_rng(2)
    nights = np.array([0.0, 1.0, 3.0, 4.0])
    inside = 0
    for _ in range(400):
        values = 0.1 * nights + rng.normal(0, 0.05, 4)
        found = slope_of_spread(nights, values, 0.05)
        assert (found.per_night, found.level) == pytest.approx(
            (np.polyfit(nights, values, 1)[0], np.polyval(np.polyfit(nights, values, 1), 4.0))
        )
        inside += found.low <= 0.1 <= found.high
    assert 0.86 <= inside / 400 <= 0.94
    assert slope_of_spread(nights[:2], nights[:2], 0.05) is None


def test_what_came_at_once_is_a_step_until_more_has_come_since():
    nights = np.arange(12.0)
    for leap, grown, step in ((1.0, 0.2, True), (1.0, 1.2, False), (0.2, 0.0, False)):
        slope = robust_slope(nights, leap + grown * nights / 11)
        assert slope is not None
        assert is_step(slope, before=0.0, spread=0.13, span=11.0) is step


def test_a_surer_interval_is_wider():
    values = np.arange(20.0) + np.random.default_rng(1).normal(0, 3, 20)
    usual, sure = (robust_slope(np.arange(20.0), values, of) for of in (1.6449, NORMAL_999))
    assert usual is not None
    assert sure is not None
    assert sure.low < usual.low < usual.per_night == sure.per_night < usual.high < sure.high
