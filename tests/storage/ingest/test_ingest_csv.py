import gzip
import json
import re
from pathlib import Path

import numpy as np
import pytest

from opamc_cli.errors import ConfigError, InputError, UsageError
from opamc_cli.stages.recordings import ingest
from opamc_cli.storage.ingest.map.load import load_map
from opamc_cli.storage.runs.hashes import file_sha256
from opamc_cli.storage.runs.run import Run


def run_map(tmp_path, text, files, out="out"):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    return ingest.run(files, load_map(path), tmp_path / out)


def only_run(outcome):
    assert not outcome.errors, outcome.errors
    (item,) = outcome.results
    return Run(item.run)


def refusal(outcome):
    assert not outcome.results
    (error,) = outcome.errors
    assert isinstance(error, InputError)
    return str(error)


CURRENTS = np.array([[1.5, -2.25, 0.75], [0.0, 3e-3, -1.0], [2.0, 1.0, -3.0], [4.0, 5.0, 6.0]])


def write_table(path, separator=",", decimal=".", top="", trailing="", newline="\n", encoding=None):
    rows = [separator.join(repr(float(v)) for v in row).replace(".", decimal) for row in CURRENTS]
    text = top + "".join(row + trailing + newline for row in rows)
    path.write_bytes(text.encode(encoding or "utf-8"))
    return path


def phases(first="0", second="1", third="2", unit="A"):
    sources = zip("abc", (first, second, third), strict=True)
    return "columns:\n" + "".join(
        f"  axis1_{p}: {{source: {s}, unit: {unit}}}\n" for p, s in sources
    )


def check_currents(run, factor=1.0):
    data = run.read(["axis1_a", "axis1_b", "axis1_c"])
    for column, values in zip(CURRENTS.T, data.values(), strict=True):
        assert values.dtype == np.float32
        np.testing.assert_array_equal(values, (column * factor).astype(np.float32))


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", " ", "::", ", "])
def test_any_separator(tmp_path, separator):
    file = write_table(tmp_path / "r.csv", separator)
    text = f"header: false\nseparator: {json.dumps(separator)}\nsampling_rate_hz: 2048\n"
    check_currents(only_run(run_map(tmp_path, text + phases(), [file])))


def test_whitespace_is_any_run_of_blanks(tmp_path):
    file = tmp_path / "r.txt"
    file.write_text("".join("  " + " \t ".join(map(str, row)) + "  \n" for row in CURRENTS))
    text = "header: false\nseparator: whitespace\nsampling_rate_hz: 2048\n"
    check_currents(only_run(run_map(tmp_path, text + phases(), [file])))


def test_decimal_comma_latin1_header_units_row_and_empty_columns(tmp_path):
    top = "logger 7;µ-meter\n\nStröm;b ;c;;\n[mA];[mA];[mA];;\n"
    file = write_table(tmp_path / "r.csv", ";", ",", top, ";;", "\r\n", "latin-1")
    text = (
        'separator: ";"\ndecimal: ","\nencoding: latin-1\nskip_rows: 2\nunits_rows: 1\n'
        "sampling_rate_hz: 500\n" + phases("Ström", "b", "c", "mA")
    )
    run = only_run(run_map(tmp_path, text, [file]))
    assert run.sampling_rate_hz == 500
    check_currents(run, 1e-3)


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_line_ends_and_byte_order_marks(tmp_path, newline, encoding):
    top = f"a,b,c{newline}"
    file = write_table(tmp_path / "r.csv", top=top, newline=newline, encoding=encoding)
    declared = "utf-16" if encoding == "utf-16" else "utf-8"
    text = f"encoding: {declared}\nsampling_rate_hz: 10\n" + phases("a", "b", "c")
    check_currents(only_run(run_map(tmp_path, text, [file])))


def test_gzip_is_read_through(tmp_path):
    plain = write_table(tmp_path / "r.csv")
    packed = tmp_path / "packed.csv.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    outcome = run_map(tmp_path, "header: false\nsampling_rate_hz: 10\n" + phases(), [packed])
    check_currents(only_run(outcome))
    assert outcome.results[0].run.name == "packed.parquet"


