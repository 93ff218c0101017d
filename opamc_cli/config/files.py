"""Configuration from YAML files and `--set key=value`, with errors that name the key."""

import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from opamc_cli.config.models import Config
from opamc_cli.config.reading import read_text, shown
from opamc_cli.config.shipped import shipped_file
from opamc_cli.config.yaml.kinds import KEYS, USES, kind_of
from opamc_cli.config.yaml.values import YamlError, plain_values
from opamc_cli.errors import ConfigError

Model = TypeVar("Model", bound=BaseModel)


def load_config(path: Path | None = None, overrides: Sequence[str] = ()) -> Config:
    """Return the configuration of a file, with `key=value` overrides applied.

    Parameters
    ----------
    path
        YAML file; None for the defaults.
    overrides
        Such as ``patterns.gamma=1``; values are YAML.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key or value is not allowed.
    """
    values = read_values(shipped_file(path, "configs") if path else None, overrides)
    return validate(Config, values, str(path) if path else "--set", overrides)


def read_values(
    path: Path | None, overrides: Sequence[str] = (), prepare: Callable[[str], str] = str
) -> dict[str, Any]:
    """Return the mapping of a YAML file (empty without one), with `key=value` overrides applied.

    Parameters
    ----------
    path
        The file; None: no file.
    overrides
        Such as ``patterns.gamma=1``; values are YAML.
    prepare
        Applied to the text of the file and of every override before it is read.

    Raises
    ------
    ConfigError
        If the file or an override cannot be read.
    """
    values = read_yaml(path, prepare) if path is not None else {}
    for override in map(prepare, overrides):
        key, separator, text = override.partition("=")
        if not separator or not key:
            msg = f"--set {shown(override)}: write it as key=value, such as patterns.gamma=1"
            raise ConfigError(msg)
        try:
            value = plain_values(text)
        except YamlError as error:
            missing = _unclosed(text)
            if 0 < len(missing) <= 5:
                msg = f"--set {override}: a bracket is open; write {key}={text}{missing}"
            else:
                msg = f"--set {shown(override)}: the value is not YAML ({error})"
                if text in (",", "|"):  # signs that separate columns, and mean something in YAML
                    msg += f"; write --set '{key}=\"{text}\"'"
            raise ConfigError(msg) from error
        _set(values, key.split("."), value, override)
    return values


def read_yaml(path: Path, prepare: Callable[[str], str] = str) -> dict[str, Any]:
    """Read a YAML file that must hold a mapping, `prepare` being applied to its text.

    Raises
    ------
    ConfigError
        If it is missing, not YAML, has a key twice, or is no mapping.
    """
    text = read_text(path, ConfigError)
    try:
        values = plain_values(prepare(text))
    except YamlError as error:
        # what stands for all axes in a map is a mapping to YAML, but for who reads maps
        of_map = "axis{n" in text and prepare is str
        what = f"is {USES['map']}" if of_map else f"is not valid YAML: {error}"
        msg = f"{path}: {what}"
        raise ConfigError(msg) from error
    if values is None:
        return {}
    if not isinstance(values, dict):
        msg = f"{path}: holds a {type(values).__name__}, a mapping of keys is needed"
        raise ConfigError(msg)
    return values


def validate(
    model: type[Model], values: dict[str, Any], source: str, overrides: Sequence[str] = ()
) -> Model:
    """Return `values` as a `model`, or name the first key that is wrong.

    It is the source's, or that of ``--set`` where one of the overrides gave it.

    Raises
    ------
    ConfigError
        For an unknown key (with a suggestion) or a value out of bounds.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = min(error.errors(), key=_helps_little)
        missing = first["type"] == "missing"
        place = [_part(part) for part in _keys_of(values, first["loc"], missing=missing)]
        key = ".".join(place)
        if key in {override.partition("=")[0] for override in overrides}:
            source = "--set"
        if first["type"] == "extra_forbidden":
            known = _known_keys(model, first["loc"][:-1])
            if len(place) == 1:
                refuse_other_kind(source, values, known)
            close = difflib.get_close_matches(place[-1], known, n=1, cutoff=0.5)
            other = f"known: {', '.join(known)}" if known else "check its spelling"
            hint = f"did you mean {close[0]!r}?" if close else other
            msg = f"{source}: unknown key {key!r}; {hint}"
        elif first["type"] == "value_error":
            named = f"{key}: " if key else ""
            msg = f"{source}: {named}{first['ctx']['error']}"
        elif missing:
            msg = f"{source}: {key} is missing; add it"
        else:
            # what a key takes may be of several kinds
            kinds = [e["type"] for e in error.errors() if e["loc"][:-1] == first["loc"][:-1]]
            takes = dict.fromkeys(TAKES[kind] for kind in kinds if kind in TAKES)
            wanted = " or ".join(takes).replace(" or it takes ", " or ")
            wanted = wanted if first["type"] in TAKES else _lower_first(first["msg"])
            if "valid tuple" in wanted:
                wanted = f"it takes a list, such as {key}={_example(model, first['loc'])}"
            msg = f"{source}: {key} is {shown(first['input'])}; {wanted}"
        raise ConfigError(msg) from error


TAKES = {
    "float_type": "it takes a number",
    "float_parsing": "it takes a number",
    "int_type": "it takes a whole number",
    "int_parsing": "it takes a whole number",
    "int_from_float": "it takes a whole number",
    "finite_number": "it takes a number",
    "string_type": "it takes a word",
    "dict_type": "it takes keys and their values",
    "model_type": "it takes keys and their values",
}
"""What is said of values of another kind, in place of pydantic's own words."""


