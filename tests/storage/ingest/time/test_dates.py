"""Dates of foreign recordings."""

from pathlib import Path

import numpy as np
import pytest

from opamc_cli.storage.ingest.time.dates import parse_dates


@pytest.mark.parametrize("known", [[], ["2026-03-01T08:00:00.5"]])
def test_empty_dates_are_no_time(known):
    dates = parse_dates(Path("r.csv"), "t", ["", *known, ""])
    assert dates.dtype == "datetime64[us]"
    assert np.isnat(dates).tolist() == [True, *(False for _ in known), True]
    assert [str(date) for date in dates[1:-1]] == [f"{text}00000" for text in known]