def test_empty_cells_are_missing_and_counted(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("a,b\n1,2\n,3\nNaN,\n4,5\n")
    text = (
        "sampling_rate_hz: 10\ncolumns: {axis1_a: {source: a, unit: A}, "
        "axis1_b: {source: b, unit: A}}"
    )
    outcome = run_map(tmp_path, text, [file])
    assert outcome.results[0].missing == {"axis1_a": 2, "axis1_b": 1}
    np.testing.assert_array_equal(
        only_run(outcome).read(["axis1_a"])["axis1_a"], [1, np.nan, np.nan, 4]
    )


def test_scale_and_offset_come_before_the_unit(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("v\n2.5\n3.5\n")
    text = (
        "sampling_rate_hz: 10\ncolumns: {axis1_a: {source: v, unit: mA, scale: 200, offset: -500}}"
    )
    values = only_run(run_map(tmp_path, text, [file])).read(["axis1_a"])["axis1_a"]
    np.testing.assert_allclose(values, [0.0, 0.2])


def test_metadata_values_and_values_from_columns(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("i,when,kg\n1,2022-10-26T10:17:21.5+02:00,1.5\n2,2022-10-26T10:17:22+02:00,9\n")
    text = (
        "sampling_rate_hz: 10\ncolumns: {axis1_a: {source: i, unit: A}}\n"
        "metadata: {robot: R1, program: pick, speed_percent: 50, payload_kg: {source: kg}, "
        "started_at: {source: when}}"
    )
    info = only_run(run_map(tmp_path, text, [file])).info
    assert (info.robot, info.program, info.speed_percent, info.payload_kg) == (
        "R1",
        "pick",
        50,
        1.5,
    )
    assert info.started_at == "2022-10-26T08:17:21.500000Z"
    assert info.source_sha256 == file_sha256(file)


def test_a_large_file_is_the_same_as_its_rows(tmp_path):
    rng = np.random.default_rng(5)
    values = rng.normal(size=300_000).round(6)
    file = tmp_path / "r.csv"
    file.write_text("x\n" + "\n".join(map(repr, values.tolist())) + "\n")
    text = "sampling_rate_hz: 10\ncolumns: {axis1_a: {source: x, unit: A}}"
    run = only_run(run_map(tmp_path, text, [file]))
    np.testing.assert_array_equal(run.read(["axis1_a"])["axis1_a"], values.astype(np.float32))
    assert [start for start, _ in run.blocks(["axis1_a"])] == [0, 1 << 18]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "empty"),
        (b"a,b\n", "no data rows"),
        (b"a,b\n1,x7\n", "column b holds 'x7' in line 2"),
        (b"a,b\n1,2\n3\n", "line 3 has 1 columns where the first has 2"),
        (b"a,b\n1,2\n3,4,5\n", "line 3 has 3 columns"),
        (b"a,b\n1,2,3\n4,5,6\n", "its first row has 3 columns, its header names 2"),
        (b"b,b\n1,2\n", "2 columns are called 'b'; name one by its number: 0, 1"),
        (b"a,c\n1,2\n", "no channel 'b'; the file has a, c"),
        (b"a,b\n1,\n3,\n", "column axis1_a (source 'b') has no value in 2 rows"),
        (b"a,b,\xff\n1,2,3\n", "is not text in utf-8"),
        (gzip.compress(b"a,b\n1,2\n", mtime=0), "is compressed by gzip; give it a name that"),
        ("a,b\n1,2\n".encode("utf-16"), "set encoding, such as utf-16,"),
        (b"PK\x03\x04\x14\x00\xff\xff", "is a zip archive, as spreadsheets (.xlsx) are"),
        (b'a,b\n"1,2\n3,4\n', "r.csv"),
        (b"\x00\x01\x02\x03" * 50, "r.csv"),
    ],
)
def test_unusable_tables_are_refused(tmp_path, content, expected):
    file = tmp_path / "r.csv"
    file.write_bytes(content)
    text = "sampling_rate_hz: 10\ncolumns: {axis1_a: {source: b, unit: A}}"
    message = refusal(run_map(tmp_path, text, [file]))
    assert expected in message
    assert message.startswith(str(file))
    assert "\n" not in message
    assert not list((tmp_path / "out").glob("*.par*"))


