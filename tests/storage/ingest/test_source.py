"""Shapes of datasets, and lengths that have to agree."""

from pathlib import Path

import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.source import (
    check_lengths,
    check_mark,
    missing_channel,
    samples_of,
    width_of,
)

PATH = Path("r.h5")


@pytest.mark.parametrize(
    ("shape", "index", "expected"),
    [
        ((9,), None, (9, None)),
        ((1, 9), None, (9, 1)),
        ((9, 1), None, (9, 0)),
        ((9, 3), 2, (9, 0)),
        ((3, 9), 0, (9, 1)),
        ((9, 1), 0, (9, 0)),
    ],
)
def test_the_longer_dimension_is_time(shape, index, expected):
    assert samples_of(PATH, "x", index, shape) == expected


@pytest.mark.parametrize(
    ("shape", "index", "why"),
    [
        ((9,), 0, r"has one dimension \(9\); drop its index"),
        ((9, 3), None, r"holds 3 channels \(9x3\), index is None; set index to 0\.\.2"),
        ((9, 3), 3, "index is 3"),
        ((2, 2, 2), 0, "has shape 2x2x2"),
        ((), None, "has shape a single value"),
    ],
)
def test_what_is_no_channel_is_refused(shape, index, why):
    with pytest.raises(InputError, match=why):
        samples_of(PATH, "x", index, shape)


def test_width():
    assert [width_of(s) for s in ((5, 2), (2, 2, 2), (), (5, 1))] == [2, False, False, None]


def test_lengths_agree():
    assert check_lengths(PATH, {"a": 3, "b": 3}) == 3
    with pytest.raises(InputError, match="'b' has 4 samples, 'a' has 3"):
        check_lengths(PATH, {"a": 3, "b": 4})


def test_twelve_channels_are_named():
    assert str(missing_channel(PATH, "x", [])) == "r.h5: no channel 'x'; the file has none"
    assert str(missing_channel(PATH, "x", ["c"] * 12)).endswith("c, c")
    assert str(missing_channel(PATH, "x", ["c"] * 13)).endswith("c, …")


def test_a_mark_is_looked_for(tmp_path):
    (tmp_path / "r").write_bytes(b"TDSmxx")
    check_mark(tmp_path / "r", [b"MDF ", b"TDSm"], "TDMS")
    with pytest.raises(InputError, match=r"is not MDF \(it starts with b'TDSm'\)"):
        check_mark(tmp_path / "r", [b"MDF "], "MDF")
