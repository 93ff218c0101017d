"""What names of a run's columns are."""

import math

import pytest

from opamc_cli.storage.schemas.channels import (
    COLUMN,
    LOGGED,
    NEARLY_COLUMN,
    axes_phrase,
    quantity_of,
)


@pytest.mark.parametrize("name", ["axis1_a", "axis12_current", "axis10_temperature"])
def test_columns(name):
    assert COLUMN.fullmatch(name)


@pytest.mark.parametrize("name", ["axis0_a", "axis01_a", "axis1_d", "axis_a", "Axis1_a"])
def test_no_columns(name):
    assert not COLUMN.fullmatch(name)


@pytest.mark.parametrize("name", ["Axis1_A", "axis 01-a", " axis1__a "])
def test_nearly_columns(name):
    assert NEARLY_COLUMN.fullmatch(name).group(1) == "1"


def test_quantities():
    names = ("axis1_c", "axis1_current", "axis3_velocity")
    assert [quantity_of(name) for name in names] == ["current", "current", "velocity"]


@pytest.mark.parametrize(
    ("channel", "unit", "value", "expected"),
    [
        ("position", "deg", 180, math.pi),
        ("position", "rev", 1, 2 * math.pi),
        ("position", "mrad", 1000, 1),
        ("velocity", "rpm", 60, 2 * math.pi),
        ("velocity", "deg/s", 90, math.pi / 2),
        ("velocity", "rev/s", 0.5, math.pi),
        ("temperature", "K", 273.15, 0),
        ("temperature", "degF", 212, 100),
    ],
)
def test_conversions(channel, unit, value, expected):
    made = LOGGED[channel].units[unit]
    assert value * made.factor + made.offset == pytest.approx(expected, abs=1e-12)


def test_the_run_s_own_unit_stands_first():
    first = {name: next(iter(c.units.items())) for name, c in LOGGED.items()}
    assert [(unit, c.factor, c.offset) for unit, c in first.values()] == [
        *(("rad", 1, 0), ("rad/s", 1, 0), ("degC", 1, 0))
    ]


@pytest.mark.parametrize(
    ("axes", "phrase"),
    [
        ([3], "axis 3"),
        ([2, 1], "axes 1 and 2"),
        ([1, 2, 3], "axes 1-3"),
        ([1, 2, 5], "axes 1, 2 and 5"),
        ([], "no axis"),
    ],
)
def test_axes_in_words(axes: list[int], phrase: str) -> None:
    assert axes_phrase(axes) == phrase