def test_what_is_compressed_twice_is_called_that(tmp_path):
    """It was no text in utf-8, and latin-1 was offered."""
    file = tmp_path / "r.csv.gz"
    file.write_bytes(gzip.compress(gzip.compress(b"a,b\n1,2\n")))
    text = "sampling_rate_hz: 10\ncolumns: {axis1_a: {source: b, unit: A}}"
    assert "is compressed twice by gzip" in refusal(run_map(tmp_path, text, [file]))


def test_decimal_commas_read_with_points_are_refused(tmp_path):
    file = write_table(tmp_path / "r.csv", ";", ",")
    text = 'header: false\nseparator: ";"\nsampling_rate_hz: 10\n' + phases()
    assert "holds '1,5' in line 1" in refusal(run_map(tmp_path, text, [file]))


def test_the_wrong_separator_is_told_by_the_missing_column(tmp_path):
    file = write_table(tmp_path / "r.csv", ";")
    text = "header: false\nsampling_rate_hz: 10\n" + phases()
    assert "no channel 1; the file has 0..0" in refusal(run_map(tmp_path, text, [file]))


def test_one_bad_file_does_not_stop_the_others(tmp_path):
    good = write_table(tmp_path / "good.csv")
    bad = tmp_path / "bad.csv"
    bad.write_text("1,2\nx\n")
    outcome = run_map(tmp_path, "header: false\nsampling_rate_hz: 1\n" + phases(), [bad, good])
    assert [item.run.name for item in outcome.results] == ["good.parquet"]
    assert "bad.csv" in str(outcome.errors[0])


def test_two_files_of_one_stem_are_refused_before_anything_is_written(tmp_path):
    (tmp_path / "x").mkdir()
    files = [write_table(tmp_path / "r.csv"), write_table(tmp_path / "x" / "r.csv")]
    with pytest.raises(UsageError, match=r"would both become .*r\.parquet"):
        run_map(tmp_path, "header: false\nsampling_rate_hz: 1\n" + phases(), files)
    assert not (tmp_path / "out").exists()


GOOD = "columns: {axis1_a: {source: 0, unit: A}}\n"
NAMED = GOOD + "sampling_rate_hz: 1\nmetadata: "


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (GOOD, "no sampling_rate_hz and no time column"),
        ("sampling_rate_hz: 1\n", "columns is missing"),
        ("sampling_rate_hz: 0\n" + GOOD, "sampling_rate_hz"),
        ("sampling_rate: 1\n" + GOOD, "did you mean 'sampling_rate_hz'"),
        ("sampling_rate_hz: 1\ncolumns: {axis1_a: {source: 0, unti: A}}", "did you mean 'unit'"),
        (
            "sampling_rate_hz: 1\ncolumns: {axis1_a: {source: 0, unit: Amp}}",
            "columns.axis1_a.unit is 'Amp'; units of a current: A, mA, uA, kA",
        ),
        ("sampling_rate_hz: 1\ncolumns: {axis1_a: {source: 0, unit: deg}}", "units of a current"),
        ("sampling_rate_hz: 1\ncolumns: {axis0_a: {source: 0, unit: A}}", "is not a column"),
        ("sampling_rate_hz: 1\ncolumns: {axis1_d: {source: 0, unit: A}}", "is not a column"),
        (
            "sampling_rate_hz: 1\ncolumns: {axis1_position: {source: 0, unit: deg}}",
            "names no current",
        ),
        (
            "sampling_rate_hz: 1\ncolumns: {axis1_a: {source: 0, unit: A, unwrap: true}}",
            "unwrap: true is for positions",
        ),
        ("time: {source: 1, unit: samples}\n" + GOOD, "time counts samples"),
        ("time: {source: 1, unit: weeks}\n" + GOOD, "units of time: s, ms, us, ns"),
        ("sampling_rate_hz: {source: fs, unit: A}\n" + GOOD, "a rate is in Hz or kHz"),
        ("sampling_rate_hz: 1\nformat: mat\nheader: true\n" + GOOD, "header is for csv"),
        ("sampling_rate_hz: 1\naxes: 2\n" + GOOD, "axes is 2, but no column holds {n}"),
        (
            "sampling_rate_hz: 1\ncolumns: {axis1_a: {source: 0, unit: A, scale: 0}}",
            "columns.axis1_a.scale is 0",
        ),
        (
            "sampling_rate_hz: 1\n"
            "columns: {axis1_a: {source: 0, unit: A}, axis2_a: {source: 0, unit: A}}",
            "columns.axis1_a and columns.axis2_a are both of 0",
        ),
        ("sampling_rate_hz: 1\nencoding: klingon\n" + GOOD, "encoding is 'klingon'"),
        ("sampling_rate_hz: 1\ndecimal: ','\n" + GOOD, "separator and decimal are both ','"),
        (
            "sampling_rate_hz: 1\nheader: false\ncolumns: {axis1_a: {source: x, unit: A}}",
            "columns are numbered from 0",
        ),
        ("sampling_rate_hz: fast\n" + GOOD, ": sampling_rate_hz is 'fast'; it takes a number"),
        ("sampling_rate_hz: {source: fs}\n" + GOOD, ": sampling_rate_hz.unit is missing"),
        (NAMED + "{payload_kg: none}", ": metadata.payload_kg is 'none'; it takes a number"),
        (NAMED + "{robot: 0123}", "metadata.robot: 83 is read as a number; put it in quotes"),
        (NAMED + "{started_at: 20260301}", "20260301 is read as a number; put it in quotes"),
        (NAMED + "{robot: {sorce: a}}", "unknown key 'metadata.robot.sorce'; did you mean"),
    ],
)
def test_unusable_maps_are_refused(tmp_path, text, expected):
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_map(path)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_maps_that_are_odd_but_may_be(tmp_path):
    path = tmp_path / "map.yaml"
    # one thermometer for all joints, and a line for one axis beside that for all
    path.write_text(
        "sampling_rate_hz: 1\naxes: 2\ncolumns: {axis3_a: {source: u, unit: A}, "
        "axis{n}_a: {source: 'i_{n}', unit: A}, axis1_temperature: {source: t, unit: K}, "
        "axis2_temperature: {source: t, unit: K}}"
    )
    assert load_map(path).axes == 2


