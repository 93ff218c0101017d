"""The control chart against its definition, night by night."""

import numpy as np
import pytest

from opamc_cli.decision.trend.chart import (
    LIMIT,
    MAD_TO_SIGMA,
    MOST,
    USUAL_NIGHTS,
    USUAL_SPREAD,
    WEIGHT,
    control_chart,
)


def slow_chart(values, healthy, n_baseline):
    """The chart as its definition reads: every night from all nights before it, from scratch."""
    shifts, found = [], []
    for t in range(len(values)):
        found.append(np.nan)
        if np.isnan(values[t]):
            continue
        usual = [
            v for v, ok, a in zip(values[:t], healthy, found, strict=False) if ok and a <= LIMIT
        ]
        n, centre, spread = len(usual), 0.0, USUAL_SPREAD
        if n:
            median = np.median(usual)
            mad = MAD_TO_SIGMA * np.median(np.abs(np.array(usual) - median))
            centre = n * median / (n + n_baseline)
            variance = (USUAL_NIGHTS * USUAL_SPREAD**2 + n * mad**2) / (USUAL_NIGHTS + n)
            spread = np.sqrt(variance)
        shifts.append(np.clip((values[t] - centre) / spread, -MOST, MOST))
        weights = WEIGHT * (1 - WEIGHT) ** np.arange(len(shifts))[::-1]
        scale = np.sqrt(np.sum(weights**2) + 1 / (n_baseline + n + 1))
        found[t] = np.sum(weights * shifts) / scale
    return np.array(found)


def average(values, healthy=None):
    """The chart's average beside a baseline of six nights."""
    healthy = np.ones(len(values), dtype=bool) if healthy is None else healthy
    return control_chart(np.array(values, dtype=float), healthy, 6)


@pytest.mark.parametrize("seed", range(3))
def test_the_chart_is_its_definition(seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(0, 0.1, 60)
    values[rng.random(60) < 0.1] = np.nan
    values[40:] += 0.3
    healthy = rng.random(60) < 0.9
    expected = slow_chart(values, healthy, 6)
    assert np.nanmax(expected) > LIMIT
    np.testing.assert_allclose(average(values, healthy), expected, rtol=1e-9)


def test_no_night_of_the_chart_knows_the_future():
    values = np.random.default_rng(1).normal(0, 0.1, 50)
    whole = average(values)
    np.testing.assert_array_equal(average(values[:30]), whole[:30])


def test_a_small_shift_that_lasts_is_seen_and_one_odd_night_is_not():
    rng = np.random.default_rng(2)
    healthy = rng.normal(0.05, 0.08, 120)
    assert np.nanmax(average(healthy)) < LIMIT
    odd = healthy.copy()
    odd[70] += 5
    assert np.nanmax(average(odd)) < LIMIT
    worn = healthy.copy()
    worn[80:] += 0.2
    assert np.nanmax(average(worn)[:80]) < LIMIT
    assert np.nanmax(average(worn)[80:95]) > LIMIT


def test_a_season_is_no_shift():
    """A gear exchanged in summer: all nights of the winter lie above the first twenty."""
    noise = np.random.default_rng(3).normal(0, 0.13, 180)
    season = 0.14 * (1 - np.cos(2 * np.pi * np.arange(180) / 365))
    assert np.max(average(season + noise)) < LIMIT


def test_a_change_that_lasts_does_not_become_the_usual():
    noise = np.random.default_rng(4).normal(0, 0.13, 300)
    late = noise + 0.8 * (np.arange(300) >= 60)
    assert np.min(average(late)[70:]) > LIMIT
    # nor does one that was there from the first night on, where each night says so
    always = noise + 0.8
    assert np.min(average(always, np.zeros(300, dtype=bool))[5:]) > LIMIT


@pytest.mark.parametrize("values", [[], [np.nan] * 5, [0.1], [0.0] * 40, [np.nan, 0.2, np.nan]])
def test_awkward_series_have_a_chart(values):
    found = average(values)
    assert len(found) == len(values)
    known = np.isfinite(values) if values else []
    assert np.array_equal(np.isfinite(found), known)
