"""Combinations that no map may have, each with its sentence."""

import pytest

from opamc_cli.config import load_config
from opamc_cli.errors import ConfigError
from opamc_cli.storage.ingest.map.load import load_map

A = "axis1_a: {source: x, unit: A}"
RATE = "sampling_rate_hz: 100\n"


def load(tmp_path, columns=A, head=RATE):
    path = tmp_path / "map.yaml"
    path.write_text(f"{head}columns: {{{columns}}}\n")
    return load_map(path)


def test_a_map_is_read(tmp_path):
    assert load(tmp_path).columns["axis1_a"].source == "x"


@pytest.mark.parametrize(
    ("columns", "head", "why"),
    [
        ("axis{n}_a: {source: x, unit: A}", RATE, "{n} stands on one side only; its source"),
        ("axis1_a: {source: 'x{n}', unit: A}", RATE, "columns name no {n}"),
        (A, RATE + "axes: 2\n", "axes is 2, but no column"),
        ("axis1_d: {source: x, unit: A}", RATE, "is not a column of a run"),
        ("axis1_a: {source: x, unit: rad}", RATE, "units of a current"),
        ("axis1_a: {source: x, unit: A, unwrap: true}", RATE, "unwrap: true is for positions"),
        ("axis1_a: {source: x, unit: A, unwrap: 0}", RATE, "should be greater than 0"),
        ("axis1_a: {source: x, unit: A, scale: 0}", RATE, "scale is 0"),
        (A + ", axis1_b: {source: x, unit: A}", RATE, "are both of 'x'"),
        ("axis1_position: {source: x, unit: rad}", RATE, "names no current"),
        ("axis1_a: {source: x, unit: Nm}", RATE, "a torque stands for axisN_current alone"),
        ("axis1_current: {source: y, unit: Nm}, axis2_a: {source: x, unit: A}", RATE, "or the"),
        (A, "", "no sampling_rate_hz and no time"),
        (A, "time: {source: t, unit: A}\n", "units of time"),
        (A, "time: {source: t, unit: samples}\n", "time counts samples"),
        (A, RATE + "format: mat\nheader: true\n", "header is for csv, the map's format is mat"),
        (A, RATE + "decimal: ','\nseparator: ','\n", "are both ','"),
        (A, RATE + "encoding: klingon\n", "encoding is 'klingon'"),
        (A, RATE + "header: false\n", "without a header line"),
    ],
)
def test_refused(tmp_path, columns, head, why):
    with pytest.raises(ConfigError) as refused:
        load(tmp_path, columns, head)
    assert why in str(refused.value)


@pytest.mark.parametrize(
    ("columns", "why"),
    [
        ("axis{n}_a: {source: x{n}, unit: A}, axis{n}_a: {source: y{n}}", "'axis{n}_a' is given"),
        ("axis{n}_a: {source: x{n}, unit: A}, axis1_b: {source: 'x", "while scanning a quoted"),
        ("axis{n}_a: {source: x{n}, unitt: A}", "columns.axis{n}_a.unitt"),
    ],
)
def test_what_is_wrong_in_lines_for_all_axes_is_said_as_it_was_written(tmp_path, columns, why):
    """It was said that it is a map, to be read by what read it."""
    with pytest.raises(ConfigError, match=r"map\.yaml: ") as refused:
        load(tmp_path, columns)
    assert why in str(refused.value)
    with pytest.raises(ConfigError, match=r"is a map, for `opamc ingest --map`|unknown key"):
        load_config(tmp_path / "map.yaml")
