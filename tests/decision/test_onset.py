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


def test_awkward_series_have_an_onset():
    for values in ([], [1.0], [1.0, 1.0, 1.0], [0.0] * 10):
        assert 0 <= onset(np.arange(float(len(values))), np.array(values)) <= len(values)
