"""The night from which a series is another one."""

import numpy as np
import pytest

from opamc_cli.decision.trend.onset import onset


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


def test_the_onset_of_wear_that_shows_late_is_found():
    """Distances as of the virtual joints, log(1 + c s^4), until they alarm: lines find half."""
    late = []
    for seed in range(40):
        rng = np.random.default_rng([12, seed])
        severity = np.clip(np.arange(63.0) - 49, 0, None) / 90
        values = np.log1p(7400 * severity**4) + rng.normal(0, 0.13, 63)
        late.append(onset(np.arange(63.0), values) - 50)
    assert np.mean(np.abs(late) <= 5) >= 0.75, late


def test_awkward_series_have_an_onset():
    for values in ([], [1.0], [1.0, 1.0, 1.0], [0.0] * 10):
        assert 0 <= onset(np.arange(float(len(values))), np.array(values)) <= len(values)


def test_onsets_by_hand():
    """A step or a rise, exactly: no error is left at the night at which it begins."""
    nights = np.array([0.0, 1.0, 2.0, 4.0, 5.0, 7.0, 8.0])
    for start in range(1, 6):
        step = np.where(np.arange(7) >= start, 3.0, 1.0)
        assert onset(nights, step) == start
        rise = np.clip(nights - nights[start - 1], 0, None)
        assert onset(nights, 1.0 + rise) == start
        assert onset(nights, 1.0 - rise**2) == start
    # of the last night alone, too
    assert onset(nights, np.array([0.0] * 6 + [1.0])) == 6
    assert onset(np.arange(3.0), np.array([0.0, 5.0, 5.0])) == 1
    assert onset(np.arange(2.0), np.array([0.0, 5.0])) == 1
    assert onset(np.arange(1.0), np.array([5.0])) == 0
