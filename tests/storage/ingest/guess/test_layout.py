"""How text tables of loggers are laid out."""

import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.ingest.guess import layout
from opamc_cli.storage.ingest.guess.layout import Layout, text_layout


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t,i\n0.5,1\n1.5,2\n", (",", ".", True, 0, 0)),
        ("0.5,1\n1.5,2\n", (",", ".", False, 0, 0)),
        # a heading, a header, units, and an empty line between
        ("made by;7\n\n t ;i\n[s];[A]\n\n0,5;1,5\n1,5;2\n", (";", ",", True, 2, 1)),
        ("title\ndate;x;y\na;b;c\ns;A;A\n1;2;3\n4;5;6\n", (";", ".", True, 2, 1)),
        # too few names for titles: two of nine columns
        ("a,b,,,,,,,\n" + "1,2,3,4,5,6,7,8,9\n" * 2, (",", ".", False, 1, 0)),
        ("a,b,c,,,,,,\n" + "1,2,3,4,5,6,7,8,9\n" * 2, (",", ".", True, 0, 0)),
        ("t\ti\n1\t2\n3\t4\n", ("tab", ".", True, 0, 0)),
        ("t|i\n1|2\n3|4\n", ("|", ".", True, 0, 0)),
        ("t  i\n 1  2\n3   4 \n", ("whitespace", ".", True, 0, 0)),
        # quoted numbers, a date in every row, cells that are empty
        ('"t","i"\n"1","2"\n"3",\n', (",", ".", True, 0, 0)),
        ("when,i\n2026-03-01T08:00:00,1\n2026-03-01T08:00:01,2\n", (",", ".", True, 0, 0)),
        ("when;i\n2026-03-01T08:00:00,5;1\n2026-03-01T08:00:01,5;2\n", (";", ".", True, 0, 0)),
        # half of the cells may be words
        ("t,i,state,mode\n1,2,run,auto\n3,4,run,auto\n", (",", ".", True, 0, 0)),
        ("x;y;z\n1.5;-2.25;3.\n.5;1e-3;nan\n+4;5E+2;-Inf\n", (";", ".", True, 0, 0)),
    ],
)
def test_layouts(tmp_path, text, expected):
    path = tmp_path / "log.csv"
    path.write_text(text)
    assert text_layout(path) == Layout(*expected, "utf-8")


def test_a_separator_that_ends_each_row_makes_no_column(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("12 December\t17:15\n\nt\tangle\tcurrent\n0\t1,5\t2,5\t\n1\t1,6\t2,5\t\n")
    found = text_layout(path)
    assert (found.separator, found.decimal, found.header, found.skip_rows) == ("tab", ",", True, 2)


def test_too_few_numbers_are_no_table(tmp_path):
    path = tmp_path / "log.csv"
    for text in ("1,2\n", "a,b,1\na,b,2\n", "a,b\nc,d\n"):
        path.write_text(text)
        with pytest.raises(InputError, match="no rows of numbers"):
            text_layout(path)


@pytest.mark.parametrize(
    ("encoding", "found"),
    [("utf-8", "utf-8"), ("utf-8-sig", "utf-8"), ("utf-16", "utf-16"), ("cp1252", "cp1252")],
)
def test_encodings(tmp_path, encoding, found):
    path = tmp_path / "log.csv"
    path.write_text("Zeit,Strom °\n1,2\n3,4\n", encoding=encoding)
    assert text_layout(path) == Layout(",", ".", True, 0, 0, found)


def test_a_line_that_is_cut_off_is_not_looked_at(tmp_path, monkeypatch):
    path = tmp_path / "log.csv"
    path.write_text("t,i\n1,2\n3,4\n5,6\n")
    for most in range(12, 17):
        monkeypatch.setattr(layout, "LOOKED_AT_BYTES", most)
        assert text_layout(path).header
