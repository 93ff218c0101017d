"""JSON of others' making, by its rules and within bounds."""

import json

import pytest

from opamc_cli.errors import InputError
from opamc_cli.storage.files import json_documents
from opamc_cli.storage.files.json_documents import Document, parsed, read_json, shown_key

RULES = {
    "$defs": {"share": {"type": "number", "minimum": 0, "maximum": 1}},
    "type": "object",
    "properties": {
        "axes": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "axis": {"type": "integer"},
                    "share": {"$ref": "#/$defs/share"},
                    "state": {"enum": ["good", "bad"]},
                    "kind": {"const": "arm"},
                    "name": {"type": ["string", "null"]},
                    "sure": {"type": "boolean"},
                    "either": {"oneOf": [{"type": "null"}, {"type": "array"}]},
                    "any": {"anyOf": [{"type": "null"}, {"type": "object"}]},
                    "by_name": {"additionalProperties": {"type": "number"}},
                    "free": {"type": "object", "additionalProperties": True},
                },
            },
        }
    },
}


def read(tmp_path, monkeypatch, text):
    monkeypatch.setattr(json_documents, "_schema", lambda name: {"rules": RULES}[name])
    path = tmp_path / "a.json"
    path.write_text(text)
    return read_json(path, "rules", "do it again")


@pytest.mark.parametrize(
    "entry",
    [
        {"axis": 1, "share": 0, "state": "bad", "kind": "arm", "name": None, "sure": False},
        {"axis": 2, "share": 1, "name": "", "either": [], "any": {}},
        {"axis": 3, "share": 0.5, "either": None, "any": None, "by_name": {"x": 1e15}},
        {"axis": 4, "free": {"x": [True, "y"]}, "unknown": -1e15},
    ],
)
def test_what_is_by_the_rules_is_read(tmp_path, monkeypatch, entry):
    values = {"axes": [{"axis": 9}, entry], "more": 1}
    assert read(tmp_path, monkeypatch, json.dumps(values)) == values


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ({"share": -0.1}, "axes[1].share is -0.1; it is out of bounds"),
        ({"share": 1.1}, "axes[1].share is 1.1; it is out of bounds"),
        ({"share": 1.1e16}, "axes[1].share is 1.1e+16; a number within ±1e+15 is needed"),
        ({"share": True}, "axes[1].share is True; number is needed"),
        ({"share": "1"}, "axes[1].share is '1'; number is needed"),
        ({"state": "ugly"}, "axes[1].state is 'ugly'; one of good, bad is needed"),
        ({"kind": "leg"}, "axes[1].kind is 'leg'; arm is needed"),
        ({"name": 1}, "axes[1].name is 1; string or null is needed"),
        ({"sure": 1}, "axes[1].sure is 1; boolean is needed"),
        ({"either": {}}, "axes[1].either is {}; array is needed"),
        ({"any": 1}, "axes[1].any is 1; object is needed"),
        ({"by_name": {"x": 1, "y": None}}, "axes[1].by_name.y is None; number is needed"),
        ({"unknown": 2e16}, "axes[1].unknown is 2e+16; a number within ±1e+15 is needed"),
        ({"axis": 1.5}, "holds no list 'axes' of objects with 'axis'"),
        ({"axis": None}, "holds no list 'axes' of objects with 'axis'"),
    ],
)
def test_what_is_not_is_told(tmp_path, monkeypatch, entry, why):
    with pytest.raises(InputError) as refused:
        read(tmp_path, monkeypatch, json.dumps({"axes": [{"axis": 1}, {"axis": 2} | entry]}))
    assert str(refused.value) == f"{tmp_path / 'a.json'}: {why}; do it again"


@pytest.mark.parametrize("text", ["[]", "{}", '{"axes": {}}', '{"axes": [1]}', '{"axes": [{}]}'])
def test_every_axis_has_its_number(tmp_path, monkeypatch, text):
    with pytest.raises(InputError, match="holds no list 'axes' of objects with 'axis'; do it"):
        read(tmp_path, monkeypatch, text)


def test_what_is_no_json_or_too_long_is_not_read(tmp_path, monkeypatch):
    for text in ("", "{", '{"axes": NaN}'):
        with pytest.raises(InputError, match=r"cannot be read as JSON .*; do it again"):
            read(tmp_path, monkeypatch, text)
    monkeypatch.setattr(json_documents, "MOST_BYTES", 12)
    assert read(tmp_path, monkeypatch, '{"axes": []}') == {"axes": []}
    with pytest.raises(InputError):
        read(tmp_path, monkeypatch, '{"axes": [] }')


class Joint(Document):
    name: str
    limit: float | None = None


def test_documents_say_what_is_wrong_with_them():
    assert parsed(Joint, b'{"name": "j", "limit": 1, "more": 0}', "x", "y") == Joint(
        name="j", limit=1
    )
    for raw, why in (
        (b"{", "is not JSON ("),
        (b"{}", "has no name; y"),
        (b"[]", "holds no JSON object but []; y"),
        (b'{"name": 1}', "says name is 1; input should be a valid string; y"),
        (b'{"name": "j", "limit": "1"}', "says limit is '1'; input should be a valid number; y"),
        (b'{"name": "j\\u0000"}', "holds a character 0, which no name has; y"),
    ):
        with pytest.raises(InputError) as refused:
            parsed(Joint, raw, "x", "y")
        assert str(refused.value).startswith(f"x {why}")


def test_keys_that_are_no_names_are_shortened():
    assert shown_key("a" * 100) == "a" * 100
    assert len(shown_key("a" * 101)) < 101
    assert shown_key("a\n") == "'a\\n'"
