"""Chart, slope, onset and alarm against slow twins, other libraries and what is known by hand."""

import numpy as np
import pytest
from scipy.stats import theilslopes

from opamc_cli.decision.trend.alarm import Episode, Night, episodes
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
from opamc_cli.decision.trend.onset import onset
from opamc_cli.decision.trend.slope import LEAST_NIGHTS, nights_until, robust_slope


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


def test_what_does_not_grow_has_no_forecast():
    nights = np.arange(20.0)
    flat = robust_slope(nights, np.random.default_rng(3).normal(0.1, 0.02, 20))
    assert flat is not None
    assert nights_until(flat, 0.5) is None
    assert nights_until(flat, 0.01) == (0.0, 0.0)
    assert robust_slope(nights[: LEAST_NIGHTS - 1], nights[: LEAST_NIGHTS - 1]) is None


@pytest.mark.parametrize("kind", ["step", "rise"])
def test_the_onset_is_found(kind):
    missed = []
    for seed in range(20):
        rng = np.random.default_rng([11, seed])
        nights = np.arange(80.0)
        change = np.where(nights >= 50, 0.6, 0) if kind == "step" else np.clip(nights - 50, 0, None)
        values = rng.normal(0, 0.08, 80) + (change if kind == "step" else 0.05 * change)
        values[10] += 3
        missed.append(abs(onset(nights, values) - 50))
    assert np.median(missed) <= (1 if kind == "step" else 4)


def test_awkward_series_have_an_onset():
    for values in ([], [1.0], [1.0, 1.0, 1.0], [0.0] * 10):
        assert 0 <= onset(np.arange(float(len(values))), np.array(values)) <= len(values)


S, N, U = Night(True), Night(False), Night(False, judged=False)


@pytest.mark.parametrize(
    ("nights", "expected"),
    [
        ([], []),
        ([S, N, N, S, N], []),
        ([N, S, S], [Episode(2, None)]),
        ([S, N, S, N, N, N], [Episode(2, 5)]),
        ([S, U, U, S], [Episode(3, None)]),
        ([N, Night(True, gross=True), N, N], [Episode(1, None)]),
        ([N, Night(True, gross=True), N, N, N], [Episode(1, 4)]),
        ([S, S, U, U, U], [Episode(1, None)]),
        ([S, S, N, N, N, S, S], [Episode(1, 4), Episode(6, None)]),
    ],
)
def test_two_of_three_nights_make_an_alarm(nights, expected):
    assert episodes(nights, 2, 3) == expected