def _keys_of(values: Any, place: Sequence[int | str], *, missing: bool) -> Iterator[int | str]:
    """Yield the keys of a value's place, the last of which may be missing.

    Pydantic names the choices of "a word or a section" as well, which the values do not hold.
    """
    for depth, part in enumerate(place, 1):
        entry = isinstance(values, list) and isinstance(part, int) and part < len(values)
        if entry or (isinstance(values, Mapping) and part in values):
            values = values[part]
            yield part
        elif missing and depth == len(place):
            yield part


def _helps_little(found: Mapping[str, Any]) -> tuple[bool, bool, int]:
    """Sort key: a misspelt key is also a missing one, and a section is no word and no number."""
    wants_word = found["type"] in ("literal_error", "string_type")
    wants_number = found["type"] in ("float_type", "int_type")
    no_word = wants_word and not isinstance(found["input"], str)
    no_word |= wants_number and isinstance(found["input"], Mapping)
    return found["type"] != "extra_forbidden", no_word, -len(found["loc"]) if no_word else 0


def refuse_other_kind(source: str, values: Mapping[str, Any], known: Iterable[str]) -> None:
    """Refuse a document of another kind than that whose keys are `known`.

    Raises
    ------
    ConfigError
        Saying what the document is for.
    """
    other = kind_of(values)
    own = set(values) & set(known)
    if other is not None and len(set(values) & set(KEYS[other])) > len(own):
        msg = f"{source}: is {USES[other]}; its keys are {', '.join(map(str, values))}"
        raise ConfigError(msg)


def _unclosed(text: str) -> str:
    """Return the brackets that a value lacks at its end."""
    pairs = {"[": "]", "{": "}"}
    open_ones: list[str] = []
    for character in text:
        if character in pairs:
            open_ones.append(pairs[character])
        elif open_ones and character == open_ones[-1]:
            open_ones.pop()
    return "".join(reversed(open_ones))


def _example(model: type[BaseModel], place: tuple[int | str, ...]) -> str:
    """Return the default of a key that takes a list, as it is written after ``--set``."""
    current: Any = model
    default: Any = None
    for part in place:
        field = getattr(current, "model_fields", {}).get(part)
        if field is None:
            default = None
            break
        current, default = field.annotation, field.default
    items = default if isinstance(default, tuple) and default else ("…",)
    return f"[{','.join(map(str, items))}]"


def _known_keys(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    current: Any = model
    for part in place:
        field = getattr(current, "model_fields", {}).get(part)
        annotation = current if field is None else field.annotation
        # a section may be optional, one of several kinds, or the value of a free-named mapping
        current = next((o for o in _within(annotation) if hasattr(o, "model_fields")), annotation)
    return sorted(getattr(current, "model_fields", {}))


def _within(annotation: Any) -> Iterator[Any]:
    """Yield an annotation and all that it is made of, outside first."""
    yield annotation
    for part in get_args(annotation):
        yield from _within(part)


def _set(values: dict[str, Any], keys: list[str], value: Any, override: str) -> None:
    for key in keys[:-1]:
        values = values.setdefault(key, {})
        if not isinstance(values, dict):
            msg = f"--set {shown(override)}: {shown(key)} is not a section of the configuration"
            raise ConfigError(msg)
    values[keys[-1]] = value


def _part(part: int | str) -> str:
    """Return a part of a key's place: as it is, unless it is no name at all."""
    return str(part) if len(str(part)) <= 80 else shown(part)


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]
