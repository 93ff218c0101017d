"""What a Parquet reader stumbles over, as a sentence."""

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.files import parquet
from opamc_cli.storage.files.parquet import read_schema, read_whole, reading, shown_line


def test_a_foreign_error_s_first_line_is_told(tmp_path):
    said = r"r: cannot be read as Parquet \(bad\); do it$"
    with pytest.raises(InputError, match=said), reading(tmp_path / "r", "do it"):
        raise ValueError(" bad.\nmore")  # noqa: EM101
    with pytest.raises(InputError, match=r"\(KeyError\)"), reading(tmp_path / "r", "do it"):
        raise KeyError


@pytest.mark.parametrize("kind", [MemoryError, InputError])
def test_what_is_no_damage_passes(tmp_path, kind):
    with pytest.raises(kind, match=r"^own$"), reading(tmp_path, "do it"):
        raise kind("own")  # noqa: EM101


def test_a_line_is_bounded_and_printable():
    assert shown_line("a\x00b.") == "a�b"
    assert shown_line("x" * 160) == "x" * 160
    assert shown_line("x" * 161) == "x" * 160 + "…"


def test_a_column_twice_is_refused(tmp_path):
    path = tmp_path / "r.parquet"
    pq.write_table(pa.table([pa.array([1]), pa.array([2])], names=["a", "a"]), path)
    with pytest.raises(InputError, match="has column 'a' more than once"):
        read_schema(path, "do it")


def test_a_table_has_at_most_so_many_rows(tmp_path, monkeypatch):
    path, table = tmp_path / "r.parquet", pa.table({"a": [1, 2, 3]})
    pq.write_table(table, path)
    monkeypatch.setattr(parquet, "MOST_ROWS", 3)
    assert read_whole(path, "do it").equals(table)
    monkeypatch.setattr(parquet, "MOST_ROWS", 2)
    with pytest.raises(InputError, match="has 3 rows, at most 2 are read"):
        read_whole(path, "do it")
