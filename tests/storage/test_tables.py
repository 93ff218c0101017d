import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.config.models import digest
from opamc_cli.errors import InputError
from opamc_cli.storage.schemas.tables import MAY_BE_NULL, PATTERNS, SEGMENTS, TABLES
from opamc_cli.storage.tables import (
    TABLE_KEY,
    check_current,
    read_table,
    record_at,
    table_input,
    write_table,
)

ROW = {
    "run": "r",
    "axis": 1,
    "segment": 0,
    "start": 10,
    "stop": 90,
    "sampling_rate_hz": 2048.0,
    "f_max_hz": 157.0,
    "direction": 1,
    "variance": 0.5,
    "edge": False,
    "kind": "motion",
    "signal": "phases",
    "temperature_c": None,
}
RUN = {
    "name": "r",
    "path": "r.parquet",
    "sha256": "0",
    "n_samples": 100,
    "info": {"sampling_rate_hz": 2048.0},
}
TABLE = pa.Table.from_pylist([ROW, {**ROW, "segment": 1}], schema=SEGMENTS)


def write(path, table=TABLE, **changes):
    arguments = {"stage": "segment", "config": {"a": 1}, "inputs": []}
    write_table(path, table, **{**arguments, **changes})
    return path


def test_a_table_reads_back_with_its_provenance(tmp_path):
    source = tmp_path / "in" / "r.parquet"
    source.parent.mkdir()
    source.write_bytes(b"run")
    path = write(tmp_path / "out" / "segments.parquet", inputs=[table_input(source)])
    assert read_table(path, "segment", SEGMENTS).to_pylist() == TABLE.to_pylist()
    sha256 = table_input(source)[1]
    found = record_at(path)
    assert (found["stage"], found["config"]) == ("segment", {"a": 1})
    assert found["config_hash"] == digest({"a": 1})
    assert found["inputs"] == [{"path": "../in/r.parquet", "sha256": sha256}]


def test_writing_twice_gives_the_same_bytes_wherever(tmp_path):
    for folder in ("a", "b/c"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "r.parquet").write_bytes(b"run")
        inputs = [table_input(tmp_path / folder / "r.parquet")]
        write(tmp_path / folder / "segments.parquet", inputs=inputs)
    one, other = (tmp_path / f / "segments.parquet" for f in ("a", "b/c"))
    assert one.read_bytes() == other.read_bytes()


def test_a_changed_config_changes_the_record(tmp_path):
    one = write(tmp_path / "a.parquet")
    other = write(tmp_path / "b.parquet", config={"a": 2})
    assert record_at(one)["config_hash"] != record_at(other)["config_hash"]


def record(**changes):
    values = {"stage": "segment", "schema_version": 1, **changes}
    return {TABLE_KEY: json.dumps(values).encode()}


@pytest.mark.parametrize(
    ("metadata", "table", "expected"),
    [
        (None, TABLE, "a Parquet file of another program, not a stage table"),
        ({"opamc": "{}"}, TABLE, "is a run, not a stage table"),
        ({TABLE_KEY: b"[]"}, TABLE, "holds no JSON object"),
        (record(stage="identify"), TABLE, "is a table of stage 'identify', 'segment' is needed"),
        (record(schema_version=99), TABLE, "has schema version 99, this opamc reads 1"),
        (record(), TABLE.drop_columns(["stop"]), "column stop is missing"),
        (
            record(),
            TABLE.set_column(3, "start", pa.array([1.0, 2.0])),
            "column start has type double, int64 is needed",
        ),
    ],
)
def test_other_tables_are_refused(tmp_path, metadata, table, expected):
    path = tmp_path / "segments.parquet"
    pq.write_table(table.replace_schema_metadata(metadata), path)
    with pytest.raises(InputError) as caught:
        read_table(path, "segment", SEGMENTS)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("content", [b"", b"PAR1", b"not a table" * 50])
def test_files_that_are_not_parquet_are_refused(tmp_path, content):
    path = tmp_path / "segments.parquet"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"cannot be read as Parquet .* `opamc segment` again"):
        read_table(path, "segment", SEGMENTS)


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("stop", None, "column stop is null in 1 of 2 rows; run `opamc segment` again"),
        ("run", "x", "names run 'x', it was made from r"),
        ("temperature_c", None, None),
        ("sampling_rate_hz", 0.0, "column sampling_rate_hz holds 0, 1e-09 to"),
        ("direction", 2, "column direction holds 2, -1 to 1 is possible"),
    ],
)
def test_rows_that_no_stage_writes_are_refused(tmp_path, column, value, expected):
    rows = [ROW, {**ROW, "segment": 1, column: value}]
    table = pa.Table.from_pylist(rows, schema=SEGMENTS)
    path = write(tmp_path / "segments.parquet", table, extra={"runs": [RUN]})
    if expected is None:
        assert read_table(path, "segment", SEGMENTS).num_rows == 2
        return
    with pytest.raises(InputError) as caught:
        read_table(path, "segment", SEGMENTS)
    assert expected in str(caught.value)


EDGES = {
    "axis": (1, 999),
    **dict.fromkeys(("segment",), (0, 10**9)),
    **dict.fromkeys(("cycle", "motion"), (-1, 10**9)),
    "start": (0, 10**15),
    "stop": (1, 10**15),
    "sampling_rate_hz": (1e-9, 1e6),
    "direction": (-1, 1),
    "variance": (0, 1e15),
    "f_max_hz": (0, 1e6),
    "order": (2, 8),
    "tau": (1, 10**9),
    **dict.fromkeys(("n_patterns", "n_masked", "n_pool"), (0, 10**15)),
    "base": (1, 1e15),
    "jsd": (0, 1e3),
    "ks": (0, 1),
    **dict.fromkeys(("frames", "bins"), (0, 10**6)),
    # of all others
    "similarity": (-1e15, 1e15),
}


