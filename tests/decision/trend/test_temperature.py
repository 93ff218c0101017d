"""What the weather does to a course, taken off where it is sure."""

import numpy as np
import pytest

from opamc_cli.decision.trend.temperature import LEAST_NIGHTS, without_temperature

NIGHTS = np.arange(30.0)


def drawn(seed):
    rng = np.random.default_rng(seed)
    season = 5 * np.sin(NIGHTS / 20)
    return 20 + season + rng.normal(0, 3, 30), rng.normal(0, 0.01, 30)


@pytest.mark.parametrize("seed", range(5))
def test_what_a_degree_does_is_taken_off_and_the_wear_stays(seed):
    warmth, noise = drawn(seed)
    wear = 0.02 * NIGHTS
    found = without_temperature(NIGHTS, wear + 0.03 * (warmth - 18) + noise, warmth, 18.0)
    assert found == pytest.approx(wear, abs=0.06)
    # least squares of all three at once, as a slow and plain twin
    others = np.c_[np.ones(30), NIGHTS, warmth - 18]
    degree = np.linalg.lstsq(others, wear + 0.03 * (warmth - 18) + noise)[0][2]
    twin = wear + (0.03 - degree) * (warmth - 18) + noise
    assert found == pytest.approx(twin, abs=0.03)


def test_nights_without_a_temperature_stay():
    warmth, noise = drawn(1)
    warmth[4] = np.nan
    values = 0.03 * np.where(np.isfinite(warmth), warmth, 20) + noise
    found = without_temperature(NIGHTS, values, warmth, 20.0)
    assert found[4] == values[4]
    assert np.std(found) < 0.3 * np.std(values)


def test_what_is_not_sure_is_not_taken_off():
    warmth, noise = drawn(2)
    for degrees in (
        np.full(30, np.nan),
        np.full(30, 20.0),  # logged, and always the same
        20 + 0.1 * np.sin(NIGHTS),
        np.where(NIGHTS < LEAST_NIGHTS - 1, warmth, np.nan),
    ):
        values = 0.02 * NIGHTS + np.where(np.isfinite(degrees), 0.03 * degrees, 0) + noise
        assert without_temperature(NIGHTS, values, degrees, 20.0) is values
    kept = [
        without_temperature(NIGHTS, noise, drawn(seed)[0], 20.0) is noise for seed in range(3, 43)
    ]
    assert np.mean(kept) > 0.75  # the interval is one of 90 %


def test_temperatures_in_whole_degrees_are_no_hindrance():
    warmth, noise = drawn(3)
    whole = np.round(warmth / 4) * 4
    found = without_temperature(NIGHTS, 0.03 * whole + noise, whole, 0.0)
    assert found == pytest.approx(np.zeros(30), abs=0.1)