def test_overrides_reach_into_the_map(tmp_path):
    path = tmp_path / "map.yaml"
    path.write_text("sampling_rate_hz: 1\n" + GOOD)
    changed = load_map(path, ["sampling_rate_hz=2000", "columns.axis1_a.unit=mA"])
    assert changed.sampling_rate_hz == 2000
    assert changed.columns["axis1_a"].unit == "mA"


def test_the_maps_in_the_documentation_are_maps(tmp_path):
    text = (Path(__file__).parents[3] / "docs" / "formats.md").read_text(encoding="utf-8")
    maps = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert maps
    for content in maps:
        (tmp_path / "map.yaml").write_text(content, encoding="utf-8")
        load_map(tmp_path / "map.yaml")


@pytest.mark.parametrize("path", sorted((Path(__file__).parents[3] / "configs/maps").glob("*")))
def test_shipped_maps_are_maps(path):
    load_map(path)


@pytest.mark.long
def test_ingesting_again_or_with_more_workers_gives_the_same_bytes(tmp_path):
    files = [write_table(tmp_path / f"{name}.csv") for name in ("a", "b", "c")]
    path = tmp_path / "map.yaml"
    path.write_text("header: false\nsampling_rate_hz: 10\n" + phases())
    one = ingest.run(files, load_map(path), tmp_path / "one")
    two = ingest.run(files, load_map(path), tmp_path / "two", jobs=2)
    assert [item.run.name for item in two.results] == ["a.parquet", "b.parquet", "c.parquet"]
    for first, second in zip(one.results, two.results, strict=True):
        assert first.run.read_bytes() == second.run.read_bytes()


def logged(tmp_path, unit="A", angle="rad", current=3.0, turn=1.5, scale=1.0, warmth=40.0):
    """Ingest ten seconds of a joint that swings by `turn` at 100 Hz."""
    t = np.arange(1000) / 100
    swing = np.sin(2 * np.pi * 0.2 * t)
    columns = np.column_stack([current * swing, turn * swing, 0 * t + warmth])
    np.savetxt(tmp_path / "r.csv", columns, delimiter=",")
    text = f"""sampling_rate_hz: 100
header: false
columns:
  axis1_current: {{source: 0, unit: {unit}}}
  axis1_position: {{source: 1, unit: {angle}, scale: {scale}}}
  axis1_temperature: {{source: 2, unit: degC}}
"""
    return run_map(tmp_path, text, [tmp_path / "r.csv"])


