"""Wrong documents, given to the command: one sentence and the right code, whatever is in them."""

import os
import sqlite3
from contextlib import closing

import pytest
from fuzz import fuzz
from mutations import ODD_YAML

from opamc_cli.errors import InputError
from opamc_cli.storage.history.history import History
from opamc_cli.storage.history.rows import NightRow


@pytest.mark.parametrize("odd", ODD_YAML, ids=range(len(ODD_YAML)))
def test_odd_yaml_in_a_configuration(opamc, tmp_path, odd):
    file = tmp_path / "c.yaml"
    file.write_text(f"score:\n  base: {odd}\n")
    for arguments in (["--config", file], ["--set", f"score.base={odd}"]):
        ended = opamc("config", "check", *arguments)
        assert ended.code == 2, ended
        (sentence,) = ended.sentences
        assert len(sentence) < 600


@pytest.mark.parametrize(
    "code",
    [
        "import sys\nsys.exit(0)",
        "def (",
        "x = 1",
        "from opamc_cli.joint.effects.base import Effect\n"
        "class Mine(Effect):\n    name, domain = 'mine', 7\n",
        "from opamc_cli.joint.effects.base import Effect\n"
        "class Mine(Effect):\n    name, domain = 'mine', 'time'\n"
        "    def __init__(self): raise RuntimeError('no')\n",
    ],
)
def test_effect_files_that_define_nothing(opamc, tmp_path, tonight, code):
    (tmp_path / "mine.py").write_text(code)
    (tmp_path / "model.yaml").write_text("library: [mine.py]\n")
    ended = opamc("model", "fit", tonight, "--model", tmp_path / "model.yaml", "--out", tmp_path)
    assert ended.code == 2
    assert "mine.py" in ended.sentences[0]


@pytest.mark.parametrize(
    "edit",
    [
        "UPDATE night SET key = '[]'",
        "UPDATE night SET key = 'rubbish'",
        "UPDATE night SET attempts = 'many'",
        "UPDATE night SET status = 'fine'",
        "UPDATE night SET night = 'x'",
    ],
)
def test_a_history_that_was_edited(tmp_path, edit):
    path = tmp_path / "history.sqlite"
    key = '{"version": "1", "config": "c", "baseline": "b", "files": []}'
    with History(path) as history:
        history.record_night(NightRow("r1", "2026-03-01", key, "done"))
        assert len(history.nights()) == 1
    with closing(sqlite3.connect(path)) as base:
        base.execute(edit)
        base.commit()
    with History(path) as history, pytest.raises(InputError, match="did not write"):
        history.nights()


def test_a_history_whose_tables_were_changed(tmp_path):
    path = tmp_path / "history.sqlite"
    with History(path):
        pass
    with closing(sqlite3.connect(path)) as base:
        base.execute("ALTER TABLE verdict RENAME COLUMN state TO State")
        base.commit()
    with pytest.raises(InputError, match="not as opamc makes them"):
        History(path)


@pytest.mark.parametrize("of", [b"CREATE TABLE night", b"verdict", b"2026-03-01"])
def test_a_history_whose_bytes_are_no_text(tmp_path, of):
    path = tmp_path / "history.sqlite"
    with History(path) as history:
        history.record_night(NightRow("r1", "2026-03-01", "{}", "done"))
    content = path.read_bytes()
    assert of in content
    path.write_bytes(content.replace(of, b"\xff" * len(of)))
    with pytest.raises(InputError, match="history"), History(path) as history:
        history.nights()


def test_names_that_are_no_text(opamc, tmp_path, tonight):
    name = os.fsdecode(b"\xff.parquet")
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / name).write_bytes(tonight.read_bytes())
    for given_path in (tmp_path / "runs", tmp_path / "runs" / name):
        ended = opamc("segment", given_path, "--out", tmp_path / "out")
        assert ended.code in (2, 3)
        assert "UTF-8" in ended.sentences[0]


@pytest.mark.long
def test_a_hundred_wrong_inputs_of_every_kind(monkeypatch):
    """The short form of `make fuzz`: figures are made of what is odd, but no picture of them."""
    monkeypatch.setattr("opamc_cli.stages.report.figures.figure.to_svg", lambda *_: "<svg/>")
    ends = fuzz(60, 1.0, 20260301)
    assert sum(ends.values()) > 10
    assert not [end for end in ends if "WRONG" in end]
