"""The median that loads nothing, against numpy's, which loads arrays with masks."""

import subprocess
import sys

import numpy as np
import pytest

from opamc_cli.decision.trend.median import median


@pytest.mark.parametrize("n", [1, 2, 3, 4, 9, 180])
def test_it_is_numpys_to_the_last_digit(n):
    rng = np.random.default_rng(n)
    for values in (rng.normal(size=n), rng.integers(0, 3, n) / 3, 1e300 * rng.normal(size=n)):
        before = values.copy()
        assert median(values) == np.median(values)
        assert (values == before).all()


def test_a_chart_and_a_trend_load_no_arrays_with_masks():
    code = (
        "import sys, numpy as np\n"
        "from opamc_cli.decision.trend import chart, onset, slope, temperature\n"
        "nights, values = np.arange(12.0), np.arange(12.0) % 5\n"
        "chart.control_chart(values / 100, values < 9, 6)\n"
        "onset.onset(nights, values)\n"
        "temperature.without_temperature(nights, values, 20 + values, 20.0)\n"
        "slope.robust_slope(nights, values)\n"
        "sys.exit('numpy.ma' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