@pytest.mark.parametrize("name", EDGES)
def test_values_of_a_column_lie_within_its_limits(tmp_path, name):
    low, high = EDGES[name]
    kind = next(schema.field(name).type for schema in TABLES.values() if name in schema.names)
    schema = pa.schema([(name, kind)])
    # as near as a number of the column's type comes
    below, above = (
        (low - 1, high + 1)
        if pa.types.is_integer(kind)
        else (np.nextafter(float(end), away) for end, away in ((low, -np.inf), (high, np.inf)))
    )
    for value, fits in ((low, True), (high, True), (below, False), (above, False)):
        try:
            table = pa.table({name: pa.array([value], kind)})
        except pa.ArrowInvalid:
            continue  # the type itself holds no more
        path = write(tmp_path / "t.parquet", table)
        if fits:
            assert read_table(path, "segment", schema).num_rows == 1
        else:
            with pytest.raises(InputError, match=f"column {name} holds"):
                read_table(path, "segment", schema)


def test_an_order_of_a_line_is_any_number_and_an_unknown_number_none(tmp_path):
    schema = pa.schema([("order", pa.float64())])
    for value, fits in ((0.0, True), (1e15, True), (-0.1, False), (np.nan, True), (np.inf, False)):
        path = write(tmp_path / "t.parquet", pa.table({"order": pa.array([value])}))
        if fits:
            read_table(path, "segment", schema)
        else:
            with pytest.raises(InputError, match="column order holds"):
                read_table(path, "segment", schema)


@pytest.mark.parametrize(("length", "fits"), [(6, True), (5, False), (24, False)])
def test_counts_are_as_many_as_their_order_has_patterns(tmp_path, length, fits):
    row = dict.fromkeys(PATTERNS.names, 1) | {"run": "r", "signal": "phases", "order": 3}
    rows = pa.Table.from_pylist([{**row, "counts": [1] * length}], schema=PATTERNS)
    path = write(tmp_path / "patterns.parquet", rows, stage="patterns")
    if fits:
        assert read_table(path, "patterns", PATTERNS).equals(rows.replace_schema_metadata(None))
        return
    with pytest.raises(InputError, match=f"counts of order 3 are {length}, there are 6 patterns"):
        read_table(path, "patterns", PATTERNS)


@pytest.mark.parametrize("rows", [[0, 1, 0, 1], [1, 0]])
def test_segments_stand_once_and_in_order(tmp_path, rows):
    path = write(tmp_path / "segments.parquet", TABLE.take(rows))
    with pytest.raises(InputError, match=r"segments of an axis twice or not in their order"):
        read_table(path, "segment", SEGMENTS)


def test_a_table_of_another_input_than_lies_beside_it_is_refused(tmp_path):
    first = write(tmp_path / "segments.parquet")
    second = write(tmp_path / "motions.parquet", stage="identify", inputs=[table_input(first)])
    check_current(second)
    check_current(write(tmp_path / "b" / "motions.parquet", inputs=[table_input(first)]))
    write(first, config={"a": 2})
    with pytest.raises(InputError, match=r"another segments.parquet .* run `opamc identify` again"):
        check_current(second)
    check_current(tmp_path / "b" / "motions.parquet")  # of another folder: a variant that is kept
    first.unlink()
    check_current(second)


def test_metadata_that_is_not_json_is_refused(tmp_path):
    path = tmp_path / "segments.parquet"
    pq.write_table(TABLE.replace_schema_metadata({TABLE_KEY: b"{"}), path)
    with pytest.raises(InputError, match="opamc_table"):
        read_table(path, "segment", SEGMENTS)


def test_a_missing_table_names_the_stage_that_makes_it(tmp_path):
    with pytest.raises(InputError, match=r"no such file; run `opamc segment` first"):
        read_table(tmp_path / "segments.parquet", "segment")


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(InputError):
        read_table(tmp_path, "segment")


def test_every_flipped_byte_is_noticed(tmp_path):
    path = write(tmp_path / "segments.parquet")
    content = path.read_bytes()
    damaged = tmp_path / "damaged.parquet"
    for at in range(0, len(content), 23):
        flipped = bytearray(content)
        flipped[at] ^= 0x04
        damaged.write_bytes(flipped)
        try:
            found = read_table(damaged, "segment", SEGMENTS)
        except InputError:
            continue
        assert found.to_pylist() == TABLE.to_pylist(), f"byte {at} of {len(content)}"


def test_what_may_be_unknown(tmp_path):
    every = {name: schema.field(name) for schema in TABLES.values() for name in schema.names}
    assert every.keys() >= MAY_BE_NULL
    for name, field in every.items():
        path = write(tmp_path / "t.parquet", pa.table({name: pa.array([None], field.type)}))
        if name in [
            "temperature_c",
            "gamma",
            "lda",
            "jsd",
            "chance",
            "excess",
            "delta_mu",
            "delta_var",
            "ks",
        ]:
            read_table(path, "segment", pa.schema([field]))
        else:
            with pytest.raises(InputError, match=f"column {name} is null in 1 of 1 rows"):
                read_table(path, "segment", pa.schema([field]))


def test_a_table_names_the_libraries_that_its_numbers_depend_on(tmp_path):
    versions = record_at(write(tmp_path / "t.parquet"))["versions"]
    assert set(versions) >= {"opamc", "python", "numpy", "pyarrow"}
    assert all(version[0].isdigit() for version in versions.values())
