"""YAML as plain values: mappings, lists, text, numbers, truth and nothing, all within bounds.

The document is built from the parser's events, one after the other: no nesting is deep enough to
exhaust the stack, no alias multiplies what it stands for, and no tag makes an object. Dates stay
text, as whoever wants a date says.
"""

import math
import re
from typing import Any

import yaml
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

MOST_VALUES = 100_000
"""Of a document, with what its aliases stand for."""
DEEPEST = 40
MOST_DIGITS = 400
"""Of a number: more than any float has."""

LARGEST = 1e15
"""Of numbers: no quantity of a robot is larger, and sums of it would lose their digits."""

_TAG = "tag:yaml.org,2002:"
_FLOAT = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
_RESOLVER = yaml.SafeLoader("")
_INTEGER = re.compile(r"[-+]?(0b[01_]+|0x[0-9a-fA-F_]+|0[0-7_]*|[1-9][0-9_]*)")


class YamlError(Exception):
    """A document that cannot be taken, with the reason."""


def plain_values(text: str) -> Any:
    """Return the value of a YAML document.

    Raises
    ------
    YamlError
        If it is not YAML, or holds what a configuration does not: tags, too much, too deep.
    """
    builder = _Builder()
    try:
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            builder.take(event)
    except yaml.YAMLError as error:
        raise YamlError(_flat(error)) from error
    return builder.value


class _Writer(yaml.SafeDumper):
    """Quotes text that `plain_values` would take for a number: a robot may be called 1e5."""


_Writer.add_implicit_resolver(
    f"{_TAG}float", re.compile(f"(?:{_FLOAT.pattern})$"), list("-+.0123456789")
)


def yaml_of(value: Any, **form: Any) -> str:
    """Return a document that `plain_values` reads back.

    Parameters
    ----------
    value : object
        Mappings, lists, text, numbers, truth and nothing.
    form : object
        As of `yaml.dump`.
    """
    text: str = yaml.dump(value, Dumper=_Writer, **form)
    return text


class _Builder:
    """The values under construction, innermost last."""

    def __init__(self) -> None:
        self.value: Any = None
        self._documents = 0
        self._count = 0
        self._open: list[tuple[Any, list[Any], str | None, int]] = []
        self._anchors: dict[str, tuple[Any, int]] = {}

    def take(self, event: Any) -> None:
        line = event.start_mark.line + 1
        if isinstance(event, DocumentStartEvent):
            self._documents += 1
            if self._documents > 1:
                self._refuse("holds more than one document", line)
        elif isinstance(event, MappingStartEvent | SequenceStartEvent):
            is_mapping = isinstance(event, MappingStartEvent)
            if event.tag not in (None, "!", _TAG + ("map" if is_mapping else "seq")):
                self._refuse(f"tag {event.tag!r} is not known here", line)
            if len(self._open) >= DEEPEST:
                self._refuse(f"is nested more than {DEEPEST} deep", line)
            self._open.append(({} if is_mapping else [], [], event.anchor, self._count))
        elif isinstance(event, MappingEndEvent | SequenceEndEvent):
            value, _, anchor, before = self._open.pop()
            self._put(value, anchor, self._count - before, line)
        elif isinstance(event, ScalarEvent):
            self._put(_scalar(event, line), event.anchor, 0, line)
        elif isinstance(event, AliasEvent):
            if str(event.anchor) not in self._anchors:
                self._refuse(f"alias *{event.anchor} stands for nothing before it", line)
            value, size = self._anchors[str(event.anchor)]
            self._count += size
            self._put(value, None, 0, line)

    def _put(self, value: Any, anchor: str | None, size: int, line: int) -> None:
        self._count += 1
        if self._count > MOST_VALUES:
            self._refuse(f"holds more than {MOST_VALUES} values", line)
        if anchor is not None:
            self._anchors[anchor] = value, size
        if not self._open:
            self.value = value
            return
        parent, pending, _, _ = self._open[-1]
        if isinstance(parent, list):
            parent.append(value)
        elif not pending:
            if isinstance(value, dict | list):
                kind = "mapping" if isinstance(value, dict) else "list"
                self._refuse(f"a {kind} is no key", line)
            if value in parent:
                self._refuse(f"key {value!r} is given twice", line)
            pending.append(value)
        else:
            parent[pending.pop()] = value

    def _refuse(self, why: str, line: int) -> None:
        msg = f"{why} (line {line})"
        raise YamlError(msg)


def _scalar(event: ScalarEvent, line: int) -> Any:
    text: str = event.value
    tag = event.tag
    if tag in (None, "!"):
        tag = _RESOLVER.resolve(yaml.ScalarNode, text, event.implicit)  # type: ignore[no-untyped-call]
        if event.style is None and tag == f"{_TAG}str" and _FLOAT.fullmatch(text):
            tag = f"{_TAG}float"  # 1e5, which YAML 1.1 takes for a word
    kind = tag.removeprefix(_TAG)
    if kind in ("str", "timestamp") and not _NO_TEXT.search(text):
        return text
    if kind == "null" and text.lower() in ("", "~", "null"):
        return None
    if kind == "bool" and text.lower() in _TRUTH:
        return _TRUTH[text.lower()]
    if kind in ("int", "float") and len(text) <= MOST_DIGITS:
        number = _number(text)
        if number is not None and (abs(number) <= LARGEST or _is_special(number)):
            return number if kind == "int" else float(number)
    shown = text if len(text) <= 40 else f"{text[:40]}…"
    msg = f"{shown!r} is no {kind.replace('!', '')} that is known here (line {line})"
    raise YamlError(msg)


def _is_special(number: float) -> bool:
    return isinstance(number, float) and not math.isfinite(number)


def _number(text: str) -> int | float | None:
    """Return a number of YAML 1.1; None for one in base 60 or none at all."""
    plain = text.replace("_", "")
    if _INTEGER.fullmatch(text):
        sign = -1 if plain.startswith("-") else 1
        digits = plain.lstrip("+-")
        if digits.startswith(("0b", "0x")):
            return sign * int(digits, 0)
        return sign * int(digits, 8 if digits.startswith("0") and len(digits) > 1 else 10)
    lowered = plain.lower()
    if lowered.lstrip("+-") in (".inf", ".nan"):
        return float(lowered.replace(".", ""))
    if _FLOAT.fullmatch(plain):
        return float(plain)
    return None


_NO_TEXT = re.compile("[\\x00\ud800-\udfff]")
"""What no name of a file and no UTF-8 can hold."""
_TRUTH = {"yes": True, "true": True, "on": True, "no": False, "false": False, "off": False}


def _flat(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if len(text) <= 200 else f"{text[:200]}…"
