"""JSON that others may have written: read within bounds, and checked by its schema before use."""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import from_json

from opamc_cli.config.reading import read_text, shown
from opamc_cli.errors import InputError

MOST_BYTES = 256 << 20
"""Of verdict.json: a thousand nights of a hundred joints have less."""

LARGEST = 1e15
"""Of numbers: no quantity of a robot is larger."""

Model = TypeVar("Model", bound="Document")


class Document(BaseModel):
    """A JSON object whose fields have to be what they are said to be; others are passed over."""

    model_config = ConfigDict(strict=True, frozen=True, allow_inf_nan=False)


def parsed(model: type[Model], raw: bytes, place: str, advice: str) -> Model:
    """Return JSON as a document.

    What is wrong is said in a sentence that begins with `place` and ends with `advice`.

    Raises
    ------
    InputError
        If it is no JSON or another document.
    """
    if b"\\u0000" in raw:
        msg = f"{place} holds a character 0, which no name has; {advice}"
        raise InputError(msg)
    try:
        return model.model_validate_json(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "json_invalid":
            why = f"is not JSON ({shown(first['ctx']['error'])})"
        elif first["type"] == "missing":
            why = f"has no {shown_key(key)}"
        elif not key:
            why = f"holds no JSON object but {shown(first['input'])}"
        else:
            wanted = first["msg"][:1].lower() + first["msg"][1:]
            why = f"says {shown_key(key)} is {shown(first['input'])}; {wanted}"
        msg = f"{place} {why}; {advice}"
        raise InputError(msg) from error


def shown_key(key: str) -> str:
    """Return a key's place, shortened if it is no name at all."""
    return key if len(key) <= 100 and key.isprintable() else shown(key)


def read_json(path: Path, schema: str, advice: str) -> dict[str, Any]:
    """Read a JSON file and check it by a schema that comes with the package, such as "verdict".

    Fields that are missing are passed over, as an earlier version may not have written them; but
    every axis has its number.

    Raises
    ------
    InputError
        If it is no regular file, no JSON, or not by the schema; with advice what to do.
    """
    try:
        values = from_json(read_text(path, InputError, MOST_BYTES), allow_inf_nan=False)
    except ValueError as error:
        msg = f"{path}: cannot be read as JSON ({shown(str(error))}); {advice}"
        raise InputError(msg) from error
    axes = values.get("axes") if isinstance(values, dict) else None
    if not isinstance(axes, list) or not all(
        isinstance(entry, dict) and isinstance(entry.get("axis"), int) for entry in axes
    ):
        msg = f"{path}: holds no list 'axes' of objects with 'axis'; {advice}"
        raise InputError(msg)
    rules = _schema(schema)
    for why in _violations(values, rules, "", rules):
        msg = f"{path}: {why}; {advice}"
        raise InputError(msg)
    return dict(values)


@cache
def _schema(name: str) -> Mapping[str, Any]:
    text = (
        resources.files("opamc_cli.storage.schemas")
        .joinpath(f"{name}.schema.json")
        .read_text("utf-8")
    )
    return dict(from_json(text))


_TYPES: Mapping[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "number": (int, float),
    "integer": (int,),
    "boolean": (bool,),
    "null": (type(None),),
}


def _violations(
    value: Any, rules: Mapping[str, Any], place: str, root: Mapping[str, Any]
) -> Iterator[str]:
    """Yield what is wrong with a value by the part of JSON Schema that our schemas use."""
    if "$ref" in rules:
        rules = root["$defs"][rules["$ref"].rpartition("/")[2]]
    here = shown_key(place) or "the document"
    options = rules.get("oneOf") or rules.get("anyOf")
    if options is not None:
        found = [next(_violations(value, option, place, root), None) for option in options]
        if all(found):
            # the option that comes nearest says most
            yield str(found[-1])
        return
    types = rules.get("type", ())
    names = [types] if isinstance(types, str) else types
    if names and not any(_is(value, name) for name in names):
        yield f"{here} is {shown(value)}; {' or '.join(names)} is needed"
        return
    if isinstance(value, int | float) and not isinstance(value, bool):
        if not (math.isfinite(value) and abs(value) <= LARGEST):
            yield f"{here} is {shown(value)}; a number within ±{LARGEST:g} is needed"
        elif value < rules.get("minimum", value) or value > rules.get("maximum", value):
            yield f"{here} is {shown(value)}; it is out of bounds"
    if "enum" in rules and value not in rules["enum"]:
        yield f"{here} is {shown(value)}; one of {', '.join(map(str, rules['enum']))} is needed"
    if "const" in rules and value != rules["const"]:
        yield f"{here} is {shown(value)}; {rules['const']} is needed"
    if isinstance(value, dict):
        others = rules.get("additionalProperties")
        for key, inner in value.items():
            inner_rules = rules.get("properties", {}).get(key)
            if inner_rules is None:
                inner_rules = others if isinstance(others, dict) else {}
            yield from _violations(inner, inner_rules, f"{place}.{key}" if place else key, root)
    elif isinstance(value, list) and isinstance(rules.get("items"), dict):
        for index, inner in enumerate(value):
            yield from _violations(inner, rules["items"], f"{place}[{index}]", root)


def _is(value: Any, name: str) -> bool:
    if isinstance(value, bool):
        return name == "boolean"
    if name == "integer" and isinstance(value, float):
        return value.is_integer()
    return isinstance(value, _TYPES[name])