@pytest.mark.parametrize(
    ("wrong", "parts"),
    [
        ({"current": 3000.0}, ["axis1_current (source 0)", "1000 A", "mA taken for A"]),
        ({"unit": "Nm", "current": 3e5}, ["100000 Nm", "mNm taken for Nm"]),
        ({"turn": 1.5 * 57.3 * 2}, ["speed of column axis1_position", "100 rad/s", "degrees"]),
        ({"scale": 160.0}, ["the motor's side"]),
    ],
)
def test_what_no_joint_does_is_another_unit(tmp_path, wrong, parts):
    said = refusal(logged(tmp_path, **wrong))
    for part in parts:
        assert part in said
    assert not (tmp_path / "out" / "r.parquet").exists()


def test_what_few_joints_do_is_said(tmp_path):
    assert logged(tmp_path).results[0].doubts == ()
    (doubt,) = logged(tmp_path, current=300.0).results[0].doubts
    assert "beyond 200 A" in doubt
    (doubt,) = logged(tmp_path, warmth=850.0).results[0].doubts  # a wire broke: no reason to stop
    assert "axis1_temperature (source 2) is below -60 or above 250 °C in 100% of its" in doubt


@pytest.mark.parametrize(
    ("units", "times", "fit"),
    [
        (("°", "rad/s"), "57", "rad and rad/s, or deg and deg/s"),
        (("rev", "rad/s"), "0.16", "rad and rad/s, or rev and rev/s"),
        (("rad", "rpm"), "0.1", "rad and rad/s"),
        (("rad", "rad/s"), None, None),
    ],
)
def test_units_of_position_and_speed_that_contradict_each_other_are_said(
    tmp_path, units, times, fit
):
    t = np.arange(1000) / 100
    joint = (np.cos(t), np.sin(2 * t), 2 * np.cos(2 * t))
    np.savetxt(tmp_path / "r.csv", np.column_stack(joint * 2), delimiter=",")
    lines = [
        f"  axis{n}_{channel}: {{source: {3 * (n - 1) + k}, unit: {unit}}}\n"
        for n in (1, 2)
        for k, (channel, unit) in enumerate(
            zip(("current", "position", "velocity"), ("A", *units), strict=True)
        )
    ]
    text = "sampling_rate_hz: 100\nheader: false\ncolumns:\n" + "".join(lines)
    doubts = run_map(tmp_path, text, [tmp_path / "r.csv"]).results[0].doubts
    said = (
        f"{tmp_path / 'r.csv'}: the speed of axis 1, 2 is {times} times the rate of change of its "
        f"position, in the map's units ({' and '.join(units)}); {fit} would agree: correct the map"
    )
    assert doubts == ((said,) if fit else ())


@pytest.mark.parametrize("times", [50.0, 1000.0, 0.019, -1.0, 1.4, 0.7])
def test_a_speed_that_is_its_positions_in_no_unit_is_said(tmp_path, times):
    t = np.arange(1000) / 100
    joint = (np.cos(t), np.sin(2 * t) / max(abs(times), 1), 2 * np.cos(2 * t) * min(times, 1))
    np.savetxt(tmp_path / "r.csv", np.column_stack(joint), delimiter=",")
    text = "sampling_rate_hz: 100\nheader: false\ncolumns:\n" + "".join(
        f"  axis1_{channel}: {{source: {k}, unit: {unit}}}\n"
        for k, (channel, unit) in enumerate(
            (("current", "A"), ("position", "rad"), ("velocity", "rad/s"))
        )
    )
    doubts = run_map(tmp_path, text, [tmp_path / "r.csv"]).results[0].doubts
    if times in (1.4, 0.7):  # a coarse encoder or a filter may
        assert doubts == ()
    else:
        assert "in the map's units (rad and rad/s); one of them is of the motor's side" in doubts[0]


