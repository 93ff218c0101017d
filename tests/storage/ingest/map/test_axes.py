"""Lines of a map for all axes."""

import pytest

from opamc_cli.storage.ingest.map.axes import MOST_AXES, expand, filled, protect, shown

LINE = {"axis«n»_a": {"source": "i_«n-1»", "unit": "A"}}


@pytest.mark.parametrize("text", ["i_{n}", "i_{n-1}", "{n+12}_{n}"])
def test_protected_text_is_shown_as_it_was_written(text):
    assert "{" not in protect(text)
    assert shown(protect(text)) == text


def test_a_number_alone_becomes_one():
    assert [filled("«n-1»", 1), filled("«n+2»", 3), filled("i«n»", 4), filled(7, 2)] == [
        *(0, 5, "i4", 7)
    ]


def test_a_line_is_repeated_for_as_many_axes_as_are_said():
    made = expand(LINE, 3, lambda entry: False)
    assert {name: entry["source"] for name, entry in made.items()} == {
        **{"axis1_a": "i_0", "axis2_a": "i_1", "axis3_a": "i_2"}
    }


def test_without_a_number_there_are_those_that_the_file_has():
    assert list(expand(LINE, None, lambda e: e["source"] in ("i_0", "i_1"))) == [
        *("axis1_a", "axis2_a")
    ]
    assert list(expand(LINE, None, lambda e: e["source"] in ("i_3", "i_9"))) == [
        *("axis4_a", "axis10_a")
    ]
    assert list(expand(LINE, None, lambda e: False)) == ["axis1_a"]
    assert len(expand(LINE, None, lambda e: True)) == MOST_AXES


def test_a_line_for_one_axis_goes_before_that_for_all():
    made = expand({**LINE, "axis2_a": {"source": "own"}}, 2, lambda e: True)
    assert made["axis2_a"] == {"source": "own"}
    assert made["axis1_a"]["source"] == "i_0"
