"""The constant of the median absolute deviation, and what comes with it."""

import subprocess
import sys
from statistics import NormalDist

import pytest

from opamc_cli.decision.significance.median_deviation import MAD_TO_SIGMA


def test_half_of_a_normal_variable_lies_within_the_median_absolute_deviation():
    normal = NormalDist()
    within = normal.cdf(1 / MAD_TO_SIGMA) - normal.cdf(-1 / MAD_TO_SIGMA)
    assert within == pytest.approx(0.5, abs=1e-4)


def test_what_takes_a_second_to_load_is_not_loaded_where_it_is_not_needed():
    code = "import sys, opamc_cli.stages.nightly.start.run; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
