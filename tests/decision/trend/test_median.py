"""The median of a few numbers, beside numpy's."""

import numpy as np
import pytest

from opamc_cli.decision.trend.median import median


@pytest.mark.parametrize("n", [1, 2, 3, 6, 7, 190])
def test_it_is_numpys(n):
    rng = np.random.default_rng(n)
    for values in (rng.normal(size=n), np.ones(n), rng.integers(0, 3, n).astype(float)):
        assert median(values) == np.median(values)
