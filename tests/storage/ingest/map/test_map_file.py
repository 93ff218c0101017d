"""The bounds of a map's values, and its lines for every axis."""

import pytest
from pydantic import ValidationError

from opamc_cli.storage.ingest.map.map_file import IngestMap, count_doubts, for_axes
from opamc_cli.storage.ingest.source import Listed

COLUMN = {"source": "x", "unit": "A"}


def with_column(**keys):
    return {"columns": {"axis1_a": COLUMN | keys}}


def with_time(**keys):
    return with_column() | {"time": {"source": "t", "unit": "s"} | keys}


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        (with_column(index=0), with_column(index=-1)),
        (with_column(scale=-1e15), with_column(scale=-1.1e15)),
        (with_column(offset=1e15), with_column(offset=1.1e15)),
        (with_column() | {"skip_rows": 1_000_000}, with_column() | {"skip_rows": 1_000_001}),
        (with_column() | {"units_rows": 0}, with_column() | {"units_rows": -1}),
        (with_column() | {"axes": 32}, with_column() | {"axes": 33}),
        (with_column() | {"axes": 1}, with_column() | {"axes": 0}),
        (with_column() | {"separator": "x" * 100}, with_column() | {"separator": "x" * 101}),
        (with_column() | {"separator": "x"}, with_column() | {"separator": ""}),
        (with_column() | {"sampling_rate_hz": 1e9}, with_column() | {"sampling_rate_hz": 1.1e9}),
        (with_column() | {"resample_hz": 1e-9}, with_column() | {"resample_hz": 0}),
        (with_time(index=0), with_time(index=-1)),
        (with_time(max_gap_samples=1.5), with_time(max_gap_samples=1.4)),
        (with_time(max_gap_samples=1000), with_time(max_gap_samples=1001)),
        (with_column(), {"columns": {}}),
    ],
)
def test_bounds(good, bad):
    IngestMap.model_validate(good)
    with pytest.raises(ValidationError):
        IngestMap.model_validate(bad)


def test_what_a_map_means_that_says_nothing():
    found = IngestMap.model_validate(with_time())
    assert (found.separator, found.decimal, found.encoding) == (",", ".", "utf-8")
    assert (found.header, found.skip_rows, found.units_rows) == (True, 0, 0)
    assert (found.time.interpolation, found.time.max_gap_samples) == ("cubic", 2.5)
    column = found.columns["axis1_a"]
    assert (column.scale, column.offset, column.unwrap, column.optional) == (1, 0, False, False)


def test_a_line_for_every_axis_that_the_file_has():
    lines = {
        "axis«n»_a": {"source": "i", "unit": "A", "index": "«n-1»"},
        "axis«n»_position": {"source": "q_«n»", "unit": "deg", "optional": True},
        "axis2_a": {"source": "other", "unit": "A"},
    }
    listed = [Listed("i", 3), Listed("q_1"), Listed("q_3"), Listed("other")]
    found = for_axes(IngestMap.model_validate({"columns": lines}), lambda: listed).columns
    # the line of one axis goes before that for all
    assert {name: (c.source, c.index) for name, c in found.items()} == {
        "axis2_a": ("other", None),
        "axis1_a": ("i", 0),
        "axis1_position": ("q_1", None),
        "axis3_a": ("i", 2),
        "axis3_position": ("q_3", None),
    }
    given = IngestMap.model_validate({"columns": lines, "axes": 2})
    assert set(for_axes(given).columns) == {
        *("axis1_a", "axis1_position", "axis2_a", "axis2_position")
    }
    # without a file: as for one axis that has all of them
    alone = for_axes(IngestMap.model_validate({"columns": lines}))
    assert set(alone.columns) == {"axis1_a", "axis1_position", "axis2_a"}


def counted(source, *names, time=None):
    """Return the axes of a line for all, and what is said of them."""
    given = {"columns": {"axis«n»_a": {"source": source, "unit": "A"}}}
    if time is not None:
        given["time"] = {"source": time, "unit": "s"}
    channels, listed = IngestMap.model_validate(given), list(map(Listed, names))
    own = for_axes(channels, lambda: listed)
    return list(own.columns), *count_doubts("a.csv", channels, own, listed)


def test_a_joint_keeps_its_number_where_others_are_missing():
    assert counted("J«n»", "J4", "J5") == (["axis4_a", "axis5_a"], [], [])
    axes, gaps, lost = counted("J«n»", "J1", "J10", "J12")
    assert axes == ["axis1_a", "axis10_a", "axis12_a"]
    (gap,) = gaps
    assert gap.startswith("a.csv: has no channel for axis 2, 3, 4, 5, 6, 7, 8, 9, 11, but for axis")
    assert not lost


def test_a_joint_0_is_left_out_aloud_where_lines_count_from_1():
    axes, _, (lost,) = counted("J«n»", "J0", "J1")
    assert axes == ["axis1_a"]
    assert lost.startswith("a.csv: J0 is in no run: {n} counts from 1; write {n-1} if")
    # what is named otherwise, or counts from where the line says, is not left out
    assert not counted("J«n»", "J0", "J1", time="J0")[2]
    assert not counted("J«n+1»", "J0", "J1", "J2")[2]
