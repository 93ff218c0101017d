"""Which cases `make test` leaves to `make test-all`."""

import pytest
from _pytest.mark import ParameterSet


def long(*values: object) -> ParameterSet:
    """Return one case of a parametrised test, left to `make test-all`."""
    return pytest.param(*values, marks=pytest.mark.long)
