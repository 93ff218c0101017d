"""Every unit of a foreign recording, as a number."""

import math

import pytest

from opamc_cli.storage.ingest.map.map_file import RateMap, rate_hz, rate_kind
from opamc_cli.storage.ingest.map.units import CONVERSIONS, conversion, is_torque, known_units
from opamc_cli.storage.schemas.channels import quantity_of

ONE = {
    "current": {
        "A": 1,
        "mA": 1e-3,
        "uA": 1e-6,
        "µA": 1e-6,
        "kA": 1e3,
        **dict.fromkeys(("Arms", "Aeff", "A rms"), 2**0.5),
    }
    | dict.fromkeys(("Nm", "N·m", "N m"), 1)
    | {"mNm": 1e-3},
    "position": {"rad": 1, "mrad": 1e-3, "rev": 2 * math.pi}
    | dict.fromkeys(("deg", "°"), math.pi / 180),
    "velocity": {"rad/s": 1, "rev/s": 2 * math.pi}
    | dict.fromkeys(("deg/s", "°/s"), math.pi / 180)
    | dict.fromkeys(("rpm", "1/min", "rev/min"), math.pi / 30),
    "time": {"s": 1, "sec": 1, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
    | {"min": 60, "h": 3600},
    "rate": {"Hz": 1, "kHz": 1e3},
}


@pytest.mark.parametrize("quantity", ONE)
def test_what_one_is(quantity):
    for unit, factor in ONE[quantity].items():
        found = conversion(unit, quantity)
        assert found is not None, unit
        assert (found.factor, found.offset) == (pytest.approx(factor, rel=1e-15), 0), unit
    dates = {"filetime", "ticks", "days"}  # these count from a day of their own
    assert CONVERSIONS[quantity].keys() - dates <= ONE[quantity].keys()
    assert conversion("furlong", quantity) is None


def test_temperatures_have_zeros_of_their_own():
    for unit, freezing, boiling in (
        ("degC", 0, 100),
        ("°C", 0, 100),
        ("K", 273.15, 373.15),
        ("degF", 32, 212),
        ("°F", 32, 212),
    ):
        found = conversion(unit, "temperature")
        assert found.factor * freezing + found.offset == pytest.approx(0, abs=1e-12)
        assert found.factor * boiling + found.offset == pytest.approx(100)


def test_torques_are_no_currents():
    assert [unit for unit in ONE["current"] if is_torque(unit)] == ["Nm", "N·m", "N m", "mNm"]


def test_units_that_a_message_lists():
    assert known_units("time") == ("s, ms, us, ns, min, h, filetime, ticks, days, samples, iso8601")
    assert known_units("rate") == "Hz, kHz"


@pytest.mark.parametrize(
    ("unit", "value", "rate"), [("Hz", 500, 500), ("kHz", 2, 2000), ("ms", 4, 250), ("s", 0.5, 2)]
)
def test_a_rate_or_a_period(unit, value, rate):
    assert rate_hz(RateMap(source="x", unit=unit), value) == pytest.approx(rate)


def test_a_unit_of_neither_is_no_rate():
    assert rate_kind(RateMap(source="x", unit="A")) is None


def test_quantities_of_columns():
    columns = ("axis1_a", "axis12_c", "axis1_current", "axis3_position", "axis1_temperature")
    found = [quantity_of(column) for column in columns]
    assert found == ["current", "current", "current", "position", "temperature"]
