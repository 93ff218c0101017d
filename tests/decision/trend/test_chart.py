"""The control chart against its definition, night by night."""

import numpy as np
import pytest

from opamc_cli.decision.trend.chart import (
    LEAST_SPREAD,
    MAD_TO_SIGMA,
    MOST,
    REFERENCE_NIGHTS,
    USUAL_NIGHTS,
    USUAL_SPREAD,
    WEIGHT,
    control_chart,
)


def slow_chart(values, n_baseline):
    """The chart as its definition reads: every night from all nights before it, from scratch."""
    found = []
    for t in range(len(values)):
        if np.isnan(values[t]):
            found.append(np.nan)
            continue
        shifts = []
        for u in range(t + 1):
            if np.isnan(values[u]):
                continue
            before = [v for v in values[:u] if not np.isnan(v)][:REFERENCE_NIGHTS]
            n, centre, spread = len(before), 0.0, USUAL_SPREAD
            if n:
                median = np.median(before)
                mad = MAD_TO_SIGMA * np.median(np.abs(np.array(before) - median))
                centre = n * median / (n + n_baseline)
                variance = (USUAL_NIGHTS * USUAL_SPREAD**2 + n * mad**2) / (USUAL_NIGHTS + n)
                spread = max(np.sqrt(variance), LEAST_SPREAD)
            shifts.append(np.clip((values[u] - centre) / spread, -MOST, MOST))
        ages = np.arange(len(shifts))[::-1]
        weights = WEIGHT * (1 - WEIGHT) ** ages
        n = min(len(shifts) - 1, REFERENCE_NIGHTS)
        scale = np.sqrt(np.sum(weights**2) + 1 / (n_baseline + n + 1))
        found.append(np.sum(weights * shifts) / scale)
    return np.array(found)


@pytest.mark.parametrize("seed", range(3))
def test_the_chart_is_its_definition(seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(0, 0.1, 60)
    values[rng.random(60) < 0.1] = np.nan
    values[40:] += 0.3
    np.testing.assert_allclose(control_chart(values, 6).average, slow_chart(values, 6), rtol=1e-9)


def test_no_night_of_the_chart_knows_the_future():
    values = np.random.default_rng(1).normal(0, 0.1, 50)
    whole = control_chart(values, 6).average
    np.testing.assert_array_equal(control_chart(values[:30], 6).average, whole[:30])


def test_a_small_shift_that_lasts_is_seen_and_one_odd_night_is_not():
    rng = np.random.default_rng(2)
    healthy = rng.normal(0.05, 0.08, 120)
    assert np.nanmax(control_chart(healthy, 6).average) < 4
    odd = healthy.copy()
    odd[70] += 5
    assert np.nanmax(control_chart(odd, 6).average) < 4
    worn = healthy.copy()
    worn[80:] += 0.2
    assert np.nanmax(control_chart(worn, 6).average[:80]) < 4
    assert np.nanmax(control_chart(worn, 6).average[80:95]) > 4


@pytest.mark.parametrize("values", [[], [np.nan] * 5, [0.1], [0.0] * 40, [np.nan, 0.2, np.nan]])
def test_awkward_series_have_a_chart(values):
    chart = control_chart(np.array(values, dtype=float), 6)
    assert len(chart.average) == len(values)
    known = np.isfinite(values) if values else []
    assert np.array_equal(np.isfinite(chart.average), known)