def test_a_column_that_comes_less_often_than_the_rows_is_said_before_the_grid(tmp_path):
    t = np.arange(2000) * 0.013 + 0.001 * (np.arange(2000) % 2)
    current = np.random.default_rng(0).normal(size=(2, 250)).repeat(8, axis=1)
    warm = 30 + np.random.default_rng(1).normal(size=40).repeat(50)
    columns = np.column_stack([t, *current, np.sin(t), warm])
    np.savetxt(tmp_path / "r.csv", columns, delimiter=",", fmt="%.6f")
    text = "header: false\ntime: {source: 0, unit: s}\nresample_hz: 76.9\ncolumns:\n" + "".join(
        f"  {column}: {{source: {k}, unit: {unit}}}\n"
        for column, k, unit in (
            ("axis1_current", 1, "A"),
            ("axis2_current", 2, "A"),
            ("axis1_position", 3, "rad"),
            ("axis1_temperature", 4, "degC"),  # a temperature may
        )
    )
    (doubt,) = run_map(tmp_path, text, [tmp_path / "r.csv"]).results[0].doubts
    said = "is held for 8 rows: it comes at 9.62 Hz, up to 0.1 s late beside other columns"
    column = f"{tmp_path / 'r.csv'}: each value of axis1_current, axis2_current (source 1)"
    assert doubt == f"{column} {said}; log it as often as they are"


def test_a_wrist_that_passes_half_a_turn_is_no_wonder(tmp_path):
    t = np.arange(1000) / 100
    wrapped = (4 * t + np.pi) % (2 * np.pi) - np.pi
    np.savetxt(tmp_path / "r.csv", np.column_stack([np.cos(t), wrapped]), delimiter=",")
    text = (
        "sampling_rate_hz: 100\nheader: false\ncolumns:\n  axis1_current: {source: 0, unit: A}\n"
        "  axis1_position: {source: 1, unit: rad}\n"
    )
    assert run_map(tmp_path, text, [tmp_path / "r.csv"]).results[0].doubts == ()


def test_joints_that_a_line_for_all_does_not_count_are_said(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("J0,J1,J3\n" + "1,2,3\n" * 4)
    text = "sampling_rate_hz: 500\ncolumns:\n  axis{n}_current: {source: J{n}, unit: A}\n"
    (item,) = run_map(tmp_path, text, [file]).results
    assert list(item.sources) == ["axis1_current", "axis3_current"]
    assert "no channel for axis 2, but for axis 3" in item.doubts[0]
    assert "J0 is in no run" in item.lost


def test_a_last_line_that_is_cut_off_is_left_out_aloud(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("a,b\n" + "1,2\n" * 5 + "3")
    text = "sampling_rate_hz: 500\ncolumns: {axis1_a: {source: a, unit: A}}\n"
    (item,) = run_map(tmp_path, text, [file]).results
    assert item.n_samples == 5
    assert item.doubts == (f"{file}: its last line is cut off and left out",)
    for end in ("3\n", "3\n1,2", "3,4,5"):
        file.write_text("a,b\n" + "1,2\n" * 5 + end)
        assert "columns where the first has 2" in refusal(run_map(tmp_path, text, [file]))


def test_texts_that_stand_for_no_number_are_named(tmp_path):
    file = tmp_path / "r.csv"
    file.write_text("a\n---\n1\nn. def.\n2\n")
    text = "sampling_rate_hz: 500\ncolumns: {axis1_a: {source: a, unit: A}}\n"
    refused = refusal(run_map(tmp_path, text, [file]))
    assert "holds '---'" in refused
    assert "name what stands for no number in missing" in refused
    (item,) = run_map(tmp_path, text + 'missing: ["---", "n. def."]\n', [file]).results
    assert item.missing == {"axis1_a": 2}


def test_dates_that_are_none_of_iso_8601_are_refused_as_such(tmp_path):
    file = tmp_path / "r.csv"
    text = "time: {source: t, unit: iso8601}\ncolumns: {axis1_a: {source: a, unit: A}}\n"
    for date in ("10/19/2026 1:00 PM", "19.10.2026 12:00:00", "12:00:00"):
        file.write_text("t,a\n" + f"{date},1\n" * 5)
        assert "is no ISO 8601 time such as" in refusal(run_map(tmp_path, text, [file]))
